# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags as the simulator records them, with given content; and what falls freely."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.messages.poses import encode_float64, encode_string, PoseArrayCodec

START = 1_700_000_000_000_000_001  # log time of the first message [ns]
GRAVITY = -9.81  # along z [m/s^2]
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'


def evaluate_bag(folder: Path, **options: Any) -> dict[str, Any]:
    """Report of a bag, with the options of `score_bag`."""
    from rigid_gns_core.recordings.scoring.evaluate import score_bag

    return score_bag(read_bag(folder), **options).report


def poses_cdr(number: int, count: int = 5) -> bytes:
    poses = np.random.default_rng(number).normal(size=(count, 7))
    return PoseArrayCodec('world', count).encode(poses, START + number)


def write_bag(folder: Path, number: int = 100, **limits: float) -> dict[str, list[bytes]]:
    """Record a bag as the simulator does; return the bytes of each topic."""
    written = {'/lab/predicted_poses': [], '/simulator/scene': [], '/simulator/step_time': []}
    with BagWriter(folder, **limits) as bag:
        bag.add_topic('/lab/predicted_poses', POSE_ARRAY, 'reliable')
        bag.add_topic('/lab/tracked_poses', POSE_ARRAY, 'sensor_data')
        bag.add_topic('/simulator/scene', 'std_msgs/msg/String', 'latched')
        bag.add_topic('/simulator/step_time', 'std_msgs/msg/Float64', 'reliable')
        for k in range(number):
            for topic, cdr in [
                ('/lab/predicted_poses', poses_cdr(k)),
                ('/simulator/scene', encode_string(f'{{"π": {k}}}')),
                ('/simulator/step_time', encode_float64(k)),
            ]:
                bag.write(topic, cdr, START + k * 10_000_000)
                written[topic].append(cdr)
    assert (bag.error, bag.lost) == (None, 0)
    return written


@pytest.fixture(name='poses_cdr')
def poses_cdr_fixture() -> Callable[..., bytes]:
    """`poses_cdr(number)`: a PoseArray of its own for each number."""
    return poses_cdr


@pytest.fixture(name='write_bag')
def write_bag_fixture() -> Callable[..., dict[str, list[bytes]]]:
    """`write_bag(folder, number, **limits)`: what was written, by topic."""
    return write_bag


def falling(time_s: float, count: int = 3, velocity: float = 1.0) -> np.ndarray:
    """Poses of spheres in free flight far from all surfaces and each other, shape (count, 7)."""
    poses = np.zeros((count, 7))
    poses[:, 0] = 5.0 * np.arange(count) - 2.5 * count + velocity * time_s
    poses[:, 2] = 100.0 + 0.5 * GRAVITY * time_s**2
    poses[:, 6] = 1.0
    return poses


@pytest.fixture(name='falling')
def falling_fixture() -> Callable[..., np.ndarray]:
    """`falling(time_s, count, velocity)`: poses of spheres in free flight."""
    return falling
