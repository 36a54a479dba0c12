# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact laws of pairs: restitution, friction, grip, and resistance to rolling and spinning."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from .state import Array
from .values import checked_number
from ..errors import shown, UserError


@dataclass(frozen=True)
class RestitutionCurve:
    """Restitution that changes with the approach speed u from one value to another.

        e(u) = e_fast + (e_slow - e_fast) u_0 / (u_0 + u)

    Empirical. For instance cushions of a billiard table give back more, and metals that yield
    less, at higher speed.

    Args:
        slow: e_slow, 0 to 1, which it approaches at low speed.
        fast: e_fast, 0 to 1, which it approaches at high speed.
        speed: u_0 [m/s], at which it is the mean of both.

    Raises:
        UserError: A value is out of range.
    """

    slow: float
    fast: float
    speed: float

    def __post_init__(self) -> None:
        for name in ('slow', 'fast'):
            value = checked_number(f'{name} of a restitution curve', getattr(self, name), high=1.0)
            object.__setattr__(self, name, value)
        speed = checked_number('speed of a restitution curve', self.speed, above=True)
        object.__setattr__(self, 'speed', speed)

    def at(self, speed: ArrayLike) -> Array:
        """Restitution at approach speeds [m/s], of their shape."""
        share = self.speed / (self.speed + np.asarray(speed, dtype=np.float64))
        return np.asarray(self.fast + (self.slow - self.fast) * share)


# name: (lowest, highest)
_RANGES = {
    'friction': (0.0, np.inf),
    'tangential_restitution': (-1.0, 1.0),
    'rolling_friction': (0.0, np.inf),
    'rolling_friction_slope': (0.0, np.inf),
    'spinning_friction': (0.0, np.inf),
}


@dataclass(frozen=True)
class ContactLaw:
    """Law of the contacts of a pair: a surface and spheres, or two spheres. It holds as it stands.

    With the normal impulse J_n = (1 + e) m u of a blow at approach speed u, and the slip s of the
    contact point, m and m_t the effective masses along and across the normal n::

        J_t = min((1 + beta) m_t |s|, mu J_n) against s

    so that a contact that grips turns its slip into -beta s, and one that slides obeys Coulomb's
    law: the model of three parameters e, mu, beta of Walton. On a sphere of radius r with normal
    force N, that rolls at speed v, the surface exerts the torques::

        (rho + rho' v) r N against rolling, and sigma r N against spinning about the normal.

    Args:
        restitution: e, 0 to 1; a number, or a `RestitutionCurve` over the approach speed.
        friction: mu, Coulomb's coefficient.
        tangential_restitution: beta, -1 (smooth) to 1; 0: a contact that grips stops its slip.
        rolling_friction: rho; a sphere that rolls slows by rho g / (1 + i), i the inertia factor.
        rolling_friction_slope: rho' [s/m].
        spinning_friction: sigma; a sphere that spins on the spot slows by sigma g / (i r).

    Raises:
        UserError: A value is out of range.
    """

    restitution: float | RestitutionCurve = 0.6
    friction: float = 0.5
    tangential_restitution: float = 0.0
    rolling_friction: float = 0.0
    rolling_friction_slope: float = 0.0
    spinning_friction: float = 0.0

    def __post_init__(self) -> None:
        where = 'of a contact law'
        if not isinstance(self.restitution, RestitutionCurve):
            value = checked_number(f'restitution {where}', self.restitution, high=1.0)
            object.__setattr__(self, 'restitution', value)
        for name, (low, high) in _RANGES.items():
            value = checked_number(f'{name} {where}', getattr(self, name), low, high)
            object.__setattr__(self, name, value)

    @property
    def curve(self) -> RestitutionCurve:
        """Restitution as a curve, level where it is a number."""
        if isinstance(self.restitution, RestitutionCurve):
            return self.restitution
        return RestitutionCurve(self.restitution, self.restitution, 1.0)

    def scaled(self, speed: float) -> ContactLaw:
        """Law in units in which a speed of 1 m/s is `speed`."""
        restitution = self.restitution
        if isinstance(restitution, RestitutionCurve):
            restitution = replace(restitution, speed=restitution.speed * speed)
        slope = self.rolling_friction_slope / speed
        return replace(self, restitution=restitution, rolling_friction_slope=slope)


def checked_law(name: str, value: object) -> ContactLaw | None:
    """Contact law or None; UserError for anything else."""
    if value is not None and not isinstance(value, ContactLaw):
        raise UserError(f'{name} is {shown(value)}, expected ContactLaw(...), or None')
    return value
