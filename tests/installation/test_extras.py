# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What to install where a module is missing."""

from __future__ import annotations

from importlib import metadata
import re
import sys

from rigid_gns_core.installation import extras, versions

# extras of users; the others are of those who work on the package
USED = ('torch', 'teacher', 'plot', 'bench', 'worlds', 'cluster', 'ros')


def test_each_is_what_the_package_asks_for() -> None:
    asked, wanted = {}, set()
    for line in metadata.requires('rigid_gns_ros') or []:
        name, _, marker = line.partition(';')
        if 'extra ==' not in marker:
            asked[re.match(r'[\w.-]+', name)[0]] = None
        elif re.search(r'extra == ["\'](\w+)', marker)[1] in USED:
            wanted.add(name.strip())
    assert set(extras.CORE.values()) == set(asked)
    assert {one for several in extras.EXTRAS.values() for one in several} == wanted


def test_a_module_is_installed_by_its_own_name() -> None:
    assert extras.remedy('matplotlib.figure') == "pip install 'matplotlib>=3.8'"
    assert extras.remedy('rclpy').endswith("'ros-jazzy-common-interfaces==5.3.6'")
    for module in (*extras.EXTRAS, *extras.CORE):  # this package is on no index
        assert 'rigid_gns' not in extras.remedy(module)


def test_what_everything_needs_is_no_extra() -> None:
    assert extras.remedy('yaml') == 'pip install PyYAML'


def test_what_nothing_asks_for_has_no_remedy() -> None:
    assert extras.remedy('no_such_module') is None


def test_an_extra_that_would_install_nothing_is_not_advised() -> None:
    assert extras.remedy('pybullet', (3, 11)) == "pip install 'pybullet>=3.2.6'"
    newer = extras.remedy('pybullet', (3, 12))
    assert 'no wheel for Python 3.12 or newer: use Python 3.11' in newer
    assert 'with a C++ compiler: pip install pybullet' in newer


def test_an_error_tells_what_needs_the_module_and_the_remedy() -> None:
    error = extras.missing(ModuleNotFoundError('gone', name='no_such'), 'this command')
    assert (str(error), error.name) == (
        'this command needs no_such, which is not installed',
        'no_such',
    )


def test_versions_are_those_of_the_metadata() -> None:
    assert versions.versions_of(['numpy', 'no-such-distribution']) == {
        'numpy': sys.modules['numpy'].__version__,
        'no-such-distribution': None,
    }
    assert versions.version_of(versions.PACKAGE) == metadata.version('rigid_gns_ros')
