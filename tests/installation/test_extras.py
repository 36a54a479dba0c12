# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What to install where a module is missing."""

from __future__ import annotations

from importlib import metadata
import sys

import pytest
from rigid_gns_core.installation import extras, versions


@pytest.mark.parametrize(
    ('module', 'extra'),
    [
        ('torch', 'torch'),
        ('torch.nn', 'torch'),
        ('matplotlib.figure', 'plot'),
        ('mujoco', 'bench'),
        ('distributed', 'cluster'),
        ('rclpy', 'ros'),
    ],
)
def test_the_extra_of_a_module(module: str, extra: str) -> None:
    assert extras.remedy(module).endswith(f"pip install 'rigid_gns_ros[{extra}]'")


def test_what_everything_needs_is_no_extra() -> None:
    assert extras.remedy('yaml').startswith("pip install 'PyYAML>=")


def test_what_nothing_asks_for_has_no_remedy() -> None:
    assert extras.remedy('no_such_module') is None


def test_an_extra_that_would_install_nothing_is_not_advised() -> None:
    assert extras.remedy('pybullet', (3, 11)) == "pip install 'rigid_gns_ros[teacher]'"
    newer = extras.remedy('pybullet', (3, 12))
    assert 'no wheel for Python 3.12 or newer: use Python 3.11' in newer
    assert 'with a C++ compiler: pip install pybullet' in newer


def test_a_source_tree_that_is_not_installed_knows_no_extras(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(extras, 'PACKAGE', 'no-such-distribution')
    assert extras.remedy('torch') is None
    error = extras.missing(ModuleNotFoundError('gone', name='torch'), 'this command')
    assert (str(error), error.name) == (
        'this command needs torch, which is not installed',
        'torch',
    )


def test_versions_are_those_of_the_metadata() -> None:
    assert versions.versions_of(['numpy', 'no-such-distribution']) == {
        'numpy': sys.modules['numpy'].__version__,
        'no-such-distribution': None,
    }
    assert versions.version_of(versions.PACKAGE) == metadata.version('rigid_gns_ros')
