# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Checks of what stops spheres on a floor: sliding to rolling, rolling and spinning to rest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from . import laws
from .bounces import GRAVITY, Simulate
from .check import Check, check
from .runs import NEAR, simulated
from ..scenes.contact_law import ContactLaw
from ..scenes.plane import Plane
from ..scenes.state import Array, Trajectory

_SHELL = 2.0 / 3.0


def resistance_checks(simulate: Simulate, quick: bool) -> Iterator[Check]:
    """Solid and hollow spheres with the resistances of a contact law."""
    for inertia in (_SHELL,) if quick else (0.4, _SHELL):
        case = f'i {inertia:.2g}'
        law = ContactLaw(friction=0.2)
        run = _on_floor(simulate, law, inertia, 4.0, -2.0, seconds=3.0)
        path = [laws.slide_to_roll(4.0, -2.0, 0.2, GRAVITY, t, inertia) for t in run.times]
        error = np.abs(run.velocities[:, 0, 0] - path).max() / 4.0
        yield check('sliding to rolling, speed', case, error, 0, NEAR)

        for rho, slope in ((0.02, 0.0), (0.02, 0.01), (0.0, 0.03)):
            law = ContactLaw(rolling_friction=rho, rolling_friction_slope=slope)
            run = _on_floor(simulate, law, inertia, 2.0, 2.0, seconds=8.0)
            expected = rolling_speed(2.0, rho, slope, inertia, run.times)
            error = np.abs(run.velocities[:, 0, 0] - expected).max() / 2.0
            kind = f'{case}, rho {rho:g} + {slope:g} v'
            yield check('rolling to rest, speed', kind, error, 0, NEAR)

        for sigma in (0.05,) if quick else (0.05, 0.3):
            law = ContactLaw(spinning_friction=sigma)
            run = _on_floor(simulate, law, inertia, 0.0, 0.0, spin=6.0, seconds=10.0)
            expected = np.maximum(6.0 - sigma * GRAVITY / inertia * run.times, 0.0)
            error = np.abs(run.angular_velocities[:, 0, 2] - expected).max() / 6.0
            yield check('spinning to rest', f'{case}, sigma {sigma:g}', error, 0, NEAR)


def rolling_speed(speed: float, rho: float, slope: float, inertia: float, times: Array) -> Array:
    """Speed [m/s] of a sphere of 1 m that rolls to rest: dv/dt = -(rho + rho' v) g / (1 + i).

    v = (v0 + rho / rho') exp(-rho' g t / (1 + i)) - rho / rho', until that is 0.
    """
    brake = GRAVITY / (1.0 + inertia)
    if slope == 0:
        return np.maximum(speed - rho * brake * times, 0.0)
    left = (speed + rho / slope) * np.exp(-slope * brake * times) - rho / slope
    return np.maximum(left, 0.0)


def _on_floor(
    simulate: Simulate,
    law: ContactLaw,
    inertia: float,
    speed: float,
    surface_speed: float,
    *,
    seconds: float,
    spin: float = 0.0,
) -> Trajectory:
    """Motion along x from a speed, r times the spin that rolls, and a spin about the normal."""
    return simulated(
        simulate,
        (Plane(contact=law),),
        [(0.0, 0.0, 1.0)],
        [(speed, 0.0, 0.0)],
        [(0.0, surface_speed, spin)],
        seconds=seconds,
        inertia_factor=inertia,
    )
