# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of surfaces that meet at an angle: over a joint of a platform and a ramp.

A sphere that slides without friction or rolls without slip over a convex joint keeps its energy,
since its normal turns without a jump; at a concave one it strikes the ramp.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import difference, EXACT, NEAR, plate, SAME, simulated, velocity_check
from ..scenes.plane import Plane
from ..scenes.state import Array

_PLATFORM = plate((-10.0, 0.0, 0.0))
_UP = np.array([0.0, 0.0, 1.0])
_RADIAN = float(np.degrees(1e-3))
_ROLLS = (False, True)


def joint_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Over a platform, x < 0, and on a ramp that leaves it at an angle (below 0: upwards)."""
    yield from _slowly_down(simulate, (10.0,) if quick else (_RADIAN, 2.0, 10.0, 25.0))
    yield from _fast_down(simulate, (20.0,) if quick else (15.0, 20.0, 40.0))
    yield from _up(simulate, (10.0,) if quick else (_RADIAN, 2.0, 10.0, 20.0))
    yield from _before(simulate, (10.0,) if quick else (-20.0, -_RADIAN, _RADIAN, 10.0))


def _ramp(degrees: float) -> tuple[Plane, Array]:
    """Ramp down from x = 0, and the direction downhill."""
    angle = np.radians(degrees)
    down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    return plate(10.0 * down, normal, down), down


def _rolling(speed: float, rolls: bool) -> tuple[Array, Array, float]:
    """Velocity, spin and friction of the pair of a sphere that slides freely or rolls."""
    velocity = np.array([[speed, 0.0, 0.0]])
    return velocity, np.array([[0.0, speed * rolls, 0.0]]), float(rolls)


def _kind(speed: float, degrees: float, rolls: bool) -> str:
    return f'{"rolls" if rolls else "slides"} at {speed:g} m/s, {degrees:.2g} deg'


def _slowly_down(simulate: Simulate, angles: tuple[float, ...]) -> Iterator[Check]:
    """Slower than sqrt(g r cos): it stays on the surface and keeps its energy."""
    for degrees in angles:
        ramp, _ = _ramp(degrees)
        for speed in (0.3, 1.0):
            for rolls in _ROLLS:
                velocity, spin, friction = _rolling(speed, rolls)
                start = np.array([[0.0, 0.0, 1.0]]) - 0.33 * velocity
                run = simulated(
                    simulate,
                    (_PLATFORM, ramp),
                    start,
                    velocity,
                    spin,
                    seconds=2.5,
                    restitution=0.5,
                    friction=friction,
                )
                place = run.positions[-1, 0]
                case = _kind(speed, degrees, rolls)
                height = float(place @ np.asarray(ramp.normal)) - 1.0
                yield check('over a joint, height above the ramp [r]', case, height, 0, NEAR)
                fallen = 2.0 * GRAVITY * (1.0 - place[2])
                expected = np.sqrt(speed**2 + fallen / (1.4 if rolls else 1.0))
                reached = float(np.linalg.norm(run.velocities[-1, 0]))
                yield check('over a joint, speed [m/s]', case, reached, float(expected), NEAR)


def _fast_down(simulate: Simulate, angles: tuple[float, ...]) -> Iterator[Check]:
    """Faster than that: it leaves at the joint, on a parabola."""
    for degrees in angles:
        for speed in (5.0, 8.0):
            for rolls in _ROLLS:
                velocity, spin, friction = _rolling(speed, rolls)
                start = np.array([[0.0, 0.0, 1.0]]) - 0.13 * velocity
                # it lands after about 2 v tan(angle) / g, 0.27 s or more
                run = simulated(
                    simulate,
                    (_PLATFORM, _ramp(degrees)[0]),
                    start,
                    velocity,
                    spin,
                    seconds=0.3,
                    friction=friction,
                )
                expected = velocity - GRAVITY * (run.times[-1] - 0.13) * _UP
                case = _kind(speed, degrees, rolls)
                yield velocity_check('off a joint, velocity', case, run, expected, speed, NEAR)


def _up(simulate: Simulate, angles: tuple[float, ...]) -> Iterator[Check]:
    """A ramp upwards is struck where the sphere touches both: tan(angle / 2) before the joint."""
    for degrees in angles:
        ramp, along = _ramp(-degrees)
        angle = np.radians(degrees)
        for e in (0.0, 0.9) if degrees > 5.0 else (0.0,):
            for rolls in _ROLLS:
                velocity, spin, friction = _rolling(4.0, rolls)
                touch = np.array([[-np.tan(angle / 2.0), 0.0, 1.0]])
                after, _ = laws.impact_on_surface(
                    velocity[0], spin[0], np.asarray(ramp.normal), 1.0, e, friction
                )
                seconds = 0.2 if e else 0.5
                run = simulated(
                    simulate,
                    (_PLATFORM, ramp),
                    touch - 0.13 * velocity,
                    velocity,
                    spin,
                    seconds=seconds,
                    restitution=e,
                    friction=friction,
                )
                since = run.times[-1] - 0.13
                slows = GRAVITY * np.sin(angle) / (1.4 if rolls else 1.0)
                after = after - since * (GRAVITY * _UP if e else slows * along)
                case = f'{_kind(4.0, degrees, rolls)}, e {e:g}'
                bound = NEAR if rolls else EXACT
                yield velocity_check('against a ramp, velocity', case, run, after, 4.0, bound)


def _before(simulate: Simulate, angles: tuple[float, ...]) -> Iterator[Check]:
    """What lies ahead is not felt: as on the platform or ramp alone, up to the joint."""
    for degrees in angles:
        ramp, down = _ramp(degrees)
        reach = max(0.0, -float(np.tan(np.radians(degrees) / 2.0)))
        for rolls, rolling_friction in ((False, 0.0), (True, 0.0), (True, 0.05)):
            velocity, spin, friction = _rolling(2.0, rolls)
            start = np.array([[-reach - 0.01, 0.0, 1.0]]) - 0.5 * velocity
            one, other = (
                simulated(
                    simulate,
                    surfaces,
                    start,
                    velocity,
                    spin,
                    seconds=0.5,
                    friction=friction,
                    rolling_friction=rolling_friction,
                )
                for surfaces in ((_PLATFORM,), (_PLATFORM, ramp))
            )
            case = f'{_kind(2.0, degrees, rolls)}, rolling friction {rolling_friction:g}'
            apart = difference(one, other)
            yield check('before a joint as without it [r]', case, apart, 0, SAME)
        for inside in (0.01, 0.5) if degrees > 0 else ():
            one, other = (
                simulated(
                    simulate,
                    surfaces,
                    [inside * down + np.asarray(ramp.normal) + 2.0 * _UP],
                    seconds=1.0,
                    restitution=0.8,
                )
                for surfaces in ((ramp,), (ramp, _PLATFORM))
            )
            case = f'{inside:g} r down a ramp of {degrees:.2g} deg'
            apart = difference(one, other)
            yield check('dropped beside a joint as without it [r]', case, apart, 0, SAME)
