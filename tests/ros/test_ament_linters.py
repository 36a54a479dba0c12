# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The linters of ament, where they are installed."""

from __future__ import annotations

import importlib
from pathlib import Path
import subprocess
import sys

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


@pytest.mark.slow
def test_flake8_with_its_plugins_finds_nothing() -> None:
    """What ament_flake8 runs, wherever it comes from; with its plugins of the extra `test`."""
    pytest.importorskip('flake8', reason='of the extra test')
    command = [sys.executable, '-m', 'flake8', '--config', str(ROOT / '.flake8'), *SOURCES]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize('linter', ARGUMENTS)
def test_nothing_is_found(linter: str) -> None:
    pytest.importorskip(linter, reason='comes with an apt installation of ROS only')
    assert importlib.import_module(f'{linter}.main').main(argv=ARGUMENTS[linter]) == 0
