# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The linters of ament, where they are installed."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = 'rigid_gns_core', 'rigid_gns_ros', 'tests', 'benchmarks', 'launch', 'docs', 'setup.py'
SOURCES = [str(ROOT / name) for name in NAMES]
# what a name says needs no docstring; ruff's own list is in pyproject.toml
UNSAID = [f'D{number}' for number in range(100, 108)]
ARGUMENTS = {
    'ament_flake8': ['--config', str(ROOT / '.flake8'), *SOURCES],
    'ament_pep257': ['--convention', 'google', '--add-ignore', *UNSAID, '--', *SOURCES],
}


@pytest.mark.parametrize('linter', ARGUMENTS)
def test_nothing_is_found(linter: str) -> None:
    pytest.importorskip(linter, reason='comes with an apt installation of ROS only')
    assert importlib.import_module(f'{linter}.main').main(argv=ARGUMENTS[linter]) == 0
