# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""No contact is missed, and none is looked for that cannot be."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import load_simulator
from rigid_gns_core.engine.world import world_of
from rigid_gns_core.scenes.plane import closest_points
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State

from . import calls

DT = 0.1
BOX = Plane.box(14.0, 14.0, 9.0)


def fall_and_reach(velocities, gravity=9.81):
    """Return how far each may get: any direction at this speed, and the fall, twice for safety."""
    return np.linalg.norm(velocities, axis=1) * DT + gravity * DT**2


def crowd(seed, count=60):
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-6, 6, (count, 3)) + [0, 0, 6]
    velocities = rng.normal(size=(count, 3)) * rng.exponential(5.0, (count, 1))
    return positions, velocities, rng.uniform(0.2, 1.0, count)


def find(positions, velocities, radius, surfaces=(), awake=None):
    count = len(positions)
    world = world_of(Scene(surfaces=surfaces, radius=tuple(radius) or 1.0), count)
    awake = np.ones(count, bool) if awake is None else awake
    return calls.candidates(world, positions, velocities, DT, awake)


def pairs(found):
    some = found.plane < 0
    return list(zip(found.a[some].tolist(), found.b[some].tolist(), strict=True))


def planes(found):
    some = found.plane >= 0
    return list(zip(found.a[some].tolist(), found.plane[some].tolist(), strict=True))


@pytest.mark.parametrize('seed', range(4))
def test_candidates_are_those_of_brute_force(seed):
    positions, velocities, radius = crowd(seed)
    if seed % 2:
        velocities = 0.01 * velocities  # the other way of looking: all reach about as far
        radius = np.full(60, 0.7)
    found = find(positions, velocities, radius, BOX)
    extent = 1.01 * radius + fall_and_reach(velocities)
    distance = np.linalg.norm(positions[:, None] - positions, axis=-1)
    near = np.argwhere(np.triu(distance <= np.add.outer(extent, extent), 1))
    assert len(near) > 5
    assert pairs(found) == [tuple(pair) for pair in near.tolist()]
    # against planes, all that can touch, and none but those within the reach of a slab around
    points, heights = closest_points(BOX, positions)
    away = np.linalg.norm(positions[:, None] - points, axis=-1)
    must = {tuple(pair) for pair in np.argwhere(away <= extent[:, None]).tolist()}
    may = {tuple(pair) for pair in np.argwhere(np.abs(heights) <= extent[:, None]).tolist()}
    below = {tuple(pair) for pair in np.argwhere(heights <= extent[:, None]).tolist()}
    assert must and must <= set(planes(found)) <= may | below
    assert planes(found) == sorted(set(planes(found)))
    assert (np.diff(found.key) > 0).all()


def test_one_fast_sphere_brings_no_pairs_of_others():
    positions, velocities, radius = crowd(9)
    velocities *= 0.1
    before = set(pairs(find(positions, velocities, radius)))
    velocities[7] = [400.0, 0, 0]
    after = set(pairs(find(positions, velocities, radius)))
    assert {pair for pair in after if 7 not in pair} == {pair for pair in before if 7 not in pair}
    assert len(after) > len(before)


def test_what_sleeps_is_left_out():
    positions, velocities, radius = crowd(11)
    awake = np.zeros(60, dtype=bool)
    assert len(find(positions, velocities, radius, BOX, awake).a) == 0
    awake[::2] = True
    found = find(positions, velocities, radius, BOX, awake)
    listed = np.array(pairs(found))
    assert len(listed) and awake[listed].any(axis=1).all()
    assert awake[np.array(planes(found))[:, 0]].all()
    everyone = set(pairs(find(positions, velocities, radius)))
    # sleepers do not fall, hence reach less far than the others
    assert set(pairs(found)) <= everyone


def test_keys_stay_those_of_a_pair_whatever_else_is_near():
    positions, velocities, radius = crowd(1)
    found = find(positions, velocities, radius, BOX)
    fewer = find(positions, 0.1 * velocities, radius, BOX)
    known, some = (
        dict(zip(one.key.tolist(), np.c_[one.a, one.b, one.plane].tolist(), strict=True))
        for one in (found, fewer)
    )
    assert 0 < len(some) < len(known)
    assert {key: known[key] for key in some} == some
    assert len(find(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), BOX).a) == 0
    assert len(find(positions[:1] + [0, 0, 50.0], velocities[:1], radius[:1]).a) == 0


def struck(wall, gap, mass, speed, substeps):
    """Highest x of a light sphere `gap` from a wall at x = 0 that a fast one strikes."""
    scene = Scene(
        surfaces=(wall,), gravity=(0.0, 0.0, 0.0), mass=(1.0, mass), restitution=1.0, friction=0.0
    )
    start = State(
        positions=np.array([[-4.0 - gap, 0, 0], [-1.0 - gap, 0.2, 0]]),
        velocities=np.array([[speed, 0, 0], [0, 0, 0]]),
    )
    stepper = load_simulator('laws', substeps=substeps, rounds=6).stepper(scene, start)
    states = [stepper.step() for _ in range(6)]
    assert np.linalg.norm(states[-1].velocities[1]) > 5.0  # it was struck
    return max(state.positions[1, 0] for state in states)


WALL = Plane(normal=(-1.0, 0.0, 0.0))
PLATE = replace(WALL, length_x=40.0, length_y=40.0)


@pytest.mark.parametrize('wall', [WALL, PLATE], ids=['wall', 'plate'])
@pytest.mark.parametrize('gap', [0.02, 0.1, 0.5, 0.9])
def test_a_struck_sphere_that_outruns_its_reach_stays_inside(wall, gap):
    # 30 r/s after the blow: 0.8 r in a substep
    assert struck(wall, gap, 0.3, 20.0, 4) < -1.0 + 1e-3


@pytest.mark.parametrize('gap', [0.02, 0.5])
def test_a_plate_holds_what_crosses_it_in_a_substep(gap):
    assert struck(PLATE, gap, 0.3, 20.0, 2) < -1.0 + 1e-3


@pytest.mark.parametrize('wall', [WALL, PLATE], ids=['wall', 'plate'])
def test_the_broad_phase_is_repeated_after_a_blow_in_the_last_substep(wall):
    assert struck(wall, 0.9, 0.3, 20.0, 2) < -1.0 + 1e-3
