# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise of the newest frames where stamps jitter: jitter times the speed of then."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.tracking.stamp_jitter import newest_noise
from tracking_windows import tracking_window

RATE, NOISE, JITTER = 240.0, 1e-4, 1e-3  # [Hz], [m], [s]


def seen_of(places: np.ndarray) -> np.ndarray:
    return np.ones(places.shape[:2], dtype=bool)


def test_it_is_that_of_the_speed_at_the_end() -> None:
    """A ball that rolls at 1 m/s, and at 3 m/s in the last quarter."""
    found = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        times = np.arange(96) / RATE
        places = np.zeros((96, 1, 3))
        places[:, 0, 0] = np.minimum(times, 0.3) + 3.0 * np.maximum(times - 0.3, 0.0)
        places += rng.normal(0.0, NOISE, places.shape)
        stamps = np.sort(times + rng.normal(0.0, JITTER, 96))
        found.append(newest_noise(stamps, places, seen_of(places), NOISE))
    # a speed from four stamps that jitter is off by a seventh, the largest of three by more
    assert np.median(found) == pytest.approx(3.0 * JITTER, rel=0.3)


def test_without_jitter_it_is_that_of_the_tracker() -> None:
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        times = np.arange(96) / RATE
        places = (times * 2.0)[:, None, None] * np.array([1.0, 0.0, 0.0])
        places += rng.normal(0.0, NOISE, places.shape)
        found.append(newest_noise(times, places, seen_of(places), NOISE))
    assert np.median(found) == NOISE
    assert max(found) < 1.6 * NOISE  # of a few that are told by chance


def test_two_frames_with_stamps_close_to_each_other_do_not_belie_the_laws() -> None:
    """A line through them was off by up to 50 m/s, and seemed to be known to 7 m/s."""
    scene = Scene(
        surfaces=(Plane(),), radius=0.02, restitution=1.0, friction=0.0, rolling_friction=0.0
    )
    window = tracking_window(scene=scene)
    rng, fall = np.random.default_rng(0), np.sqrt(2 * 0.6 / 9.81)
    times = np.arange(420) / RATE
    stamps = times + rng.normal(0.0, JITTER, len(times))
    worst = 0.0
    for time, stamp in zip(times, stamps, strict=True):
        since = (time + fall) % (2 * fall) - fall
        pose = np.array([[0.3 * time, 0.0, 0.62 - 0.5 * 9.81 * since**2, 0.0, 0.0, 0.0, 1.0]])
        pose[:, :3] += rng.normal(0.0, NOISE, 3)
        arrival = 10**12 + round(time * 1e9)
        window.add(PoseArrayFrame(10**12 + round(stamp * 1e9), 'world', pose), arrival)
        if time > 12 / RATE:  # fewer frames are fitted by the window alone
            off = window.estimate()[1].state.velocities[0] - [0.3, 0.0, -9.81 * since]
            near = fall - abs(since) < 4 * JITTER  # of a bounce, on either side of it
            worst = worst if near else max(worst, float(np.linalg.norm(off)))
    assert worst < 1.0  # 6.1 by the line, 0.3 by what jitter moves the time itself
