# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Air around the spheres: drag, lift by spin, buoyancy, added mass, wind and spin decay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .plane import checked_vector, Vector
from .state import Array
from .values import checked_number
from ..errors import UserError

_AT_LEAST_ZERO = (
    'density', 'drag_coefficient', 'drag_slope', 'drag_drop', 'lift_coefficient', 'spin_decay',
)  # fmt: skip


@dataclass(frozen=True)
class Air:
    """Air, or another fluid of uniform density and wind, around rigid spheres.

    With u = v - wind, V = 4/3 pi r^3, A = pi r^2 and S = r |w across u| / |u|, the spin ratio::

        (m + rho V / 2) dv/dt = (m - rho V) g - rho A / 2 C_d |u| u
                                + rho A / 2 C_l |u|^2 (w x u) / |w x u|
        dw/dt = -c w,    C_l = a S / (S + b)
        C_d = C_d0 + k S - d f,    f = (|u| / u_c)^8 / (1 + (|u| / u_c)^8)

    The terms are buoyancy and added mass, drag, and lift (Magnus effect). The form of C_l, drag
    that grows with S, and how it falls at the drag crisis, are empirical; docs/flight.md has
    values for real balls.

    Args:
        density: rho [kg/m^3]. Buoyancy and added mass follow from it.
        drag_coefficient: C_d0, of a sphere that does not spin.
        drag_slope: k, by how much C_d grows per unit of S.
        lift_coefficient: a, which C_l approaches at high spin; 0: no lift.
        lift_half_ratio: b, the spin ratio at which C_l is half of that.
        wind: Velocity of the air [m/s], world frame.
        spin_decay: c [1/s], the rate at which spin decays.
        drag_drop: d, by how much C_d falls at the drag crisis, at most C_d0; 0: there is none.
        crisis_speed: u_c [m/s], at which half of it has gone.

    Raises:
        UserError: A value is out of range.
    """

    density: float = 1.2
    drag_coefficient: float = 0.45
    drag_slope: float = 0.0
    lift_coefficient: float = 0.0
    lift_half_ratio: float = 0.25
    wind: Vector = (0.0, 0.0, 0.0)
    spin_decay: float = 0.0
    drag_drop: float = 0.0
    crisis_speed: float = 10.0

    def __post_init__(self) -> None:
        for name in (*_AT_LEAST_ZERO, 'lift_half_ratio', 'crisis_speed'):
            above = name not in _AT_LEAST_ZERO
            value = checked_number(f'{name} of the air', getattr(self, name), above=above)
            object.__setattr__(self, name, value)
        if self.drag_drop > self.drag_coefficient:
            raise UserError(
                f'drag_drop of the air is {self.drag_drop:g}, expected at most its '
                f'drag_coefficient, {self.drag_coefficient:g}'
            )
        object.__setattr__(self, 'wind', checked_vector('wind', self.wind))

    def displaced_mass(self, radius: ArrayLike) -> Array:
        """Mass of the air that spheres displace, rho V [kg], shape of `radius`."""
        return self.density * 4.0 / 3.0 * np.pi * np.asarray(radius, np.float64) ** 3

    def effective_mass(self, radius: ArrayLike, mass: ArrayLike) -> Array:
        """Mass with added mass, m + rho V / 2 [kg], shape of `mass`."""
        return np.asarray(mass) + 0.5 * self.displaced_mass(radius)

    def flight(self, radius: ArrayLike, mass: ArrayLike, gravity: ArrayLike) -> Array:
        """Parameters of the flight of spheres, as `kernels.flight` takes them.

        Args:
            radius: r [m], shape (n,).
            mass: m [kg], shape (n,).
            gravity: g [m/s^2], shape (3,).

        Returns:
            Shape (n, 15): acceleration by weight and buoyancy, wind, rho A / 2 (m + rho V / 2),
            r, C_d0, k, a, b, c, d, 1 / u_c^2.
        """
        radius, mass = np.asarray(radius, np.float64), np.asarray(mass, np.float64)
        effective = self.effective_mass(radius, mass)
        weight = (mass - self.displaced_mass(radius)) / effective
        shared = (
            self.drag_coefficient,
            self.drag_slope,
            self.lift_coefficient,
            self.lift_half_ratio,
            self.spin_decay,
            self.drag_drop,
            self.crisis_speed**-2,
        )
        return np.column_stack(
            [
                weight[:, None] * np.asarray(gravity, np.float64),
                np.tile(self.wind, (len(radius), 1)),
                0.5 * self.density * np.pi * radius**2 / effective,
                radius,
                np.tile(shared, (len(radius), 1)),
            ]
        )
