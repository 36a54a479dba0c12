# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Short gaps in tracks are filled by their motion."""

from __future__ import annotations

import numpy as np
from rigid_gns_core.recordings.short_gaps import fill_short_gaps
from rigid_gns_core.scenes.scene import Scene

SCENE = Scene(surfaces=(), radius=0.02)
STAMPS = 1_700_000_000_000_000_000 + 20_000_000 * np.arange(40)  # 50 Hz


def thrown() -> np.ndarray:
    """Poses of a sphere that flies while it turns at 2 rad/s, and of one at rest, (40, 2, 7)."""
    times = (STAMPS - STAMPS[0]) * 1e-9
    poses = np.zeros((len(times), 2, 7))
    poses[:, 0, 0] = 3.0 * times
    poses[:, 0, 2] = 1.0 + 4.0 * times + 0.5 * SCENE.gravity[2] * times**2
    poses[:, 0, 5], poses[:, 0, 6] = np.sin(times), np.cos(times)
    poses[:, 1, 6] = 1.0
    return poses


def fill(poses: np.ndarray) -> int:
    return fill_short_gaps(STAMPS, poses, SCENE, noise=1e-5)


def test_flight_and_rest_go_on_in_a_short_gap() -> None:
    truth = thrown()
    poses = truth.copy()
    poses[10:12, 0] = np.nan  # three intervals; a chord would be 4 mm off
    poses[20, 1] = np.nan
    assert fill(poses) == 3
    # both are exact but for rounding: times are differences of integers, positions of order 1 m
    np.testing.assert_allclose(poses, truth, atol=1e-12)


def test_longer_gaps_and_ends_stay_unseen() -> None:
    poses = thrown()
    for gone in (slice(0, 2), slice(10, 13), slice(39, 40)):
        poses[gone, 0] = np.nan
    before = poses.copy()
    assert fill(poses) == 0
    np.testing.assert_array_equal(poses, before)


def test_one_frame_and_a_sphere_never_seen_are_left() -> None:
    poses = thrown()
    poses[:, 1] = np.nan
    assert fill(poses) == 0
    alone = poses[:1].copy()
    assert fill_short_gaps(STAMPS[:1], alone, SCENE, noise=0.0) == 0
