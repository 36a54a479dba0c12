# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses that a node accepts although they cannot be right are spoken of."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_ros.node.simulator import SimulatorNode

STAMP, STEP = 12_000_000_000, 10_000_000  # [ns]


def fall(k: int) -> np.ndarray:
    """Two balls that bounce on their first fall's way back up, at 100 Hz, shape (2, 7)."""
    poses = np.zeros((2, 7))
    poses[:, 0], poses[:, 6] = (0.0, 0.5 + 0.01 * k), 1.0
    poses[:, 2] = 1.0 - 0.5 * 9.81 * ((0.01 * k) % 0.4) ** 2
    return poses


@pytest.mark.parametrize(
    ('change', 'parameters', 'said'),
    [
        (lambda p: 1000.0 * p, {}, 'positions seem to be in millimetres; publish'),
        (lambda p: p[:, (0, 2, 1)], {}, 'balls fall along (0.00, -1.00, 0.00), expected along'),
        (lambda p: p, {}, ''),
        (lambda p: 1000.0 * p, {'match_spheres': True}, 'are positions in metres'),
    ],
    ids=['millimetres', 'y up', 'right', 'matched'],
)  # fmt: skip
def test_units_and_axes_are_looked_at(
    bench: Any,
    log: Callable[[], str],
    change: Callable[[np.ndarray], np.ndarray],
    parameters: dict[str, Any],
    said: str,
) -> None:
    node = bench.add(SimulatorNode, scene='table_tennis', **parameters)
    tracked = bench.tracked()
    for k in range(170):
        poses = fall(k)
        poses[:, :3] = change(poses[:, :3])
        before = node.simulation.window.counts.total()
        tracked.send(poses, STAMP + k * STEP)
        bench.until(lambda n=before: node.simulation.window.counts.total() > n, 'the frame')
    told = log()
    if said:
        assert said in told
        assert '[WARN]' in told
    else:
        assert 'balls' not in told and 'metres' not in told
