# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""First touch of spheres and planes on parabolas, beside roots of polynomials and sampling."""

import numba
import numpy as np
import pytest
from rigid_gns_core.engine.rectangle import first_touch_of_plane, first_touch_of_rectangle


@numba.njit(error_model='numpy')
def touch_of_plane(gap, speed, pull):
    return first_touch_of_plane(gap, speed, pull)


@numba.njit(error_model='numpy')
def touch_of_rectangle(local, velocity, pull, half, radius, end):
    return first_touch_of_rectangle(
        (local[0], local[1], local[2]),
        (velocity[0], velocity[1], velocity[2]),
        (pull[0], pull[1], pull[2]),
        half,
        radius,
        0.0,
        end,
    )


def distances(local, velocity, pull, half, times):
    path = local + times[:, None] * velocity + 0.5 * times[:, None] ** 2 * pull
    inside = np.clip(path[:, :2], -half, half)
    return np.hypot(np.linalg.norm(path[:, :2] - inside, axis=1), path[:, 2])


def test_the_first_root_of_a_parabola():
    rng = np.random.default_rng(0)
    for gap, speed, pull in zip(
        10.0 ** rng.uniform(-12, 1, 400), rng.normal(size=400), rng.normal(size=400), strict=True
    ):
        roots = np.roots([0.5 * pull, speed, gap])
        ahead = [root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0]
        expected = min(ahead, default=np.inf)
        assert touch_of_plane(gap, speed, pull) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize('seed', range(60))
def test_the_first_touch_of_a_plate(seed):
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.5, 2.0, 2)
    aim = np.array([*(half * rng.uniform(0.8, 1.6, 2)), 0.0])
    way = rng.normal(size=3)
    local = aim - 3.0 * way / np.linalg.norm(way)
    velocity, pull = 30.0 * way / np.linalg.norm(way), 9.81 * rng.normal(size=3)
    times = np.linspace(0.0, 0.3, 300_001)
    gaps = distances(local, velocity, pull, half, times) - 1.0
    if gaps[0] <= 0:
        return
    found = touch_of_rectangle(local, velocity, pull, half, 1.0, 0.3)
    if gaps.min() > 1e-9:
        assert found == np.inf
    elif gaps.min() < -1e-9:  # else too near to a graze for the samples
        assert found == pytest.approx(times[np.argmax(gaps < 0)], abs=2e-6)
        assert distances(local, velocity, pull, half, np.array([found])) == pytest.approx(1.0)


@pytest.mark.parametrize('miss', [-1e-9, 1e-9])
def test_a_graze_is_met_or_missed_by_a_billionth(miss):
    # past the edge x = 1, at z = 0, across it: the distance is x - 1
    local, velocity = np.array([2.0 + miss, 0.0, 2.0]), np.array([0.0, 0.0, -10.0])
    found = touch_of_rectangle(local, velocity, np.zeros(3), np.array([1.0, 5.0]), 1.0, 1.0)
    assert np.isfinite(found) == (miss < 0)
