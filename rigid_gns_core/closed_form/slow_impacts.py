# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of slow blows: without gravity any speed bounces, with it the surface's pull decides."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import AHEAD, DT, EXACT, NEAR, plate, simulated, velocity_check
from ..scenes.plane import Plane

THRESHOLD = 3.0 * GRAVITY * DT / 240.0
"""Approach speed [m/s] on a level floor below which a bounce ends, as in Bullet with 240 substeps.

It is a pull N over a time, so on another surface it goes by N = -n . g.
"""

_WALL = Plane(normal=(1.0, 0.0, 0.0))
_SPEEDS = (1.0, 1e-1, 1e-2, 1e-3, 1e-6)


def slow_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Restitution at any speed where nothing pulls, and the end of bouncing where it does."""
    speeds = _SPEEDS[::2] if quick else _SPEEDS
    for e in (1.0, 0.5):
        for v in speeds:
            case = f'e {e:g}, {v:g} m/s'
            motion = np.array([[-v, 0.3 * v, 0.0], [0.0] * 3])
            given = {'seconds': AHEAD, 'restitution': e}
            for name, surfaces, gravity in (
                ('no gravity, off a wall', (_WALL,), 0.0),
                ('falls along a wall', (_WALL,), GRAVITY),
                ('on a floor, slowly off a wall', (_WALL, Plane()), GRAVITY),
            ):
                start = np.array([[1.0, 0.0, 1.0]]) - AHEAD * motion[:1]
                down = (0.0, 0.0, -gravity)
                run = simulated(simulate, surfaces, start, motion[:1], gravity=down, **given)
                expected = motion[0] * [-e, 1.0, 0.0]
                if len(surfaces) == 1:
                    expected[2] = -gravity * run.times[-1]
                error = np.linalg.norm((run.velocities[-1, 0] - expected)[:2]) / v
                yield check(name, case, error, 0, EXACT)
            for mass in (1.0, 4.0):
                start = np.array([(2.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
                motion[0, 1] = 0.0
                run = simulated(
                    simulate,
                    (),
                    start - AHEAD * motion,
                    motion,
                    gravity=(0.0, 0.0, 0.0),
                    mass=(mass, 1.0),
                    **given,
                )
                after = np.zeros((2, 3))
                after[:, 0] = -v * (mass - e) / (mass + 1.0), -v * (1.0 + e) * mass / (mass + 1.0)
                name = 'no gravity, off a sphere'
                yield velocity_check(name, f'{case}, mass {mass:g}', run, after, v, EXACT)
    yield from _thresholds(simulate, (0.0, 60.0) if quick else (0.0, 30.0, 60.0, 80.0, 88.0))


def _thresholds(simulate: Simulate, angles: tuple[float, ...]) -> Iterator[Check]:
    """An elastic sphere goes on bouncing on an incline above the threshold, and rests below it."""
    for degrees in angles:
        angle = np.radians(degrees)
        normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
        incline = plate(np.zeros(3), normal, (0.0, 1.0, 0.0), np.inf, np.inf)
        pull = GRAVITY * np.cos(angle)
        for share, remains in ((1.2, 1.0), (0.8, 0.0), (3.0, 1.0)):
            u = share * THRESHOLD * np.cos(angle)
            drop = 0.5 * u**2 / pull * normal
            for kind, start, motion in (
                ('dropped', normal + drop, 0.0 * normal),
                ('thrown off', normal, u * normal),
            ):
                run = simulated(simulate, (incline,), [start], [motion], seconds=0.5)
                # the speed across the incline that is left at its surface
                across, gap = run.velocities[-1, 0] @ normal, run.positions[-1, 0] @ normal - 1.0
                left = np.sqrt(max(across**2 + 2.0 * pull * gap, 0.0)) / u
                case = f'{kind}, {degrees:g} deg, {share:g} of the threshold'
                yield check('bounces on an incline, speed left', case, left, remains, NEAR)
