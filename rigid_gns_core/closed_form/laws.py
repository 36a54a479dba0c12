# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Mechanics of spheres in closed form: what any engine is checked against.

They follow from Newton's and Euler's equations with I = i m r^2, i = 2/5 where nothing else is
said, Newton's law of restitution, Coulomb's law of friction, and a torque of rolling friction
rho r N. `air_laws` has those of flight, `resistance` those of rolling and spinning to rest.

Notation: n unit normal, e restitution, mu friction, rho rolling friction (see `Scene`), J impulse.
"""

from __future__ import annotations

from collections.abc import Sequence

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
    velocity: Array,
    spin: Array,
    normal: Array,
    radius: float,
    restitution: float,
    friction: float,
    inertia: float = 0.4,
    tangential_restitution: float = 0.0,
) -> tuple[Array, Array]:
    """Velocity [m/s] and spin [rad/s] of a sphere after an impact on a surface, shapes (3,).

    J_n = (1 + e) m u, with the approach speed u; J_t = min((1 + beta) i / (1 + i) m slip, mu J_n)
    against the slip of the contact point: it grips where the friction cone allows, and slides to
    the end otherwise. A solid sphere without beta: 2/7 m slip.
    """
    push = -(1.0 + restitution) * float(velocity @ normal)  # J_n / m
    point = velocity + np.cross(spin, -radius * normal)
    slip = point - (point @ normal) * normal
    speed = float(np.linalg.norm(slip))
    held = (1.0 + tangential_restitution) * inertia / (1.0 + inertia)
    grip = min(held * speed, friction * push)
    along = -grip * slip / speed if speed > 0 else np.zeros(3)
    return velocity + push * normal + along, spin - np.cross(normal, along) / (inertia * radius)


def impact_of_spheres(
    velocities: Array,
    spins: Array,
    normal: Array,
    radii: Array,
    masses: Array,
    restitution: float,
    friction: float,
    inertia: float = 0.4,
    tangential_restitution: float = 0.0,
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
        inertia: i of both.
        tangential_restitution: beta of the pair.
    """
    reduced = masses.prod() / masses.sum()
    points = velocities + np.cross(spins, np.outer([-radii[0], radii[1]], normal))
    relative = points[0] - points[1]
    approach = float(relative @ normal)
    slip = relative - approach * normal
    speed = float(np.linalg.norm(slip))
    push = -(1.0 + restitution) * reduced * approach
    held = (1.0 + tangential_restitution) * inertia / (1.0 + inertia)
    grip = min(held * reduced * speed, friction * push)
    impulse = push * normal - (grip * slip / speed if speed > 0 else 0.0)
    after = velocities + np.outer([1.0 / masses[0], -1.0 / masses[1]], impulse)
    # both spheres are turned the same way: lever and impulse change sign together
    turn = np.cross(-normal, impulse) / inertia
    turned: Array = np.asarray(spins + np.outer(1.0 / (masses * radii), turn), dtype=np.float64)
    return after, turned


def simultaneous_impacts(
    velocities: Array,
    masses: Array,
    contacts: Sequence[tuple[int, int | None, Array]],
    restitution: float,
) -> Array:
    """Velocities [m/s] after frictionless impacts at one moment, shape (n, 3).

    Newton's law at each contact, n . w' = -e n . w with w the relative velocity, by impulses that
    act together: (N M^-1 N^T) J = -(1 + e) N v.

    Args:
        velocities: Before, shape (n, 3).
        masses: Masses [kg], shape (n,).
        contacts: Sphere, the other sphere or None for a surface, and unit normal towards the first
            [shape (3,)]; all of which push.
        restitution: Of all contacts.
    """
    rows = np.zeros((len(contacts), *velocities.shape))
    for row, (one, other, normal) in zip(rows, contacts, strict=True):
        row[one] = normal
        if other is not None:
            row[other] = -normal
    flat = rows.reshape(len(contacts), -1)
    moved = (rows / masses[:, None]).reshape(len(contacts), -1)
    impulses = np.linalg.solve(flat @ moved.T, -(1.0 + restitution) * flat @ velocities.ravel())
    after: Array = velocities + (impulses @ moved).reshape(velocities.shape)
    return after


def slide_to_roll(
    speed: float,
    surface_speed: float,
    friction: float,
    gravity: float,
    time: float,
    inertia: float = 0.4,
) -> float:
    """Speed [m/s] on a level floor after `time` [s], from a speed and r times the spin.

    Friction takes mu g from the speed along the slip, which shrinks by (1 + 1 / i) mu g; from
    where it is 0 the sphere rolls, at (v + i r w) / (1 + i).
    """
    slip = speed - surface_speed
    if abs(slip) <= (1.0 + 1.0 / inertia) * friction * gravity * time:
        return (speed + inertia * surface_speed) / (1.0 + inertia)
    return speed - float(np.sign(slip)) * friction * gravity * time


def speed_over_edge(
    speed: float, start: float, angle: Array, radius: float, inertia: float, gravity: float
) -> Array:
    """Speed [m/s] of a centre on a circle around an edge or a fixed sphere.

    Energy: (1 + i) v^2 / 2 + g l cos theta is constant, with i = I / (m r^2) where it rolls
    without slip, 0 where it slides without friction.

    Args:
        speed: At the angle `start`.
        start: Angle from the vertical [rad].
        angle: Angles at which to know it [rad].
        radius: l of the circle: r of the sphere at an edge, R + r on a fixed sphere.
        inertia: i, or 0 where it slides.
        gravity: [m/s^2].
    """
    gained = 2.0 * gravity * radius * (np.cos(start) - np.cos(angle)) / (1.0 + inertia)
    reached: Array = np.sqrt(speed**2 + gained)
    return reached


def leaving_angle(
    speed: float, start: float, radius: float, inertia: float, gravity: float
) -> float:
    """Angle [rad] where a sphere leaves the circle of `speed_over_edge`: v^2 = g l cos theta.

    From rest on top: cos theta = 10/17 where it rolls, 2/3 where it slides.
    """
    share = 2.0 / (1.0 + inertia)
    cosine = (speed**2 / (gravity * radius) + share * np.cos(start)) / (1.0 + share)
    return float(np.arccos(cosine))


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
