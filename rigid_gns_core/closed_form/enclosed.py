# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of what must stay inside: fast spheres in a closed room, light ones under a heavy one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from .bounces import Simulate
from .check import Check, check
from .runs import plate, simulated
from ..scenes.plane import Plane
from ..scenes.state import Array, Trajectory

_UP = np.array([0.0, 0.0, 1.0])
# but for a ratio of 1e6 that falls from 1 r on three: 0.013
_DEEPEST = 2e-2


def closed_room(half: float) -> tuple[Plane, ...]:
    """Six plates around the origin, whose edges meet; `half` of the length of an edge [m]."""
    normals = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return tuple(
        plate(-half * normal, normal, np.roll(normal, 1), 2.0 * half, 2.0 * half)
        for normal in normals
    )


def places_in_room(half: float, spheres: int, draw: np.random.Generator) -> Array:
    """Centres of unit spheres [m] that do not touch, shape (spheres, 3), drawn evenly."""
    places = np.empty((0, 3))
    while len(places) < spheres:
        place = draw.uniform(1.05 - half, half - 1.05, 3)
        if (np.linalg.norm(places - place, axis=1) > 2.02).all():
            places = np.append(places, place[None], axis=0)
    return places


def room_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Elastic spheres of 30 to 1000 m/s in a room of plates: how many leave it."""
    draw = np.random.default_rng(0)
    for half in (3.0, 20.0) if quick else (3.0, 6.0, 20.0):
        for spheres in (1, 7):
            for speed in (100.0, 1000.0) if quick else (30.0, 100.0, 300.0, 1000.0):
                for attempt in range(1 if quick else 6):
                    places = places_in_room(half, spheres, draw)
                    motion = draw.normal(size=places.shape)
                    motion *= speed / np.linalg.norm(motion, axis=1, keepdims=True)
                    run = simulated(
                        simulate, closed_room(half), places, motion, seconds=1.0 if quick else 4.0
                    )
                    inside = (np.abs(run.positions) < half).all(axis=(0, 2))  # false of NaN too
                    case = f'{2.0 * half:g} r, {spheres} spheres, {speed:g} m/s, {attempt}'
                    yield check('leave a closed room, spheres', case, (~inside).sum(), 0, 0.0)


def load_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A heavy sphere on light ones, or dropped on them: depth into the floor and each other."""
    for ratio in (1e3,) if quick else (10.0, 1e3, 1e6):
        for drop in (0.0, 0.1) if quick else (0.0, 0.01, 0.1, 1.0):
            for name, (walls, light) in _supports().items():
                top = np.sqrt(4.0 - np.sum(light[0, :2] ** 2)) + 1.0
                heavy = np.array([[-light[:, 0].mean(), 0.0, top + drop]])
                places = np.r_[light, heavy]
                run = simulated(
                    simulate,
                    (Plane(), *walls),
                    places,
                    seconds=1.0 if quick else 4.0,
                    restitution=0.5,
                    friction=0.6,
                    mass=(*np.ones(len(light)), ratio),
                )
                case = f'masses 1:{ratio:g}, drop {drop:g} r, {name}'
                depth = _deepest(run, (Plane(), *walls))
                yield check('light under heavy, penetration [r]', case, depth, 0, _DEEPEST)


def triangle_of_spheres() -> tuple[tuple[Plane, ...], Array]:
    """Three unit spheres that touch on a floor around x = y = 0, shape (3, 3), and their walls."""
    thirds = 2.0 * np.pi * np.arange(3) / 3.0
    out = np.stack([np.cos(thirds), np.sin(thirds), 0.0 * thirds], axis=-1)
    middle = 2.0 / np.sqrt(3.0)
    walls = tuple(plate((middle + 1.0) * n, -n, _UP, np.inf, np.inf) for n in out)
    return walls, middle * out + _UP


def _supports() -> dict[str, tuple[Sequence[Plane], Array]]:
    """Walls and light spheres on the floor by name; spheres: shape (n, 3)."""
    walls, three = triangle_of_spheres()
    return {
        'one': ((), _UP[None]),
        'one in a shaft': (Plane.box(2.02, 2.02)[1:], np.array([[0.01, 0.0, 1.0]])),
        'three that friction holds': ((), three),
        'three between walls': (walls, three),
    }


def _deepest(run: Trajectory, surfaces: Sequence[Plane]) -> float:
    """Deepest penetration of unit spheres into each other and into infinite planes, all frames."""
    one, other = np.triu_indices(run.count, 1)
    between = np.linalg.norm(run.positions[:, one] - run.positions[:, other], axis=-1)
    heights = [(run.positions - s.point) @ np.asarray(s.normal) for s in surfaces]
    return float(np.max([0.0, 2.0 - between.min(), 1.0 - np.min(heights)]))
