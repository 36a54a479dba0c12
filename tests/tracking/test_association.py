# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.tracking.association import match
from rigid_gns_core.tracking.coasting import coast
from rigid_gns_core.tracking.environment import Environment
from rigid_gns_core.tracking.gating import gates
from rigid_gns_core.tracking.initiation import initiate_tracks, triples
from scipy.optimize import linear_sum_assignment

GRAVITY = np.array([0.0, 0.0, -9.81])


def grid(side: int, pitch: float) -> np.ndarray:
    axis = pitch * np.arange(side)
    return np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)


@pytest.mark.parametrize('seed', range(5))
def test_any_order_is_undone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = grid(4, 2.0)
    order = rng.permutation(len(places))
    found = places[order] + rng.normal(0.0, 0.1, places.shape)
    np.testing.assert_array_equal(order[match(places, found, np.ones(64))], np.arange(64))


def test_what_is_out_of_its_gate_stays_unmatched() -> None:
    places = grid(3, 2.0)
    found = np.delete(places, [4, 11], axis=0)
    index = match(places, found, np.full(27, 0.9))
    assert set(np.flatnonzero(index < 0)) == {4, 11}
    assert not len(match(np.zeros((0, 3)), found, np.zeros(0)))
    assert (match(places, np.zeros((0, 3)), np.ones(27)) == -1).all()


def test_two_that_have_the_same_nearest_share_out_by_the_least_sum() -> None:
    expected = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    found = np.array([[0.9, 0.0, 0.0], [1.8, 0.0, 0.0]])
    # the nearest of both is the first; given to the second, it would leave 1.8 for the other
    np.testing.assert_array_equal(match(expected, found, np.full(2, 3.0)), [0, 1])
    # but not where that is out of its gate: a sphere that has gone takes nothing from others
    np.testing.assert_array_equal(match(expected, found[:1], np.full(2, 1.5)), [-1, 0])


@pytest.mark.parametrize('seed', range(5))
@pytest.mark.parametrize('lost', [0, 20])
def test_in_a_crowd_the_sum_is_the_least_of_all(seed: int, lost: int) -> None:
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.0, 12.0, (80, 3))
    found = rng.permutation(places + rng.normal(0.0, 0.5, places.shape))[lost:]
    width = rng.uniform(0.5, 2.0, 80)
    squares = np.square(places[:, None] - found).sum(axis=-1) / width[:, None] ** 2
    cost = np.minimum(squares, 1.0)
    least = cost[linear_sum_assignment(cost)].sum()
    index = match(places, found, width)
    held = np.flatnonzero(index >= 0)
    assert len(set(index[held])) == len(held)
    total = cost[held, index[held]].sum() + len(found) - len(held)
    np.testing.assert_allclose(total, least, rtol=1e-12)


def test_gates_grow_with_noise_and_with_what_can_strike() -> None:
    places = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [50.0, 0.0, 0.0]])
    width = gates(
        np.array([0.0, 40.0, 0.0]),
        places,
        np.ones(3),
        np.full(3, 0.1),
        0.1,
        np.ones(3, dtype=bool),
    )
    np.testing.assert_allclose(width, [1 + 0.6 + 4, 1 + 0.6 + 4, 1 + 0.6])


def test_spheres_that_collide_meanwhile_are_not_sought_through_each_other() -> None:
    environment = Environment.unknown(np.zeros(3), 1.0)
    environment = replace(environment, surfaces=environment.surfaces._replace(known=True))
    places = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    speeds = np.array([[10.0, 0.0, 0.0], [-10.0, 0.0, 0.0]])
    falls, radii = np.ones(2, dtype=bool), np.ones(2)
    later, _ = coast(environment, places, speeds, falls, radii, np.full(2, 0.15))
    # they touch after 0.05 s, half a metre on, and part again
    np.testing.assert_allclose(later[:, 0], [-0.5, 3.5], atol=1e-12)


@pytest.mark.parametrize('acceleration', [GRAVITY, np.zeros(3), np.array([9.81, 0.0, 0.0])])
def test_three_loose_poses_are_a_sphere(acceleration: np.ndarray) -> None:
    rng = np.random.default_rng(0)
    start, speeds = rng.uniform(0.0, 60.0, (80, 3)), rng.normal(0.0, 15.0, (80, 3))
    times = (-0.2, -0.1, 0.0)
    frames, orders = [], []
    for t in times:
        places = start + speeds * t + 0.5 * acceleration * t**2 + rng.normal(0, 1e-3, start.shape)
        orders.append(rng.permutation(len(places)))
        frames.append(places[orders[-1]])
    gravity = acceleration if acceleration.any() else GRAVITY
    found = triples(
        (frames[0], frames[1], frames[2]),
        times,
        gravity=gravity,
        radius=1.0,
        noise=1e-3,
        max_speed=100.0,
    )
    whose = np.stack([order[column] for order, column in zip(orders, found.T, strict=True)])
    assert len(found) >= 78  # one may fly so near to another that either goes
    assert (whose == whose[0]).all(axis=0).sum() >= 78


def test_a_row_at_rest_is_not_taken_for_spheres_on_the_move() -> None:
    row = np.c_[2.0 * np.arange(6), np.zeros((6, 2))]
    found = triples(
        (row, row, row), (0.0, 0.1, 0.2), gravity=GRAVITY, radius=1.0, noise=1e-3, max_speed=100.0
    )
    np.testing.assert_array_equal(found, np.tile(np.arange(6)[:, None], (1, 3)))


def test_false_poses_are_no_sphere() -> None:
    rng = np.random.default_rng(1)
    frames = [rng.uniform(0.0, 60.0, (5, 3)) for _ in range(3)]
    found = initiate_tracks(
        frames,
        np.array([0.0, 0.1, 0.2]),
        gravity=GRAVITY,
        radius=1.0,
        noise=1e-3,
        max_speed=100.0,
        any_track=True,
    )
    assert not len(found)
