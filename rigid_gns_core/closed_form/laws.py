# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mechanics of solid spheres in closed form: what any engine is checked against.

They follow from Newton's and Euler's equations with I = 2/5 m r^2, Newton's law of restitution,
Coulomb's law of friction, and a torque of rolling friction rho r N.

Notation: n unit normal, e restitution, mu friction, rho rolling friction (see `Scene`), J impulse.
"""

from __future__ import annotations

import numpy as np

from ..scenes.state import Array


def incline_acceleration(
    angle: float, friction: float, rolling_friction: float, gravity: float
) -> float:
    """Acceleration [m/s^2] of a sphere down an incline of `angle` [rad], released from rest.

    With the angle phi, it rolls at 5/7 g (sin phi - rho cos phi), or stays where that is negative;
    it slips at g (sin phi - mu cos phi) where rolling needs more friction than mu N.
    """
    sine, cosine = float(np.sin(angle)), float(np.cos(angle))
    rolls = max(0.0, gravity * (sine - rolling_friction * cosine) / 1.4)
    needed = gravity * sine - rolls  # what static friction has to supply
    return rolls if needed <= friction * gravity * cosine else gravity * (sine - friction * cosine)


def impact_on_surface(
    velocity: Array, spin: Array, normal: Array, radius: float, restitution: float, friction: float
) -> tuple[Array, Array]:
    """Velocity [m/s] and spin [rad/s] of a sphere after an impact on a surface, shapes (3,).

    J_n = (1 + e) m u, with the approach speed u; J_t = min(2/7 m slip, mu J_n) against the slip of
    the contact point: it sticks where the friction cone allows, and slides to the end otherwise.
    """
    push = -(1.0 + restitution) * float(velocity @ normal)  # J_n / m
    point = velocity + np.cross(spin, -radius * normal)
    slip = point - (point @ normal) * normal
    speed = float(np.linalg.norm(slip))
    grip = min(2.0 / 7.0 * speed, friction * push)
    along = -grip * slip / speed if speed > 0 else np.zeros(3)
    return velocity + push * normal + along, spin - 2.5 / radius * np.cross(normal, along)


def impact_of_spheres(
    velocities: Array,
    spins: Array,
    normal: Array,
    radii: Array,
    masses: Array,
    restitution: float,
    friction: float,
) -> tuple[Array, Array]:
    """Velocities [m/s] and spins [rad/s] of two spheres after they collide, shapes (2, 3).

    As `impact_on_surface`, with the reduced mass m_a m_b / (m_a + m_b).

    Args:
        velocities: Before, shape (2, 3).
        spins: Before, shape (2, 3).
        normal: Unit vector from the second to the first, shape (3,).
        radii: Radii [m], shape (2,).
        masses: Masses [kg], shape (2,).
        restitution: Of the pair.
        friction: Of the pair.
    """
    reduced = masses.prod() / masses.sum()
    points = velocities + np.cross(spins, np.outer([-radii[0], radii[1]], normal))
    relative = points[0] - points[1]
    approach = float(relative @ normal)
    slip = relative - approach * normal
    speed = float(np.linalg.norm(slip))
    push = -(1.0 + restitution) * reduced * approach
    grip = min(2.0 / 7.0 * reduced * speed, friction * push)
    impulse = push * normal - (grip * slip / speed if speed > 0 else 0.0)
    after = velocities + np.outer([1.0 / masses[0], -1.0 / masses[1]], impulse)
    # both spheres are turned the same way: lever and impulse change sign together
    turn = 2.5 * np.cross(-normal, impulse)
    turned: Array = np.asarray(spins + np.outer(1.0 / (masses * radii), turn), dtype=np.float64)
    return after, turned


def energy(
    positions: Array, velocities: Array, spins: Array, masses: Array, radii: Array, gravity: Array
) -> Array:
    """Total energy [J], shape (...), of spheres: arrays (..., n, 3), masses and radii (n,)."""
    kinetic = 0.5 * masses * np.sum(velocities**2, axis=-1)
    rotation = 0.2 * masses * radii**2 * np.sum(spins**2, axis=-1)
    total: Array = np.sum(kinetic + rotation - masses * (positions @ gravity), axis=-1)
    return total


def momenta(
    positions: Array, velocities: Array, spins: Array, masses: Array, radii: Array
) -> tuple[Array, Array]:
    """Linear [kg m/s] and angular momentum about the origin [kg m^2/s], shapes (..., 3)."""
    linear = masses[:, None] * velocities
    spin = (0.4 * masses * radii**2)[:, None] * spins
    orbital: Array = np.asarray(np.cross(positions, linear), dtype=np.float64)
    return linear.sum(-2), (orbital + spin).sum(-2)
