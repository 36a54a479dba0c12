# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flights in air in closed form, for any sphere of radius r and mass m.

q = rho A / 2 (m + rho V / 2), the load of the air on the mass with added mass; see `Air`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scenes.air import Air
from ..scenes.state import Array


@dataclass(frozen=True)
class Sphere:
    """A sphere in air: what its flights need.

    Args:
        air: The air; without wind.
        radius: [m].
        mass: [kg].
        gravity: Downwards [m/s^2].
    """

    air: Air
    radius: float
    mass: float
    gravity: float

    @property
    def load(self) -> float:
        """Drag and lift per unit of their coefficient and squared speed, q [1/m]."""
        area, rho = np.pi * self.radius**2, self.air.density
        return float(0.5 * rho * area / (self.mass + 0.5 * rho * self._volume))

    @property
    def pull(self) -> float:
        """Acceleration from rest [m/s^2], g (m - rho V) / (m + rho V / 2)."""
        displaced = self.air.density * self._volume
        return self.gravity * (self.mass - displaced) / (self.mass + 0.5 * displaced)

    @property
    def terminal_speed(self) -> float:
        """Speed of fall at which drag holds the weight [m/s]: q C_d v^2 = g'."""
        return float(np.sqrt(self.pull / (self.load * self.air.drag_coefficient)))

    @property
    def _volume(self) -> float:
        return 4.0 / 3.0 * np.pi * self.radius**3


def fall(sphere: Sphere, times: Array) -> tuple[Array, Array]:
    """Depth [m] and speed [m/s] of a fall from rest: v = v_t tanh(g' t / v_t)."""
    end, pull = sphere.terminal_speed, sphere.pull
    depth: Array = end**2 / pull * np.log(np.cosh(pull * times / end))
    return depth, end * np.tanh(pull * times / end)


def rise(sphere: Sphere, speed: float) -> tuple[float, float]:
    """Height [m] and time [s] to the top of a throw: v_t^2 / 2 g' log(1 + v^2 / v_t^2)."""
    end, pull = sphere.terminal_speed, sphere.pull
    height = 0.5 * end**2 / pull * np.log1p((speed / end) ** 2)
    return float(height), float(end / pull * np.arctan(speed / end))


def bouncing_height(sphere: Sphere, height: float, restitution: float, time: float) -> float:
    """Height [m] of the lowest point of a sphere dropped from `height`, which bounces, at `time`.

    From the top it falls as `fall`; upwards from its speed v: v_t tan(phi - g' t / v_t),
    tan phi = v / v_t.
    """
    end, pull = sphere.terminal_speed, sphere.pull
    while height > 1e-12:
        # log cosh x = pull height / end^2
        falls = float(end / pull * np.arccosh(np.exp(pull * height / end**2)))
        if time <= falls:
            return height - float(fall(sphere, np.array(time))[0])
        time -= falls
        speed = restitution * float(fall(sphere, np.array(falls))[1])
        height, rises = rise(sphere, speed)
        if time <= rises:
            return height - float(end**2 / pull * -np.log(np.cos(pull * (rises - time) / end)))
        time -= rises
    return 0.0  # all bounces of a geometric series are over


def slowed(sphere: Sphere, speed: float, spin: float, times: Array) -> tuple[Array, Array]:
    """Way [m] and speed [m/s] along a line, without gravity and lift, spinning across it.

    dv/dt = -q (C_d0 v^2 + k r w v): v = v0 / (1 + q C_d0 v0 t) without spin, and else
    v = B v0 E / (B + C_d0 v0 (1 - E)), with B = k r w and E = exp(-q B t).
    """
    q, drag = sphere.load, sphere.air.drag_coefficient
    twist = sphere.air.drag_slope * sphere.radius * spin
    if twist == 0:
        slower = 1.0 + q * drag * speed * times
        return np.log(slower) / (q * drag), speed / slower
    lost = -np.expm1(-q * twist * times)
    left = twist * speed * (1.0 - lost) / (twist + drag * speed * lost)
    return np.log1p(drag * speed * lost / twist) / (q * drag), left


def turned(sphere: Sphere, speed: float, spin: float, times: Array) -> tuple[Array, Array]:
    """Ways [m] along and across a start without gravity and drag: a circle of 1 / (q C_l).

    The spin is across the path. C_l = a S / (S + b), S = r w / v.
    """
    ratio = sphere.radius * spin / speed
    lift = sphere.air.lift_coefficient * ratio / (ratio + sphere.air.lift_half_ratio)
    circle = 1.0 / (sphere.load * lift)
    angle = speed * times / circle
    return circle * np.sin(angle), circle * (1.0 - np.cos(angle))
