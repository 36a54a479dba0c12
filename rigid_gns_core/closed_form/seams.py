# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of surfaces that make one: seams of coplanar plates, boxes of plates.

An edge that another face shields must not be felt: runs on several plates equal those on one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .bounces import Simulate
from .check import Check, check
from .runs import difference, EXACT, plate, SAME, simulated
from ..scenes.plane import Plane
from ..scenes.state import Array

_LENGTH = 200.0
# rolling friction begins anew on each plate: 2e-7 r of the way
_SLOWING = 1e-4
_HALF, _HEIGHT = 8.0, 6.0  # of a box of plates: half its width, and its height [m]


def seam_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Largest difference [r] between runs on several plates and the same on one."""
    tilt = np.radians(20.0)
    grounds = {
        'floor': np.eye(3),
        'incline': np.array(
            [
                (np.cos(tilt), 0.0, -np.sin(tilt)),
                (0.0, 1.0, 0.0),
                (np.sin(tilt), 0.0, np.cos(tilt)),
            ]
        ),
    }
    for ground, axes in grounds.items():
        for tiles in ((2, 1), (2, 2), (1, 2)):
            floor = (plate(np.zeros(3), axes[2], axes[0], np.inf, np.inf),)
            for motion, start in _motions(quick).items():
                moving = {
                    k: v @ axes if isinstance(v, np.ndarray) else v for k, v in start.items()
                }
                one, other = (
                    simulated(simulate, surfaces, seconds=1.0 if quick else 3.0, **moving)
                    for surfaces in (floor, _tiled(axes, tiles))
                )
                case = f'{ground} of {tiles[0]} x {tiles[1]} plates, {motion}'
                bound = _SLOWING if motion.startswith('slows') else SAME
                yield check(
                    'over a seam as on one plate [r]', case, difference(one, other), 0, bound
                )
    yield from _boxes(simulate, quick)


def _tiled(axes: Array, tiles: tuple[int, int]) -> tuple[Plane, ...]:
    """Plates side by side whose seams, x = 0, y = 0 or both, are in the middle; axes: rows."""
    places = [_LENGTH * (np.arange(n) - (n - 1) / 2) for n in tiles]
    return tuple(
        plate(np.array([x, y, 0.0]) @ axes, axes[2], axes[0], _LENGTH, _LENGTH)
        for x in places[0]
        for y in places[1]
    )


def _motions(quick: bool) -> dict[str, dict[str, Any]]:
    """Starts near both seams, as arguments of `simulated`, in the axes of the plates."""
    motions: dict[str, dict[str, Any]] = {}
    draw = np.random.default_rng(0)
    for k in range(2 if quick else 12):
        positions = np.array([[*draw.uniform(-3.0, 3.0, 2), draw.uniform(1.5, 6.0)]])
        velocities = np.array([[*draw.uniform(-4.0, 4.0, 2), 0.0]])
        for material in ({}, {'restitution': 0.9, 'friction': 0.5}, {'restitution': 0.5}):
            motions[f'bounce {k}, {material}'] = {
                'positions': positions,
                'velocities': velocities,
            } | material
    for offset in (0.1, 0.5, 0.0):
        motions[f'dropped {offset:g} r beside'] = {
            'positions': np.array([[-offset, offset / 2, 5.0]]),
            'restitution': 0.9,
            'friction': 0.5,
        }
    for degrees in (0.0, 90.0) if quick else (0.0, 30.0, 85.0, 90.0):
        heading = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
        rolling = {
            'positions': np.array([[0.0, 0.0, 1.0]]) - heading,
            'velocities': 2.0 * heading[None],
            'spins': 2.0 * np.cross([0.0, 0.0, 1.0], heading)[None],
        }
        motions[f'rolling at {degrees:g} deg'] = rolling | {'friction': 0.5, 'restitution': 0.5}
        motions[f'slides at {degrees:g} deg'] = rolling | {'spins': None}
        motions[f'slows at {degrees:g} deg'] = rolling | {
            'friction': 0.5,
            'rolling_friction': 0.05,
        }
    return motions


def _boxes(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Dropped on a box of plates near its edge, or rolling over it: as on its top alone."""
    top, *sides = box_of_plates()
    draw = np.random.default_rng(1)
    inside = np.r_[0.0, 1e-9, draw.uniform(0.0, 1.0, 2 if quick else 20)]
    corner = np.r_[1.0, draw.uniform(0.0, 1.0, len(inside) - 1)]
    for material in ({}, {'restitution': 0.9, 'friction': 0.3}):
        for k, (x, y) in enumerate(zip(inside, corner, strict=True)):
            start = [(_HALF - x, _HALF - y, _HEIGHT + draw.uniform(1.0, 4.0))]
            one, other = (
                simulated(simulate, surfaces, start, seconds=2.0, **material)
                for surfaces in ((top,), (top, *sides))
            )
            case = f'{x:.2g} and {y:.2g} r from its edges, {material}, {k}'
            apart = difference(one, other)
            yield check('dropped on a box as on its top [r]', case, apart, 0, SAME)
    for speed in (0.5, 2.0, 6.0):
        for friction in (0.0, 0.5):
            motion = np.array([[speed, 0.3 * speed, 0.0]])
            start = np.array([[_HALF, 0.0, _HEIGHT + 1.0]]) - 0.33 * motion
            turning = np.cross([0.0, 0.0, 1.0], motion) * (friction > 0)
            # until it is beside the box at most: lower, it may meet the sides
            one, other = (
                simulated(
                    simulate, surfaces, start, motion, turning, seconds=0.8, friction=friction
                )
                for surfaces in ((top,), (top, *sides))
            )
            case = f'{speed:g} m/s, friction {friction:g}'
            apart = difference(one, other)
            # two edges in one line, which share the force
            yield check('over the edge of a box as of its top [r]', case, apart, 0, EXACT)


def box_of_plates() -> tuple[Plane, ...]:
    """Top and four sides of an obstacle on z = 0."""
    sides = [
        plate(
            (_HALF * x, _HALF * y, _HEIGHT / 2), (x, y, 0.0), (0.0, 0.0, 1.0), _HEIGHT, 2.0 * _HALF
        )
        for x, y in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
    ]
    return (plate((0.0, 0.0, _HEIGHT), length_x=2.0 * _HALF, length_y=2.0 * _HALF), *sides)
