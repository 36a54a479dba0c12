# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Spheres that nothing can touch are left out, all others are not."""

import numpy as np
import pytest
from rigid_gns_core import Air, Plane, Scene
from rigid_gns_core.engine.spheres import Spheres
from rigid_gns_core.engine.world import world_of
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from . import calls

DT, H = 0.1, 0.0125
NEAR = 9.81 * H**2
BOX = Plane.box(26.0, 26.0, 20.0)


def state(positions, velocities):
    positions, velocities = np.asarray(positions, float), np.asarray(velocities, float)
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(positions), 1))
    return Spheres(positions, turns, velocities, np.zeros_like(positions))


def crowd(seed, count=80):
    rng = np.random.default_rng(seed)
    places = rng.uniform([-12, -12, 1], [12, 12, 19], (count, 3))
    return state(places, rng.normal(size=(count, 3)) * 12.0)


def kept(scene, spheres):
    """The pairs and the (sphere, plane) that are kept."""
    world = world_of(scene, len(spheres.positions))
    found, _ = calls.candidates_that_may_touch(world, spheres, DT, NEAR)
    free = found.plane < 0
    pairs = set(zip(found.a[free].tolist(), found.b[free].tolist(), strict=True))
    faces = set(zip(found.a[~free].tolist(), found.plane[~free].tolist(), strict=True))
    assert found.pairs == len(pairs) and (np.diff(found.key) > 0).all()
    return pairs, faces


@pytest.mark.parametrize('air', [None, Air(drag_coefficient=0.5, wind=(5.0, 0.0, 0.0))])
@pytest.mark.parametrize('seed', range(3))
def test_whatever_touches_in_free_flight_is_kept_and_not_much_else(seed, air):
    scene, spheres = Scene(surfaces=BOX, air=air, mass=8.0, radius=0.8), crowd(seed)
    world = world_of(scene, 80)
    pairs, faces = kept(scene, spheres)
    gaps, heights = np.inf, np.inf
    for time in np.linspace(0.0, DT, 101):
        _, then = calls.candidates_that_may_touch(world, spheres, time, NEAR)
        apart = np.linalg.norm(then.positions[:, None] - then.positions, axis=-1)
        gaps = np.minimum(gaps, apart - 1.6)
        away = [(then.positions - plane.point) @ plane.normal - 0.8 for plane in BOX]
        heights = np.minimum(heights, away)
    touching = {tuple(pair) for pair in np.argwhere(np.triu(gaps <= NEAR, 1)).tolist()}
    struck = {(int(i), int(plane)) for plane, i in np.argwhere(heights <= NEAR)}
    assert touching and struck
    assert touching <= pairs and struck <= faces
    # each group that is kept has a near miss at least: within the margins and what paths sag
    near = 2 * (0.02 * 0.8 + 0.125 * DT**2 * 9.81 * 3) + 3 * NEAR
    close = set(np.argwhere(np.triu(gaps <= near, 1)).ravel().tolist())
    close |= set(np.argwhere(heights <= near)[:, 1].tolist())
    members = {a for pair in pairs for a in pair} | {a for a, _ in faces}
    links = ([a for a, _ in pairs], [b for _, b in pairs])
    _, group = connected_components(coo_array((np.ones(len(pairs)), links), (80, 80)), False)
    assert {group[i] for i in members} <= {group[i] for i in close}


def test_what_a_struck_sphere_may_reach_is_kept_with_it():
    """0 hits 1; 2 is out of the way of both, within reach of 1 after the blow; 3 is not."""
    places = [[0, 0, 10.0], [2.3, 0, 10.0], [2.3, 3.5, 10.0], [30.0, 0, 10.0], [33.0, 0, 10.0]]
    speeds = [[20.0, 0, 0], [8.0, 0, 0], [8.0, 0, 0], [5.0, 0, 0], [5.0, 0, 0]]
    scene = Scene()
    assert kept(scene, state(places, speeds))[0] == {(0, 1), (0, 2), (1, 2)}
    speeds[0] = [8.0, 0, 0]
    assert kept(scene, state(places, speeds))[0] == set()


def test_a_surface_that_comes_is_not_left_out():
    racket = Plane(
        normal=(1.0, 0.0, 0.0), direction=(0.0, 1.0, 0.0), length_x=4.0, length_y=4.0,
        velocity=(9.0, 0.0, 0.0),
    )  # fmt: skip
    spheres = state([[1.5, 0, 0]], [[0.0, 0, 0]])
    assert kept(Scene(surfaces=(racket,)), spheres)[1] == {(0, 0)}
    still = Plane(normal=(1.0, 0.0, 0.0), direction=(0.0, 1.0, 0.0), length_x=4.0, length_y=4.0)
    assert kept(Scene(surfaces=(still,)), spheres)[1] == set()
