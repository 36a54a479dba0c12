# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.files.strict_json import read_json

ROOT = Path(__file__).resolve().parents[2]


def start(folder: Path, *options: str, **environment: str) -> subprocess.Popen[str]:
    command = [sys.executable, '-m', 'rigid_gns_ros.demo', '--out', str(folder), *options]
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=ROOT,
        start_new_session=True,
        env={**os.environ, **environment},
    )


def nodes_of(folder: Path) -> list[str]:
    """Command lines of the processes that record into this folder or log there."""
    found = []
    for entry in Path('/proc').glob('[0-9]*'):
        try:
            variables = (entry / 'environ').read_bytes()
            if f'ROS_LOG_DIR={folder}/'.encode() in variables:
                found.append((entry / 'cmdline').read_text().replace('\0', ' '))
        except OSError:
            continue  # gone, or not ours
    return found


@pytest.mark.slow
def test_the_demonstration(tmp_path: Path) -> None:
    folder = tmp_path / 'demo'
    process = start(folder, '--seconds', '4')
    output, _ = process.communicate(timeout=180)
    assert process.returncode == 0, output
    report = read_json(folder / 'report.json')
    # 4 s at 10 Hz, less what a busy machine may lose
    assert report['frames']['compared'] >= 20
    assert report['recording']['predicted'] == '/predicted_poses'
    assert (folder / 'report.png').read_bytes().startswith(b'\x89PNG')
    assert 'id="replay"' in (folder / 'report.html').read_text(encoding='utf-8')
    assert (folder / 'bag' / 'metadata.yaml').is_file()
    assert (folder / 'ball' / 'bag' / 'metadata.yaml').is_file()
    assert 'id="replay"' in (folder / 'ball' / 'report.html').read_text(encoding='utf-8')
    # of the ball there is a forecast from every frame, less what a busy machine may lose
    for lead in ('0.2', '0.4'):
        (line,) = (text for text in output.splitlines() if f'{lead} s ahead: mean' in text)
        error, count = float(line.split('mean')[1].split()[0]), int(line.split('of')[1].split()[0])
        # six frames without air and spin are off by 10 and 19 cm, the laws by 1 and 2
        assert count >= 5 and error < 25.0 * float(lead)
    for text in (
        'Normalized Cumulative Energy Gain',
        'Lateness',
        str(folder / 'bag'),
        'report.png',
        'report.html',
    ):
        assert text in output
    assert not nodes_of(folder)


def test_a_failing_node_is_shown(tmp_path: Path) -> None:
    process = start(tmp_path / 'demo', ROS_LOG_DIR='', PYTHONPATH=broken(tmp_path))
    output, _ = process.communicate(timeout=120)
    assert process.returncode == 1, output
    assert 'the simulator ended with exit code' in output
    assert 'no geometry today' in output
    assert not nodes_of(tmp_path / 'demo')


def broken(folder: Path) -> str:
    """Return a path on which a dependency of the nodes cannot be imported."""
    package = folder / 'broken' / 'geometry_msgs'
    package.mkdir(parents=True)
    (package / '__init__.py').write_text("raise ImportError('no geometry today')\n")
    return f'{package.parent}{os.pathsep}{os.environ.get("PYTHONPATH", "")}'


def test_a_signal_stops_the_nodes_too(tmp_path: Path) -> None:
    process = start(tmp_path / 'demo')
    end = time.monotonic() + 60
    while not nodes_of(tmp_path / 'demo'):
        assert time.monotonic() < end and process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 130, output
    assert output.endswith('demo: stopped\n')
    assert not nodes_of(tmp_path / 'demo')


def test_an_existing_folder_is_refused(tmp_path: Path) -> None:
    process = start(tmp_path)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 2
    assert 'exists; choose another --out' in output
