# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of edges and corners of plates: grazing blows, and spheres that roll over them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check, worst
from .runs import AHEAD, EXACT, NEAR, plate, simulated, velocity_check
from ..scenes.state import Array

_PLATE = plate((0.0, 0.0, 0.0), length_x=4.0, length_y=4.0)
_EDGE, _CORNER = np.array([2.0, 0.3, 0.0]), np.array([2.0, 2.0, 0.0])
_UP = np.array([0.0, 0.0, 1.0])
# the moment at which a rolling sphere leaves is found to a millisecond: friction changes its speed
_LEAVES = 0.02


def edge_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Blows on the edge and the corner of a plate, which are those on a line and on a point.

    The distance to a plate is convex along a line, so a sphere that approaches the nearest point
    of the plate as it touches it has not touched it before, and will not touch it again.
    """
    offsets = (0.5, 0.99) if quick else (0.3, 0.5, 0.9, 0.95, 0.99)
    # 14 m/s at a radius of 20 mm are 99 m/s at 1 m
    speeds = (2.0, 99.0) if quick else (2.0, 14.0, 50.0, 99.0)
    for kind, point, sides in (
        ('edge', _EDGE, [(1.0, 0.0)]),
        ('corner', _CORNER, [(1.0, 0.0), (0.6, 0.8), (0.1, np.sqrt(0.99))]),
    ):
        for offset in offsets:
            for side in sides:
                across = offset * np.array([*side, 0.0])
                for up in (1.0, -1.0):
                    normal = across + up * np.sqrt(1.0 - offset**2) * _UP
                    for name, path in _paths(normal, up).items():
                        where = f'{kind}, {offset:g} r beside towards {side[0]:.2g}, {name}'
                        where += ' from above' if up > 0 else ' from below'
                        yield from _blows(simulate, point, normal, path, speeds, where)
    for offset in offsets:
        normal = np.array([offset, 0.0, np.sqrt(1.0 - offset**2)])
        for height in (0.2, 3.0):
            time = np.sqrt(2.0 * height / GRAVITY)
            start = _EDGE + normal + height * _UP
            run = simulated(simulate, (_PLATE,), [start], seconds=time, restitution=0.9)
            before = -GRAVITY * time * _UP
            after, _ = laws.impact_on_surface(before, 0 * before, normal, 1.0, 0.9, 0.0)
            after = after - GRAVITY * (run.times[-1] - time) * _UP
            case = f'{offset:g} r beside, from {height:g} r'
            speed = GRAVITY * time
            yield velocity_check('dropped on an edge', case, run, [after], speed, EXACT)


def _paths(normal: Array, up: float) -> dict[str, Array]:
    """Unit directions of approach by name: all against the normal."""
    paths = {
        'straight': -up * _UP,
        'outwards': np.array([0.4, 0.3, -up]),
        'inwards': np.array([-0.6, -0.5, -up]),
        'level': np.array([-1.0, -0.2, 0.0]),
    }
    unit = {name: path / np.linalg.norm(path) for name, path in paths.items()}
    return {name: path for name, path in unit.items() if path @ normal < -0.05}


def _blows(
    simulate: Simulate,
    point: Array,
    normal: Array,
    path: Array,
    speeds: tuple[float, ...],
    where: str,
) -> Iterator[Check]:
    """Blows without gravity, with friction and spin too: the worst of all speeds."""
    spin = np.array([1.0, -2.0, 0.5])
    cases = [f'{where}, {speed:g} m/s' for speed in speeds]
    for friction in (0.0, 0.3):
        errors = np.zeros((2, len(speeds)))
        for k, speed in enumerate(speeds):
            before = speed * path
            run = simulated(
                simulate,
                (_PLATE,),
                [point + normal - AHEAD * before],
                [before],
                [spin],
                seconds=AHEAD + 0.1,
                restitution=0.9,
                friction=friction,
                gravity=(0.0, 0.0, 0.0),
            )
            after = laws.impact_on_surface(before, spin, normal, 1.0, 0.9, friction)
            ends = run.velocities[-1, 0], run.angular_velocities[-1, 0]
            for kind in (0, 1):
                errors[kind, k] = np.linalg.norm(ends[kind] - after[kind]) / speed
        smooth = 'with friction' if friction else 'frictionless'
        for kind, error in zip(('velocity', 'spin'), errors, strict=True):
            name = f'grazes an edge, {smooth}, {kind}'
            yield worst(name, cases, error, 0.0 * error, EXACT)


def topple_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A sphere goes over an edge, a corner or a fixed sphere, with enough friction or none."""
    starts = [(5.0, 0.0), (15.0, 0.0), (0.0, 0.5), (0.0, 1.0), (0.0, 2.0), (10.0, 0.7)]
    for start, speed in starts[::3] if quick else starts:
        for rolls in (True, False):
            for kind, point, heading in (
                ('edge', np.array([2.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])),
                ('corner', _CORNER, np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)),
                ('sphere', np.array([0.0, 0.0, 1.0]), np.array([0.8, 0.6, 0.0])),
            ):
                if kind == 'sphere' and start == 0:
                    continue  # of level starts, those on the plate are enough
                yield from _over(simulate, kind, point, heading, np.radians(start), speed, rolls)


def _over(
    simulate: Simulate,
    kind: str,
    point: Array,
    heading: Array,
    start: float,
    speed: float,
    rolls: bool,
) -> Iterator[Check]:
    """Speed against angle from 20 to 45 degrees, and velocity and spin after it has left."""
    inertia = 0.4 if rolls else 0.0
    mu = 1e3 if rolls else 0.0
    for radius in (1.0,) if kind != 'sphere' else (1.0, 0.5):
        reach = radius if kind != 'sphere' else 1.0 + radius
        leaves = laws.leaving_angle(speed, start, reach, inertia, GRAVITY)
        outwards = np.sin(start) * heading + np.cos(start) * _UP
        motion = speed * (np.cos(start) * heading - np.sin(start) * _UP)
        # level starts come over the platform; the others begin on the circle
        centre = point + reach * outwards - (0.33 * motion if start == 0 else 0.0)
        spin = np.cross(outwards, motion) / radius * rolls
        given = {'friction': mu, 'restitution': 0.5}
        if kind == 'sphere':  # on a floor, so heavy that it does not move
            floor = plate(np.zeros(3), length_x=np.inf, length_y=np.inf)
            run = simulated(
                simulate,
                (floor,),
                [point, centre],
                [0 * motion, motion],
                [0 * spin, spin],
                seconds=2.0,
                radius=(1.0, radius),
                mass=(1e9, 1.0),
                **given,
            )
        else:
            run = simulated(simulate, (_PLATE,), [centre], [motion], [spin], seconds=2.0, **given)
        lever = run.positions[:, -1] - point
        velocities = run.velocities[:, -1]
        angles = np.arctan2(lever @ heading, lever[:, 2])
        case = f'{kind}, {"rolls" if rolls else "slides"} at {speed:g} m/s from '
        case += f'{np.degrees(start):.0f} deg, r {radius:g}'
        seen = (angles > np.radians(20.0)) & (angles < min(np.radians(45.0), leaves))
        if seen.any():
            speeds = np.linalg.norm(velocities[seen], axis=-1)
            expected = laws.speed_over_edge(speed, start, angles[seen], reach, inertia, GRAVITY)
            cases = [f'{case}, at {angle:.0f} deg' for angle in np.degrees(angles[seen])]
            yield worst('over an edge, speed [m/s]', cases, speeds, expected, NEAR)
        end = laws.speed_over_edge(speed, start, np.array(leaves), reach, inertia, GRAVITY)
        # until a sphere on a fixed one comes to the floor
        flying = np.flatnonzero(angles > leaves + 0.1)[0] if (angles > leaves + 0.1).any() else -1
        across = float(end * np.cos(leaves))
        yield check(
            'off an edge, speed across [m/s]',
            case,
            velocities[flying] @ heading,
            across,
            _LEAVES if rolls else NEAR,
        )
        if rolls:
            turning = np.linalg.norm(run.angular_velocities[flying, -1]) * radius
            yield check('off an edge, r times spin [m/s]', case, turning, float(end), _LEAVES)
