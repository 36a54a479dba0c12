# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The real node goes on predicting when its recording fails."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import resource
import signal
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import read_bag

STAMP = 12_000_000_000
LIMIT = 30_000  # [bytes]


def test_a_full_disk_stops_the_recording_but_not_the_node(
    run_process: Callable[..., Any], bench: Any, falling: Callable[..., np.ndarray], tmp_path: Path
) -> None:
    folder = tmp_path / 'bag'
    run = run_process(
        'rigid_gns_ros.simulator_node',
        *('-p', f'record:={folder}', '-p', 'velocity_window:=1', '-p', 'rate:=50.0'),
    )
    run.wait_for('ready: ')
    # files that may not grow fail as a full disk does, in the middle of a write
    resource.prlimit(run.process.pid, resource.RLIMIT_FSIZE, (LIMIT, LIMIT))
    tracked = bench.tracked()
    tracked.send_until(5, falling(0.0, count=50), STAMP)
    bench.until(lambda: 'has stopped' in run.output, 'the error')
    before = len(tracked.predicted_bytes)
    tracked.wait(before + 20)  # it goes on
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
    assert 'INCOMPLETE: recording into' in run.output
    bag = read_bag(folder)
    assert (folder / 'bag_0.mcap').stat().st_size <= LIMIT
    assert 'the recorder did not finish' in bag.warnings[0]
