# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of contact laws: grip of solid and hollow spheres, restitution over approach speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import AHEAD, EXACT, NEAR, simulated, velocity_check
from ..scenes.contact_law import ContactLaw, RestitutionCurve
from ..scenes.plane import Plane
from ..scenes.state import Array, Trajectory

_UP = np.array([0.0, 0.0, 1.0])


def grip_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Oblique blows with spin that grip or slide, on a floor and between spheres."""
    inertias = (2.0 / 3.0,) if quick else (0.4, 2.0 / 3.0)
    for inertia, beta, friction in product(inertias, (0.0, 0.2, -0.5), (0.9, 0.05)):
        law = ContactLaw(0.8, friction, beta)
        case = f'i {inertia:.2g}, beta {beta:g}, mu {friction:g}'
        velocity, spin = np.array([2.0, 1.0, -5.0]), np.array([3.0, -2.0, 4.0])
        run = simulated(
            simulate,
            (Plane(contact=replace(law, rolling_friction=0.05)),),  # which takes no part
            [_UP - AHEAD * velocity],
            [velocity],
            [spin],
            seconds=AHEAD,
            inertia_factor=inertia,
            gravity=(0.0, 0.0, 0.0),
        )
        after = laws.impact_on_surface(velocity, spin, _UP, 1.0, 0.8, friction, inertia, beta)
        yield from _motion_checks('blow on a floor', case, run, after[0][None], after[1][None])
        velocities, spins = np.array([velocity, [0.5, 0, 3]]), np.array([spin, [-1.0, 2, 5]])
        radii, masses = np.array([1.0, 0.8]), np.array([1.0, 0.5])
        run = simulated(
            simulate,
            (),
            np.array([1.8 * _UP, 0.0 * _UP]) - AHEAD * velocities,
            velocities,
            spins,
            seconds=AHEAD,
            inertia_factor=inertia,
            gravity=(0.0, 0.0, 0.0),
            radius=tuple(radii),
            mass=tuple(masses),
            sphere_contact=law,
        )
        pair = laws.impact_of_spheres(
            velocities, spins, _UP, radii, masses, 0.8, friction, inertia, beta
        )
        yield from _motion_checks('blow of spheres', case, run, *pair)


def curve_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Series of bounces whose restitution depends on the approach speed, and single blows."""
    curves = [RestitutionCurve(0.32, 0.88, 0.33), RestitutionCurve(0.95, 0.5, 4.0)]
    for curve in curves:
        case = f'e {curve.slow:g} to {curve.fast:g}'
        plane = Plane(contact=ContactLaw(curve, 0.0))
        for speed in (0.2, 5.0) if quick else (0.01, 0.2, 1.0, 5.0, 50.0):
            run = simulated(
                simulate,
                (plane,),
                [(1.0 + AHEAD * speed) * _UP],
                [-speed * _UP],
                seconds=AHEAD,
                gravity=(0.0, 0.0, 0.0),
            )
            name, expected = 'restitution over speed', [float(curve.at(speed)) * speed * _UP]
            yield velocity_check(name, f'{case}, {speed:g} m/s', run, expected, speed, EXACT)
        height = 8.0
        run = simulated(simulate, (plane,), [(1.0 + height) * _UP], seconds=4.0)
        path = _series(curve, height, run.times)
        error = np.abs(run.positions[:, 0, 2] - 1.0 - path).max() / height
        yield check('series of bounces over speed', case, error, 0, EXACT)
        # friction keeps the angular momentum about the floor: it ends at v / (1 + i)
        run = simulated(
            simulate,
            (Plane(contact=ContactLaw(curve, 0.3)),),
            [(0.0, 0.0, 1.5)],
            [(1.0, 0.0, 0.0)],
            seconds=9.0,
        )
        yield velocity_check(
            'bounces over speed, then rolling', case, run, [(1.0 / 1.4, 0.0, 0.0)], 1.0, NEAR
        )


def _series(curve: RestitutionCurve, height: float, times: Array) -> Array:
    """Height [m] at `times` of a fall from `height` and the bounces that follow."""
    speed = float(np.sqrt(2.0 * GRAVITY * height))
    begin, up, heights = speed / GRAVITY, 0.0, height - 0.5 * GRAVITY * times**2
    for _ in range(1000):
        speed *= float(curve.at(speed))
        since = times - begin
        up = speed * since - 0.5 * GRAVITY * since**2
        heights = np.where(since >= 0, np.maximum(up, 0.0), heights)
        begin += 2.0 * speed / GRAVITY
    return heights


def _motion_checks(
    name: str, case: str, run: Trajectory, velocities: Array, spins: Array
) -> Iterator[Check]:
    yield velocity_check(f'{name}, velocity', case, run, velocities, 5.0, EXACT)
    error = np.linalg.norm(run.angular_velocities[-1] - spins, axis=-1).max() / 5.0
    yield check(f'{name}, spin', case, error, 0, EXACT)
