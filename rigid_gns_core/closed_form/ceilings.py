# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of surfaces from below: ceilings, undersides of plates, and strips.

A strip, a plane with one length given and the other infinite, is as solid and as bounded as a
plate.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import EXACT, plate, SAME, simulated, velocity_check
from ..scenes.plane import Plane
from ..scenes.state import Array, Trajectory

_UP = np.array([0.0, 0.0, 1.0])
_FALL = -GRAVITY * _UP


def ceiling_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Bounces off what gravity pulls away from, and between a floor and a ceiling."""
    yield from _upwards(simulate, quick)
    for e, height in ((1.0, 5.0),) if quick else ((1.0, 5.0), (1.0, 2.5), (1.0, 40.0)):
        run = simulated(
            simulate,
            (Plane(), Plane((0.0, 0.0, height), (0.0, 0.0, -1.0))),
            [(0.0, 0.0, 1.5)],
            [(1.0, 0.5, np.sqrt(2.0 * GRAVITY * height))],
            seconds=8.0 if quick else 40.0,
            restitution=e,
        )
        total = laws.energy(
            run.positions, run.velocities, run.angular_velocities, np.ones(1), np.ones(1), _FALL
        )
        lost = np.abs(total / total[0] - 1.0).max()
        case = f'{height:g} r apart, {run.times[-1]:g} s'
        yield check('between floor and ceiling, energy', case, lost, 0, EXACT)


def _upwards(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Thrown against a ceiling: a parabola, Newton's law, a parabola."""
    for kind in ('plane', 'underside of a plate', 'underside of a strip'):
        for degrees in (0.0,) if quick else (0.0, 10.0, 40.0):
            angle = np.radians(degrees)
            normal = np.array([np.sin(angle), 0.0, -np.cos(angle)])
            along = np.array([np.cos(angle), 0.0, np.sin(angle)])
            surface = {
                'plane': plate(-normal, normal, along, np.inf, np.inf),
                'underside of a plate': plate(-normal, -normal, along),
                'underside of a strip': plate(-normal, -normal, along, 9.0, np.inf),
            }[kind]
            for e in (1.0, 0.8):
                for speed in (8.0,) if quick else (2.0, 8.0, 30.0):
                    before = np.array([0.5, 0.2, speed])  # as it strikes, with its centre in 0
                    time = 0.13
                    run = simulated(
                        simulate,
                        (surface,),
                        [-time * before + 0.5 * time**2 * _FALL],
                        [before - time * _FALL],
                        seconds=0.13,
                        restitution=e,
                    )
                    after, _ = laws.impact_on_surface(before, 0 * before, normal, 1.0, e, 0.0)
                    after = after + (run.times[-1] - time) * _FALL
                    case = f'{kind}, {degrees:g} deg, e {e:g}, {speed:g} m/s'
                    yield velocity_check('off a ceiling', case, run, [after], speed, EXACT)


def strip_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Below, beside and over a strip nothing is felt; its back and its edge are solid."""
    floor = Plane()
    heights = (2.5,) if quick else (2.1, 4.0, 1000.0)
    for turned in (False, True):  # which of the lengths is infinite
        for height in heights:
            lengths = (np.inf, 4.0) if turned else (4.0, np.inf)
            direction = (0.0, 1.0, 0.0) if turned else (1.0, 0.0, 0.0)
            shelf = plate((0.0, 0.0, height), _UP, direction, *lengths)
            case = f'{height:g} r high, {"y" if turned else "x"} given'
            rolling = np.array([[-2.0, 0.3, 0.0]])
            spin = np.cross(_UP, rolling)
            run = simulated(
                simulate,
                (floor, shelf),
                [(3.0, 0.0, 1.0)],
                rolling,
                spin,
                seconds=2.5,
                friction=0.5,
            )
            path = run.times[:, None, None] * rolling + [3.0, 0.0, 1.0]
            apart = _off(run, path)
            yield check('rolls below a strip [r]', case, apart, 0, SAME)
            beside = np.array([[3.001, 0.0, height + 3.0]])
            run = simulated(simulate, (shelf,), beside, seconds=1.0)
            apart = _off(run, beside + 0.5 * run.times[:, None, None] ** 2 * _FALL)
            yield check('falls beside a strip [r]', case, apart, 0, SAME)
            run = simulated(simulate, (shelf,), [(1.9, 0.0, height + 1.5)], seconds=0.8)
            expected = [[1.9, 0.0, height + 1.5]] + 0.5 * run.times[:, None, None] ** 2 * _FALL
            fall = np.sqrt(2.0 * 0.5 / GRAVITY)
            since = np.maximum(run.times - fall, 0.0)[:, None]
            up = GRAVITY * fall * since - 0.5 * GRAVITY * since**2
            hit = run.times > fall
            expected[hit, :, 2] = height + 1.0 + up[hit]  # e 1; until the next at 3 times the fall
            apart = _off(run, expected)
            yield check('bounces on a strip [r]', case, apart, 0, EXACT)
    for speed in (4.0,) if quick else (4.0, 5.0, 12.0):
        fence = plate((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), _UP, 2.0, np.inf)
        over = np.array([[speed, 0.5, 4.0]])
        run = simulated(
            simulate, (floor, fence), [(-0.4 * speed, 0.0, 2.5)], over, seconds=0.7, radius=1.0
        )
        path = [[-0.4 * speed, 0.0, 2.5]] + run.times[:, None, None] * over
        path = path + 0.5 * run.times[:, None, None] ** 2 * _FALL
        apart = _off(run, path)
        yield check('thrown over a fence [r]', f'{speed:g} m/s', apart, 0, SAME)
        for side in (-1.0, 1.0):
            motion = np.array([[-side * speed, 0.4, 0.0]])
            start = np.array([[side, 0.0, 1.0]]) - 0.13 * motion
            run = simulated(simulate, (floor, fence), start, motion, seconds=0.13, restitution=0.8)
            case = f'{"back" if side > 0 else "front"}, {speed:g} m/s'
            expected = motion * [-0.8, 1.0, 1.0]
            yield velocity_check('against a fence', case, run, expected, speed, EXACT)


def _off(run: Trajectory, path: Array) -> float:
    """Largest distance [m] from a path, shape (frames, spheres, 3)."""
    return float(np.linalg.norm(run.positions - path, axis=-1).max())
