# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames in which a hand holds a ball, from accelerations that are not those of flight."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core import Plane, Scene
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.held import held

GRAVITY = np.array([0.0, 0.0, -9.81])


def carried(rate: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """A ball at rest in a hand for 0.4 s, then thrown by it for 0.1 s, and 0.6 s of flight."""
    times = np.arange(round(1.1 * rate)) / rate
    throw = np.array([5.0, 0.0, 40.0])
    pushed = np.clip(times - 0.4, 0.0, 0.1)
    flown = np.maximum(times - 0.5, 0.0)
    places = 0.5 * pushed[:, None] ** 2 * throw + flown[:, None] * 0.1 * throw
    places += 0.5 * flown[:, None] ** 2 * GRAVITY + [0.0, 0.0, 1.0]
    return times, places + np.random.default_rng(0).normal(0.0, noise, places.shape)


@pytest.mark.parametrize(('rate', 'noise'), [(300.0, 0.5e-3), (120.0, 0.7e-3), (60.0, 0.3e-3)])
def test_a_hand_is_told_from_flight(rate: float, noise: float) -> None:
    times, places = carried(rate, noise)
    model = BallModel.of(Scene(surfaces=(), radius=0.035))
    found = held(model, 0.12, times, places, noise)
    # the end of a hold shows within half a parabola, 50 ms, and a frame
    assert found[times < 0.45 - 1.0 / rate].all()
    assert not found[times > 0.55 + 1.0 / rate].any()


def test_a_bounce_a_rolling_ball_and_a_light_one_are_not_held() -> None:
    rate, noise = 180.0, 0.7e-3
    times = np.arange(180) / rate
    rng = np.random.default_rng(1)
    floor = BallModel.of(Scene(surfaces=(Plane(),), radius=0.02))
    fall = np.sqrt(2 * 0.5 / 9.81)
    heights = np.abs(np.where(times < fall, 0.5 - 4.905 * times**2, 0.0))
    after = times - fall
    heights = np.where(after > 0, np.maximum(2.8 * after - 4.905 * after**2, 0.0), heights)
    bounced = np.stack([2.0 * times, 0 * times, 0.02 + heights], axis=1)
    rolling = np.stack([1.0 * times - 0.05 * times**2, 0 * times, 0 * times + 0.02], axis=1)
    for places in (bounced, rolling):
        seen = places + rng.normal(0.0, noise, places.shape)
        assert not held(floor, 0.0027, times, seen, noise).any()
    # at 10 m/s a table tennis ball of drag 0.45 slows with 1.3 g, and a solid one does not
    v = 10.0 / (1.0 + 0.126 * 10.0 * times)
    flown = np.cumsum(v) / rate
    light = np.stack([flown, 0 * times, 3.0 - 4.905 * times**2], axis=1)
    free = BallModel.of(Scene(surfaces=(), radius=0.02))
    assert not held(free, 0.0027, times, light, noise).any()
    assert held(free, 0.09, times, light, noise).any()


def test_a_blow_in_the_air_is_no_hand() -> None:
    times = np.arange(120) / 180.0
    places = np.stack([3.0 * np.abs(times - 0.3), 0 * times, 1.0 - 4.905 * times**2], axis=1)
    model = BallModel.of(Scene(surfaces=(), radius=0.02))
    assert not held(model, 0.0027, times, places, 0.5e-3).any()
