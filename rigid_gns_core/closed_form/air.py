# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of flights in air: fall, drag, lift, spin decay, bounces and wind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import air_laws
from .air_laws import Sphere
from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import EXACT, simulated
from ..scenes.air import Air
from ..scenes.plane import Plane
from ..scenes.state import Array, Trajectory

_MASS = 360.0  # of a sphere of 1 m, as dense as a table tennis ball
_SIX = 6.0


def air_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Flights of a sphere as light as a table tennis ball, of speeds up to 3 terminal ones."""
    speeds = (30.0,) if quick else (3.0, 30.0, 150.0)
    yield from _falls(simulate)
    for speed in speeds:
        yield from _lines(simulate, speed)
        yield from _circles(simulate, speed)
    yield from _spins(simulate)
    for e in (0.9,) if quick else (1.0, 0.9, 0.5):
        yield from _bounces(simulate, e)
    yield from _winds(simulate)


def _falls(simulate: Simulate) -> Iterator[Check]:
    for name, air in (
        ('terminal velocity', Air(drag_coefficient=0.5)),
        ('buoyancy and added mass', Air(density=20.0, drag_coefficient=1e-9)),
    ):
        seconds = 30.0 if name == 'terminal velocity' else 3.0
        run = simulated(simulate, (), [(0.0, 0.0, 0.0)], seconds=seconds, mass=_MASS, air=air)
        depth, speed = air_laws.fall(Sphere(air, 1.0, _MASS, GRAVITY), run.times)
        case = f'rho {air.density:g}, {run.times[-1]:g} s'
        yield _error(f'{name}, depth', case, -run.positions[:, 0, 2], depth)
        yield _error(f'{name}, speed', case, -run.velocities[:, 0, 2], speed)


def _lines(simulate: Simulate, speed: float) -> Iterator[Check]:
    air = Air(drag_slope=0.6)
    for spin in (0.0, 0.5 * speed):
        run = _floating(simulate, air, (speed, 0.0, 0.0), (0.0, 0.0, spin))
        way, left = air_laws.slowed(Sphere(air, 1.0, _MASS, 0.0), speed, spin, run.times)
        case = f'{speed:g} m/s, spin ratio {spin / speed:g}'
        yield _error('drag along a line, way', case, run.positions[:, 0, 0], way)
        yield _error('drag along a line, speed', case, run.velocities[:, 0, 0], left)


def _circles(simulate: Simulate, speed: float) -> Iterator[Check]:
    air = Air(drag_coefficient=0.0, lift_coefficient=0.4)
    for ratio in (0.1, 1.0):
        run = _floating(simulate, air, (speed, 0.0, 0.0), (0.0, 0.0, ratio * speed))
        along, across = air_laws.turned(
            Sphere(air, 1.0, _MASS, 0.0), speed, ratio * speed, run.times
        )
        case = f'{speed:g} m/s, spin ratio {ratio:g}'
        yield _error('circle by lift', case, run.positions[:, 0, :2], np.c_[along, across])


def _spins(simulate: Simulate) -> Iterator[Check]:
    rate, spin = 0.3, 2.0
    run = _floating(simulate, Air(spin_decay=rate), (0.0, 0.0, 0.0), (0.0, 0.0, spin))
    expected = spin * np.exp(-rate * run.times)
    yield _error('spin decay', f'c {rate:g} 1/s', run.angular_velocities[:, 0, 2], expected)
    turn = 2.0 * np.arctan2(run.quaternions[:, 0, 2], run.quaternions[:, 0, 3])
    angle = -spin / rate * np.expm1(-rate * run.times)
    error = np.abs((turn - angle + np.pi) % (2.0 * np.pi) - np.pi).max()
    yield check('spin decay, angle [rad]', f'c {rate:g} 1/s', error, 0, EXACT)


def _bounces(simulate: Simulate, e: float) -> Iterator[Check]:
    air, height, seconds = Air(drag_coefficient=0.5), 60.0, 15.0
    run = simulated(
        simulate,
        (Plane(),),
        [(0.0, 0.0, 1.0 + height)],
        seconds=seconds,
        restitution=e,
        mass=_MASS,
        air=air,
    )
    sphere = Sphere(air, 1.0, _MASS, GRAVITY)
    path = [air_laws.bouncing_height(sphere, height, e, time) for time in run.times]
    case = f'e {e:g}, {seconds:g} s'
    yield _error('bounces in air, height', case, run.positions[:, 0, 2] - 1.0, np.array(path))


def _winds(simulate: Simulate) -> Iterator[Check]:
    """Wind takes a sphere along a smooth floor: the guard lets it.

    Drag is that of the flight over a substep, with the fall that the floor prevents: at 20 m/s,
    (g h / u)^2 / 6 = 6e-6 of it.
    """
    wind = 20.0
    air = Air(wind=(wind, 0.0, 0.0))
    run = simulated(simulate, (Plane(),), [(0.0, 0.0, 1.0)], seconds=_SIX, mass=_MASS, air=air)
    way, left = air_laws.slowed(Sphere(air, 1.0, _MASS, 0.0), wind, 0.0, run.times)
    case = f'{wind:g} m/s'
    expected = wind * run.times - way
    yield _error('wind along a smooth floor, way', case, run.positions[:, 0, 0], expected, 2e-5)
    speed = run.velocities[:, 0, 0]
    yield _error('wind along a smooth floor, speed', case, speed, wind - left, 2e-5)


def _floating(
    simulate: Simulate, air: Air, velocity: tuple[float, ...], spin: tuple[float, ...]
) -> Trajectory:
    """Flight without gravity from the origin, for `_SIX` seconds."""
    return simulated(
        simulate,
        (),
        [(0.0, 0.0, 0.0)],
        [velocity],
        [spin],
        seconds=_SIX,
        mass=_MASS,
        air=air,
        gravity=(0.0, 0.0, 0.0),
    )


def _error(name: str, case: str, measured: Array, expected: Array, bound: float = EXACT) -> Check:
    """Check of the largest error in any frame, over the largest value."""
    error = np.abs(measured - expected).max() / np.abs(expected).max()
    return check(name, case, error, 0, bound)
