# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of surfaces that move: walls, rackets, lifts, belts, turntables and trays."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import AHEAD, EXACT, NEAR, SAME, simulated, velocity_check
from ..scenes.contact_law import ContactLaw
from ..scenes.plane import Plane, Vector
from ..scenes.state import Array

_FREE: dict[str, Any] = {'gravity': (0.0, 0.0, 0.0)}
_GRIPS = ContactLaw(0.0, 1.0)


def moving_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Blows by surfaces that move, and spheres that they carry."""
    yield from _wall_checks(simulate)
    yield from _racket_checks(simulate, quick)
    yield from _swing_checks(simulate, quick)
    yield from _lift_checks(simulate)
    yield from _belt_checks(simulate, quick)
    yield from _turning_checks(simulate, quick)


def _wall_checks(simulate: Simulate) -> Iterator[Check]:
    """A wall at V meets a sphere at v: (1 + e) V - e v, 2 V - v where it is elastic."""
    for e, on_floor in product((1.0, 0.6), (False, True)):
        wall = Plane((-1.0 - 5.0 * AHEAD, 0.0, 0.0), (1.0, 0.0, 0.0), velocity=(2.0, 0.0, 0.0))
        run = simulated(
            simulate,
            (wall, Plane((0.0, 0.0, -1.0))) if on_floor else (wall,),
            [(0.0, 0.0, 0.0)],
            [(-3.0, 0.0, 0.0)],
            seconds=0.3,
            restitution=e,
            **({} if on_floor else _FREE),
        )
        case = f'e {e:g}{", on a floor" if on_floor else ""}'
        expected = [((1.0 + e) * 2.0 + e * 3.0, 0.0, 0.0)]
        yield velocity_check('wall that moves, velocity', case, run, expected, 5.0, EXACT)


def _racket_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A racket at V strikes a sphere with spin: in its frame a blow like any other."""
    for friction, beta in ((0.9, 0.2),) if quick else ((0.9, 0.2), (0.05, 0.0), (0.9, -0.5)):
        law, stroke = ContactLaw(0.8, friction, beta), np.array([3.0, -1.0, 2.0])
        normal = np.array([0.6, 0.0, 0.8])
        velocity, spin = np.array([-2.0, 1.0, -5.0]), np.array([3.0, -2.0, 4.0])
        at, facing, moving = map(_tuple, (-AHEAD * stroke, normal, stroke))
        racket = Plane(at, facing, contact=law, velocity=moving)
        run = simulated(
            simulate,
            (racket,),
            [normal - AHEAD * velocity],
            [velocity],
            [spin],
            seconds=AHEAD,
            **_FREE,
        )
        case, inertia = f'mu {friction:g}, beta {beta:g}', 0.4
        after, turned = laws.impact_on_surface(
            velocity - stroke, spin, normal, 1.0, 0.8, friction, inertia, beta
        )
        speed = float(np.linalg.norm(velocity - stroke))
        yield velocity_check(
            'stroke of a racket, velocity', case, run, [after + stroke], speed, EXACT
        )
        error = np.abs(run.angular_velocities[-1, 0] - turned).max() / speed
        yield check('stroke of a racket, spin', case, error, 0, EXACT)


def _tuple(vector: Array) -> Vector:
    x, y, z = vector.tolist()
    return x, y, z


def _swing_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A blade that turns about z through the origin meets a sphere, off its middle."""
    place, velocity, e = np.array([15.0, 6.0, 0.0]), np.array([-7.0, -14.0, 0.0]), 0.8
    for rate in (1.5,) if quick else (0.5, 1.5, 3.0):
        spin = np.array([0.0, 0.0, rate])

        def normal(time: float, rate: float = rate) -> Array:
            return np.array([-np.sin(rate * time), np.cos(rate * time), 0.0])

        early, late = 0.0, 0.4
        for _ in range(60):
            time = 0.5 * (early + late)
            touches = (place + time * velocity) @ normal(time) < 1.0
            early, late = (early, time) if touches else (time, late)
        at = place + time * velocity
        surface = np.cross(spin, at - normal(time))
        closing = (velocity - surface) @ normal(time)
        after = velocity - (1.0 + e) * closing * normal(time)
        blade = Plane(
            normal=(0.0, 1.0, 0.0),
            direction=(1.0, 0.0, 0.0),
            length_x=60.0,
            length_y=20.0,
            angular_velocity=(0.0, 0.0, rate),
            contact=ContactLaw(e, 0.0),
        )
        run = simulated(simulate, (blade,), [place], [velocity], seconds=time + 0.1, **_FREE)
        speed = float(np.linalg.norm(after))
        case = f'{rate:g} rad/s'
        yield velocity_check('swing of a blade, velocity', case, run, [after], speed, NEAR)
        way = (run.times[-1] - time) * after
        error = np.abs(run.positions[-1, 0] - at - way).max() / np.linalg.norm(way)
        yield check('swing of a blade, way', case, error, 0, NEAR)


def _lift_checks(simulate: Simulate) -> Iterator[Check]:
    """A floor at V carries a column of three spheres that start with it."""
    moving = np.array([0.3, 0.0, 0.7])
    places = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 3.0], [0.0, 0.0, 5.0]])
    run = simulated(
        simulate,
        (Plane(velocity=(0.3, 0.0, 0.7)),),
        places,
        np.tile(moving, (3, 1)),
        seconds=10.0,
        restitution=0.5,
        friction=0.5,
    )
    error = np.abs(run.positions - places - run.times[:, None, None] * moving).max()
    yield check('carried by a lift, place [r]', 'three spheres', error, 0, SAME)


def _belt_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """A sphere laid on a belt slides, then rolls at i / (1 + i) of its speed: 2 V / 7, solid."""
    for inertia in (0.4,) if quick else (0.4, 2.0 / 3.0):
        for speed in (2.0, -5.0):
            belt = Plane(contact=ContactLaw(0.0, 0.2), surface_velocity=(speed, 0.0, 0.0))
            run = simulated(
                simulate, (belt,), [(0.0, 0.0, 1.0)], seconds=3.0, inertia_factor=inertia
            )
            path = [
                speed + laws.slide_to_roll(-speed, 0.0, 0.2, GRAVITY, t, inertia)
                for t in run.times
            ]
            error = np.abs(run.velocities[:, 0, 0] - path).max() / abs(speed)
            case = f'i {inertia:.2g}, {speed:g} m/s'
            yield check('laid on a belt, speed', case, error, 0, NEAR)


def _turning_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Rolling on a turntable, in circles at i / (1 + i) of its rate; on a tray that tilts."""
    for inertia, rate in ((0.4, 1.0),) if quick else ((0.4, 1.0), (2.0 / 3.0, 2.0)):
        # where it is laid it rolls: the surface, at rate * 3 along y, is 0.5 m/s at the centre
        run = simulated(
            simulate,
            (Plane(contact=_GRIPS, angular_velocity=(0.0, 0.0, rate)),),
            [(3.0, 0.0, 1.0)],
            [(0.0, 0.5, 0.0)],
            [(3.0 * rate - 0.5, 0.0, 0.0)],
            seconds=20.0,
            inertia_factor=inertia,
        )
        turns = rate * inertia / (1.0 + inertia)
        angle = turns * run.times
        circle = 0.5 / turns * np.stack([np.cos(angle) - 1.0, np.sin(angle)], axis=-1)
        error = np.abs(run.positions[:, 0, :2] - (3.0, 0.0) - circle).max() * turns / 0.5
        yield check('circles on a turntable', f'i {inertia:.2g}', error, 0, NEAR)
    for rate in (0.05, 0.2):
        tray = Plane(contact=_GRIPS, angular_velocity=(0.0, rate, 0.0))
        run = simulated(simulate, (tray,), [(0.0, 0.0, 1.0)], seconds=2.0)
        error = np.abs(run.positions[:, 0] - on_tray(rate, 0.4, run.times)).max()
        yield check('rolls off a tray that tilts, place [r]', f'{rate:g} rad/s', error, 0, NEAR)


def on_tray(rate: float, inertia: float, times: Array) -> Array:
    """Centre of a sphere of 1 m that rolls on a tray which turns about y, shape (k, 3).

    At rest on it at first. With s along the tray, (1 + i) s'' = W^2 s + g sin W t, s' = -r W at
    the start:
    s = A sinh(k t) + B sin(W t), k = W / sqrt(1 + i), B = -g / (2 + i) W^2, A k = -W (r + B).
    """
    growth, swing = rate / np.sqrt(1.0 + inertia), -GRAVITY / ((2.0 + inertia) * rate**2)
    along = -rate * (1.0 + swing) / growth * np.sinh(growth * times)
    along = along + swing * np.sin(rate * times)
    cosine, sine = np.cos(rate * times), np.sin(rate * times)
    return np.stack([along * cosine + sine, np.zeros_like(times), cosine - along * sine], axis=-1)
