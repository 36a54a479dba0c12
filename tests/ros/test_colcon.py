# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package in a colcon workspace, found and started the way `ros2 run` does."""

from __future__ import annotations

from collections.abc import Callable
import importlib.util
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')
for _name, _purpose in (('colcon_core', 'colcon'), ('ament_index_python', 'the ament index')):
    if importlib.util.find_spec(_name) is None:
        pytest.skip(f'{_purpose} is not installed', allow_module_level=True)

ROOT = Path(__file__).resolve().parents[2]
NEEDED = ('package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml', 'README.md', 'LICENSE')
FOLDERS = ('resource', 'config', 'launch', 'rviz', 'foxglove', 'rigid_gns_core', 'rigid_gns_ros')
STAMP = 1_000_000_000_123


def environment(**changes: str) -> dict[str, str]:
    """Return this interpreter's environment without its way to the source tree."""
    kept = {name: value for name, value in os.environ.items() if name != 'PYTHONPATH'}
    # `#!/usr/bin/env python3` must find the interpreter that has the dependencies
    kept['PATH'] = f'{Path(sys.executable).parent}{os.pathsep}{kept.get("PATH", "")}'
    return {**kept, **changes}


@pytest.fixture(scope='module')
def install(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """install/ of a workspace that holds a copy of this package."""
    workspace = tmp_path_factory.mktemp('workspace')
    package = workspace / 'src' / 'rigid_gns_ros'
    package.mkdir(parents=True)
    for name in NEEDED:
        shutil.copy(ROOT / name, package)
    for name in FOLDERS:
        ignored = shutil.ignore_patterns('*.pyc')  # machine code is copied, not made again
        shutil.copytree(ROOT / name, package / name, ignore=ignored)
    built = subprocess.run(
        [sys.executable, '-m', 'colcon', 'build', '--event-handlers', 'console_direct+'],
        cwd=workspace,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=900,  # where the machine code was not there to be copied
    )
    assert built.returncode == 0, built.stdout + built.stderr
    return workspace / 'install'


def in_workspace(install: Path, command: str) -> list[str]:
    return ['bash', '-c', f'source {install}/setup.bash && {command}']


def output_in_workspace(install: Path, command: str, timeout: float) -> str:
    done = subprocess.run(
        in_workspace(install, command),
        env=environment(),
        cwd=install,
        capture_output=True,
        text=True,
        timeout=timeout,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope='module')
def prefix(install: Path) -> Path:
    """Prefix of the package by the ament index."""
    program = (
        'from ament_index_python.packages import get_package_prefix as f; '
        'print(f("rigid_gns_ros"))'
    )
    return Path(output_in_workspace(install, f"python3 -c '{program}'", 60).strip())


def test_everything_is_installed(install: Path, prefix: Path) -> None:
    assert prefix == install / 'rigid_gns_ros'
    for name in ('simulator', 'tracker', 'evaluate'):
        executable = prefix / 'lib' / 'rigid_gns_ros' / name
        assert os.access(executable, os.X_OK), executable
    share = prefix / 'share' / 'rigid_gns_ros'
    for name in (
        'package.xml',
        'config/simulator.yaml',
        'config/scenes/box_154.yaml',
        'launch/simulator_launch.py',
        'launch/demo_launch.py',
        'launch/playback_launch.py',
        'config/table_tennis.yaml',
        'config/scenes/billiards.yaml',
        'rviz/rigid_gns.rviz',
        'foxglove/rigid_gns.json',
    ):
        assert (share / name).is_file(), name


def test_the_command_is_on_the_path(install: Path, prefix: Path) -> None:
    found = output_in_workspace(install, 'command -v rigid-gns && rigid-gns --version', 60)
    place, version = found.splitlines()
    assert Path(place) == prefix / 'bin' / 'rigid-gns'
    assert version.startswith('rigid-gns ')


def test_the_executable_predicts(
    install: Path,
    prefix: Path,
    run_process: Callable[..., Any],
    bench: Any,
    falling: Callable[..., np.ndarray],
) -> None:
    executable = prefix / 'lib' / 'rigid_gns_ros' / 'simulator'
    params_file = prefix / 'share' / 'rigid_gns_ros' / 'config' / 'simulator.yaml'
    command = f'exec {executable} --ros-args --params-file {params_file} -p frame_id:=lab'
    run = run_process(in_workspace(install, command), environment=environment())
    run.wait_for('ready: ')
    tracked = bench.tracked()
    frames = tracked.send_until(3, falling(0.0, count=5), STAMP, 'lab')
    for frame in frames:
        assert frame.frame_id == 'lab'
        assert frame.poses.shape == (5, 7) and np.isfinite(frame.poses).all()
        periods, rest = divmod(frame.stamp_ns - STAMP, 100_000_000)
        assert rest == 0 and periods > 5  # the file's velocity_window is 6
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
    assert 'Traceback' not in run.output
    assert 'compiling' not in run.output  # the build did
