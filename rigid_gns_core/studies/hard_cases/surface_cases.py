# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hard cases of surfaces that meet: seams, joints, obstacles, edges, corners, closed rooms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .case import Case, usual_scene
from ...closed_form.enclosed import closed_room, places_in_room
from ...closed_form.runs import plate
from ...closed_form.seams import box_of_plates
from ...scenes.plane import Plane
from ...scenes.state import State

_SMOOTH = {'restitution': 1.0, 'friction': 0.0, 'rolling_friction': 0.0}


def _seams(seed: int) -> Case:
    tiles = tuple(
        plate((x, y, 0.0), length_x=3.0, length_y=3.0)
        for x in np.arange(-6.0, 7.0, 3.0)
        for y in np.arange(-6.0, 7.0, 3.0)
    )
    draw = np.random.default_rng(seed)
    grid = np.meshgrid([-4.0, 0.0, 4.0], [-4.0, 4.0], [3.0, 6.0])
    places = np.stack(grid, axis=-1).reshape(-1, 3)
    places[:, :2] += draw.uniform(-1.0, 1.0, (len(places), 2))
    start = State(positions=places, velocities=draw.normal(0.0, 2.0, places.shape))
    text = '12 spheres are thrown onto a floor of 25 plates of 3 r in a box'
    scene = usual_scene((*tiles, *Plane.box(15.0, 15.0)[1:]))
    return Case('seams', text, scene, start, 150, closed=True, seed=seed)


def _obstacle(seed: int) -> Case:
    places = np.array([(x, y, 7.5) for x in (-8.2, -4.0, 0.0, 4.0, 7.6) for y in (-7.9, 0.0, 8.0)])
    places[:, 2] += np.random.default_rng(seed).uniform(0.0, 3.0, len(places))
    text = '15 spheres fall on a box of 5 plates and over its edges, between walls'
    scene = usual_scene((*box_of_plates(), *Plane.box(28.0, 28.0)))
    return Case('obstacle', text, scene, State(positions=places), 150, seed=seed)


def _joints(_: int) -> Case:
    angle = np.radians(15.0)
    down, level = np.array([np.cos(angle), 0.0, -np.sin(angle)]), np.array([1.0, 0.0, 0.0])
    ramp = plate(10.0 * down, (np.sin(angle), 0.0, np.cos(angle)), down)
    floor = Plane((0.0, 0.0, -20.0 * np.sin(angle)))
    end = Plane((20.0 * np.cos(angle) + 12.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    places = [(-3.0 - 2.5 * k, -4.0 + 2.5 * k, 1.0) for k in range(4)]
    velocities = np.outer([1.0, 2.0, 4.0, 8.0], level)
    turning = np.cross([0.0, 0.0, 1.0], velocities)
    return Case(
        'joints',
        '4 spheres of 1 to 8 m/s roll off a platform, down a ramp, onto a floor, against a wall',
        usual_scene((plate((-10.0, 0.0, 0.0)), ramp, floor, end)),
        State(positions=np.array(places), velocities=velocities, angular_velocities=turning),
        100,
    )


def _ceiling(_: int) -> Case:
    scene = usual_scene((Plane(), Plane((0.0, 0.0, 2.5), (0.0, 0.0, -1.0))), **_SMOOTH)
    velocities = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 3.0), (0.0, 2.0, 10.0), (0.0, 0.0, 90.0)])
    places = np.array([(4.0 * k, 0.0, 1.2) for k in range(4)])
    text = '4 spheres without any loss between a floor and a ceiling of 2.5 r, up to 90 m/s'
    return Case('ceiling', text, scene, State(positions=places, velocities=velocities), 200)


def _grazing(_: int) -> Case:
    offsets = np.array([0.0, 0.3, 0.9, 0.99, 1.0, 1.01])
    sides = 40.0 + offsets
    rows = 4.0 * np.arange(len(offsets)) - 10.0
    edge = np.stack([sides, rows, 0.0 * rows + 66.0], axis=-1)
    corner = np.stack([-sides, 40.0 + offsets, 0.0 * rows + 66.0 + 5.0 * rows], axis=-1)
    places = np.concatenate([edge, corner])
    velocities = np.tile([0.0, 0.0, -99.0], (len(places), 1))
    scene = usual_scene((Plane(), plate((0.0, 0.0, 10.0), length_x=80.0, length_y=80.0)))
    text = '12 spheres of 99 m/s graze the edge and a corner of a plate, 0 to 1.01 r beside it'
    return Case('grazing', text, scene, State(positions=places, velocities=velocities), 60)


def _topple(_: int) -> Case:
    table = plate((0.0, 0.0, 6.0), length_x=12.0, length_y=12.0)
    beyond = (-1e-6, 0.0, 1e-9, 1e-3, 0.1)
    places = [(6.0 + x, 2.5 * k - 5.0, 7.0) for k, x in enumerate(beyond)]
    places += [(-6.0 - 1e-3, 6.0 + 1e-3, 7.0)]  # on a corner
    start = State(positions=np.array(places))
    text = '6 spheres balance on the edge and a corner of a table 6 r high, or begin to fall'
    return Case('topple', text, usual_scene((Plane(), table)), start, 100)


def _tilted_corner(_: int) -> Case:
    thirds = 2.0 * np.pi * np.arange(3) / 3.0
    out = np.stack([np.cos(thirds), np.sin(thirds), 0.0 * thirds], axis=-1)
    axes = np.sqrt(2.0 / 3.0) * out + np.sqrt(1.0 / 3.0) * np.array([0.0, 0.0, 1.0])
    surfaces = tuple(Plane(normal=tuple(normal)) for normal in axes)
    # 1 r from all three, then 2 r further along each
    places = np.ones(3) @ axes + np.r_[np.zeros((1, 3)), 2.0 * axes, [(0.0, 0.0, 8.0)]]
    return Case(
        'tilted_corner',
        '4 spheres lie in the corner of a box that stands on it, a fifth falls on them',
        usual_scene(surfaces),
        State(positions=places),
        200,
        rests=True,
    )


def _room(half: float, speed: float) -> Callable[[int], Case]:
    def make(seed: int) -> Case:
        draw = np.random.default_rng(seed)
        places = places_in_room(half, 7, draw)
        velocities = draw.normal(size=places.shape)
        velocities *= speed / np.linalg.norm(velocities, axis=1, keepdims=True)
        return Case(
            f'room_{2.0 * half:.0f}',
            f'7 spheres of {speed:g} m/s without any loss in a room of six plates, {2 * half:g} r',
            usual_scene(closed_room(half), **_SMOOTH),
            State(positions=places, velocities=velocities),
            100,
            closed=True,
            seed=seed,
        )

    return make


SURFACE_CASES: tuple[Callable[[int], Case], ...] = (
    _seams,
    _obstacle,
    _joints,
    _ceiling,
    _grazing,
    _topple,
    _tilted_corner,
    _room(3.0, 1000.0),
    _room(6.0, 300.0),
    _room(20.0, 1000.0),
)
"""Makers of the cases, from a seed, in the order of the table."""
