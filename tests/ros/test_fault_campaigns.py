# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fault campaigns: the truth that predictions are judged by, and what is kept of a log."""

from __future__ import annotations

from pathlib import Path
import runpy
import subprocess
import sys

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / 'benchmarks' / 'node'


@pytest.fixture(autouse=True)
def beside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(FOLDER))


def test_the_truth_falls_freely_and_bounces_without_loss() -> None:
    motion = runpy.run_path(str(FOLDER / 'motion.py'))
    times = np.arange(0.0, 8.0, 1e-3)
    heights = motion['poses_at'](times)[:, 0, 2] - motion['RADIUS']
    speeds = np.gradient(heights, times)
    energy = motion['GRAVITY'] * heights + 0.5 * speeds**2
    away = heights > 0.02  # of a bounce, within which a difference is no speed
    assert heights.min() >= 0.0
    assert np.allclose(energy[away][5:-5], motion['GRAVITY'] * 0.5, rtol=1e-4)


def test_a_line_is_kept_to_its_clause() -> None:
    shortened = runpy.run_path(str(FOLDER / 'judge.py'))['shortened']
    line = 'recording into /tmp/a/bag has stopped: [Errno 27] File too large, 3 lost'
    assert shortened(line) == 'recording into PATH has stopped: [Errno N] File too large'
    assert shortened('a prediction is 0.031 s late, more') == 'a prediction is N s late'


def test_an_unknown_campaign_is_an_error() -> None:
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    command = [sys.executable, str(FOLDER / 'fault_campaigns.py'), 'rain']
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "no campaign 'rain', expected nothing, lost" in done.stderr
