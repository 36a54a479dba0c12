# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of obstacles: blows on fixed spheres, boxes, cylinders, rings and tubes, and rolling."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check, worst
from .runs import AHEAD, difference, EXACT, NEAR, SAME, simulated, velocity_check
from ..scenes.contact_law import ContactLaw
from ..scenes.obstacle import Obstacle
from ..scenes.plane import Plane
from ..scenes.state import Array

_FREE: dict[str, Any] = {'surfaces': (), 'gravity': (0.0, 0.0, 0.0)}
_FLOOR, _NONE = Plane(), ()
# the middle of a box, and how it and the other shapes of `_SPOTS` are turned
_PLACE, _TURNED = np.array([0.3, -0.2, 0.5]), Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
# shape, lengths, and where it is struck: point of its core and normal, in its axes
_SPOTS: list[tuple[str, dict[str, Any], tuple[float, ...], tuple[float, ...]]] = [
    ('sphere', {'radius': 2.0}, (0.0, 0.0, 0.0), (0.6, -0.48, 0.64)),
    ('box', {'size': (3.0, 2.0, 1.0)}, (0.7, 1.0, -0.2), (0.0, 1.0, 0.0)),
    ('box', {'size': (3.0, 2.0, 1.0)}, (0.7, 1.0, 0.5), (0.0, 0.6, 0.8)),
    ('box', {'size': (3.0, 2.0, 1.0)}, (-1.5, 1.0, 0.5), (-0.48, 0.6, 0.64)),
    ('cylinder', {'radius': 1.5, 'length': 2.0}, (0.9, 1.2, 0.3), (0.6, 0.8, 0.0)),
    ('cylinder', {'radius': 1.5, 'length': 2.0}, (0.3, -0.5, -1.0), (0.0, 0.0, -1.0)),
    ('cylinder', {'radius': 1.5, 'length': 2.0}, (0.9, 1.2, 1.0), (0.36, 0.48, 0.8)),
    ('ring', {'radius': 2.5, 'thickness': 0.2}, (1.5, 2.0, 0.0), (0.36, 0.48, 0.8)),
    ('ring', {'radius': 2.5}, (1.5, 2.0, 0.0), (-0.48, -0.64, 0.6)),
    ('tube', {'radius': 2.5, 'length': 3.0}, (1.5, 2.0, 1.5), (-0.36, -0.48, 0.8)),
    ('tube', {'radius': 2.5, 'length': 3.0, 'thickness': 0.2}, (1.5, 2.0, 0.5), (0.6, 0.8, 0.0)),
]


def obstacle_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Blows by the normal of the closest point, and spheres that roll or lie on obstacles."""
    yield from _blow_checks(simulate, quick)
    yield from _top_checks(simulate, quick)
    yield from _summit_checks(simulate, quick)
    yield from _pipe_checks(simulate, quick)
    yield from _ring_checks(simulate, quick)


def _blow_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A blow at the closest point is that on a plane there, of a body of infinite mass."""
    frictions = (0.9,) if quick else (0.9, 0.05)
    for (shape, lengths, core, normal), friction in product(_SPOTS, frictions):
        law = ContactLaw(0.8, friction, 0.2)
        x, _, z = _TURNED.T.tolist()
        obstacle = Obstacle(
            shape, tuple(_PLACE.tolist()), tuple(z), tuple(x), contact=law, **lengths
        )
        facing = _TURNED @ np.array(normal)
        reach = 1.0 + (lengths['radius'] if shape == 'sphere' else lengths.get('thickness', 0) / 2)
        velocity, spin = np.array([0.8, -0.3, 0.5]), np.array([3.0, -2.0, 4.0])
        velocity = velocity - (3.0 + velocity @ facing) * facing
        struck = _PLACE + _TURNED @ np.array(core) + reach * facing
        run = simulated(
            simulate,
            positions=[struck - AHEAD * velocity],
            velocities=[velocity],
            spins=[spin],
            obstacles=(obstacle,),
            seconds=AHEAD,
            **_FREE,
        )
        after, turned = laws.impact_on_surface(
            velocity, spin, facing, 1.0, 0.8, friction, 0.4, 0.2
        )
        speed = float(np.linalg.norm(velocity))
        case = f'{shape} {lengths} at {core}, mu {friction:g}'
        yield velocity_check('off an obstacle, velocity', case, run, [after], speed, EXACT)
        error = np.abs(run.angular_velocities[-1, 0] - turned).max() / speed
        yield check('off an obstacle, spin', case, error, 0, EXACT)


def _top_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """On the flat end of a box or a cylinder a sphere moves as on a plane."""
    ends: dict[str, dict[str, Any]] = {
        'box': {'size': (30.0, 30.0, 2.0)},
        'cylinder': {'radius': 15.0, 'length': 2.0},
    }
    for shape, e in product(ends, (0.8,) if quick else (0.8, 0.0)):
        motion: dict[str, Any] = {
            'positions': [(0.4, -0.3, 2.5)],
            'velocities': [(1.5, 0.5, -1.0)],
            'spins': [(1.0, 2.0, -3.0)],
            'seconds': 2.0,
            'restitution': e,
            'friction': 0.3,
            'rolling_friction': 0.05,
        }
        obstacle = Obstacle(shape, (0.0, 0.0, -1.0), **ends[shape])
        on_top = simulated(simulate, _NONE, obstacles=(obstacle,), **motion)
        apart = difference(on_top, simulated(simulate, (_FLOOR,), **motion))
        yield check('on a flat end as on a plane [r]', f'{shape}, e {e:g}', apart, 0, SAME)


def _summit_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A sphere leaves a fixed one, or a lying cylinder, at the angle of `leaving_angle`."""
    shapes: dict[str, dict[str, Any]] = {
        'sphere': {'radius': 3.0},
        'cylinder': {'radius': 3.0, 'length': 8.0, 'axis': (0.0, 1.0, 0.0)},
    }
    for shape, rolls in product(shapes, (True,) if quick else (True, False)):
        start, reach, inertia = 0.1, 4.0, 0.4 if rolls else 0.0
        run = simulated(
            simulate,
            _NONE,
            [reach * np.array([np.sin(start), 0.0, np.cos(start)])],
            obstacles=(Obstacle(shape, **shapes[shape]),),
            seconds=5.0,
            friction=1e3 if rolls else 0.0,
            restitution=0.5,
        )
        case = f'{shape}, {"rolls" if rolls else "slides"}'
        place, velocity = run.positions[:, 0], run.velocities[:, 0]
        angles = np.arctan2(place[:, 0], place[:, 2])
        leaves = laws.leaving_angle(0.0, start, reach, inertia, GRAVITY)
        seen = (angles > np.radians(15.0)) & (angles < leaves)
        speeds = np.linalg.norm(velocity[seen], axis=1)
        expected = laws.speed_over_edge(0.0, start, angles[seen], reach, inertia, GRAVITY)
        cases = [f'{case}, at {angle:.0f} deg' for angle in np.degrees(angles[seen])]
        yield worst('over a summit, speed [m/s]', cases, speeds, expected, NEAR)
        end = float(laws.speed_over_edge(0.0, start, np.array(leaves), reach, inertia, GRAVITY))
        across = end * float(np.cos(leaves))
        yield check('off a summit, speed across [m/s]', case, velocity[-1, 0], across, NEAR)


def _pipe_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A sphere swings in a lying pipe: (1 + i) v^2 / 2 = g l (cos theta - cos theta_0)."""
    for rolls, width in product((True,) if quick else (True, False), (0.0, 0.4)):
        start, reach, inertia = 1.0, 3.0, 0.4 if rolls else 0.0
        pipe = Obstacle(
            'tube', axis=(0.0, 1.0, 0.0), radius=4.0 + width / 2, length=9.0, thickness=width
        )
        run = simulated(
            simulate,
            _NONE,
            [reach * np.array([np.sin(start), 0.0, -np.cos(start)])],
            obstacles=(pipe,),
            seconds=4.0,
            friction=1e3 if rolls else 0.0,
            restitution=0.5,
        )
        case = f'{"rolls" if rolls else "slides"}, wall {width:g} r'
        place = run.positions[:, 0]
        height = place[:, 2] + reach * np.cos(start)
        squares = np.sum(run.velocities[:, 0] ** 2, axis=1) + 2 * GRAVITY * height / (1 + inertia)
        fastest = 2 * GRAVITY * reach * (1 - np.cos(start)) / (1 + inertia)
        yield check('swings in a pipe, energy', case, np.abs(squares).max() / fastest, 0, NEAR)
        away = np.abs(np.hypot(place[:, 0], place[:, 2]) - reach).max()
        yield check('swings in a pipe, off the wall [r]', case, away, 0, NEAR)


def _ring_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A sphere comes to lie in a ring that holds it, and falls through one that does not."""
    for radius, width in ((0.8, 0.0),) if quick else ((0.8, 0.0), (0.5, 0.1), (0.3, 0.4)):
        ring = Obstacle('ring', radius=radius, thickness=width)
        run = simulated(
            simulate,
            _NONE,
            [(0.05, -0.02, 1.5)],
            obstacles=(ring,),
            seconds=30.0,
            restitution=0.3,
            friction=0.5,
        )
        lies = [0.0, 0.0, np.sqrt((1.0 + width / 2) ** 2 - radius**2)]
        off = float(np.linalg.norm(run.positions[-1, 0] - lies))
        yield check('lies in a ring, place [r]', f'ring {radius:g}, wire {width:g}', off, 0, NEAR)
    hoop = Obstacle('ring', radius=1.3, thickness=0.2, axis=(0.1, 0.0, 1.0))
    place, velocity = np.array([0.05, 0.0, 3.0]), np.array([0.0, 0.05, -2.0])
    run = simulated(simulate, _NONE, [place], [velocity], obstacles=(hoop,), seconds=1.0)
    expected = _flight(place, velocity, run.times)
    off = float(np.abs(run.positions[:, 0] - expected).max())
    yield check('through a hoop [r]', 'hoop 1.3, wire 0.2', off, 0, SAME)


def _flight(place: Array, velocity: Array, times: Array) -> Array:
    fall = np.array([0.0, 0.0, -GRAVITY])
    t = times[:, None]
    path: Array = place + velocity * t + 0.5 * fall * t**2
    return path
