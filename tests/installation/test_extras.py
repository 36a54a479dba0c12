# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
        ('rerun', 'viz'),
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
