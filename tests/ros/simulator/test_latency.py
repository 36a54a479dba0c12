# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A tracker that stamps its frames on receipt."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import decode_pose_array

T0, DT, LATE = 1_000_123_456_789, 100_000_000, 30_000_000  # [ns]; the first as in conftest.py


def test_frames_are_of_the_time_of_their_capture(
    simulated: Callable[..., Any], falling: Callable[..., Any], tmp_path: Path
) -> None:
    """Predictions, starts and the bag have stamps that are earlier by the latency."""
    setup = simulated(latency=0.03, record=str(tmp_path / 'bag'))
    setup.tracked.send(falling(0.0), T0)
    setup.tracked.wait_computed(1)
    assert setup.node.simulation.window.stamp_ns == T0 - LATE
    setup.clock.set(T0 + DT)
    assert setup.tracked.wait(1)[0].stamp_ns == T0 - LATE + DT
    assert setup.node.simulation.predictor.last_start.stamp_ns == T0 - LATE
    setup.node.simulation.close()
    (recorded,) = read_bag(tmp_path / 'bag').topics['/tracked_poses'].messages
    assert decode_pose_array(recorded).stamp_ns == T0 - LATE
