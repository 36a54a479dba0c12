# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy guard: in no frame does the energy of an island rise.

E = sum of m v^2 / 2 + I w^2 / 2 - m g . p. Restitution, friction and drag only take energy; a
solver that has not converged, and push-out, may add some. The guard acts after the solver, and
counts how often it did. Off the surfaces it keeps both momenta; on one:
v <- v sqrt(1 - dE / E_kin), and w.

Surfaces that move do work, which is counted where they push.

Wind may give energy. Drag opposes u = v - wind and lift is across it, so that the air's force F
gives at most F . v = F . u + F . wind <= |F| |wind|.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .islands import groups_of, Islands
from .spheres import Spheres
from .world import World
from ..kernels.flight import acceleration, flight_at
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import (
    add_to,
    cross,
    dot,
    length,
    minus,
    plus,
    put,
    row,
    solve_symmetric,
    times,
    Vector,
)
from ..scenes.state import Array

# gains below this share of the island's energy are rounding
ROUNDING = 1e-13


class _RigidMotion(NamedTuple):
    """An island as one body; angular momentum and inertia are about its centre of mass."""

    centre: Vector
    velocity: Vector
    momentum: Vector
    tensor: Array


@compiled
def _rigid_motion(world: World, spheres: Spheres, members: Indices) -> _RigidMotion:
    mass, centre, velocity = 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for i in members:
        own = 1.0 / world.inverse_mass[i]
        mass += own
        centre = plus(centre, times(own, row(spheres.positions, i)))
        velocity = plus(velocity, times(own, row(spheres.velocities, i)))
    centre, velocity = times(1.0 / mass, centre), times(1.0 / mass, velocity)
    momentum, tensor = (0.0, 0.0, 0.0), np.zeros((3, 3))
    for i in members:
        own, inertia = 1.0 / world.inverse_mass[i], 1.0 / world.inverse_inertia[i]
        arm = minus(row(spheres.positions, i), centre)
        swing = times(own, cross(arm, minus(row(spheres.velocities, i), velocity)))
        momentum = plus(momentum, plus(swing, times(inertia, row(spheres.angular_velocities, i))))
        square = dot(arm, arm)
        for p in range(3):
            tensor[p, p] += own * square + inertia
            for q in range(3):
                tensor[p, q] -= own * arm[p] * arm[q]
    return _RigidMotion(centre=centre, velocity=velocity, momentum=momentum, tensor=tensor)


@in_place
def energy_of(world: World, spheres: Spheres, i: int) -> tuple[float, float]:
    """Kinetic and potential energy of a sphere."""
    v, w = row(spheres.velocities, i), row(spheres.angular_velocities, i)
    mass, inertia = 1.0 / world.inverse_mass[i], 1.0 / world.inverse_inertia[i]
    potential = -mass * dot(row(spheres.positions, i), row(world.flight, i))
    return 0.5 * mass * dot(v, v) + 0.5 * inertia * dot(w, w), potential


@in_place
def _from_wind(world: World, before: Spheres, after: Spheres, i: int, dt: float) -> float:
    """Most energy that wind gives a sphere in a frame: m |a - g'| |wind| dt."""
    flight = flight_at(world.flight, i)
    force = 0.0
    for spheres in (before, after):
        v, w = row(spheres.velocities, i), row(spheres.angular_velocities, i)
        force = max(force, length(minus(acceleration(v, w, flight), flight.pull)))
    return force * length(flight.wind) * dt / world.inverse_mass[i]


@in_place
def gain_of(
    world: World, before: Spheres, after: Spheres, i: int, dt: float
) -> tuple[float, float, float]:
    """Kinetic energy of a sphere after a frame, what it gained, and the size of what changed.

    Without what wind may have given it.
    """
    kinetic, potential = energy_of(world, after, i)
    kinetic_before, potential_before = energy_of(world, before, i)
    gain = kinetic + potential - kinetic_before - potential_before
    if world.in_air:
        gain -= _from_wind(world, before, after, i, dt)
    return kinetic, gain, kinetic + kinetic_before + math.fabs(potential - potential_before)


@compiled
def limit_energy(
    world: World, before: Spheres, islands: Islands, dt: float, after_out: Spheres
) -> tuple[int, float]:
    """Limit the energy of each island to what it was.

    An island off the surfaces gets the linear and angular momentum of its ballistic flight (in air
    they stay as the substeps left them), and loses its excess of energy from internal motion,
    v - V - W x (p - P) of each sphere, so that both momenta stay. On a surface all speeds are
    reduced by one factor; where that is not enough, because the island was lifted, its positions
    are those before the frame.

    Args:
        world: What does not move.
        before: State at the start of the frame.
        islands: Islands of the frame's contacts.
        dt: Length of the frame.
        after_out: State at the end of the frame; corrected in place.

    Returns:
        Number of islands that were limited, and the energy taken from them.
    """
    nothing = np.zeros(len(after_out.positions))
    return limit_energy_beyond(world, before, islands, dt, nothing, after_out)


@compiled
def limit_energy_beyond(
    world: World,
    before: Spheres,
    islands: Islands,
    dt: float,
    allowance: Array,
    after_out: Spheres,
) -> tuple[int, float]:
    """As `limit_energy`, with energy that each sphere may gain, shape (n,)."""
    groups, after = groups_of(islands), after_out
    acted, removed = 0, 0.0
    for island in range(len(groups.grounded)):
        members = groups.members[groups.start[island] : groups.start[island + 1]]
        if not (groups.grounded[island] or world.in_air):
            _restore_momenta(world, before, members, dt, after)
        moving, gain, size = 0.0, 0.0, 0.0
        for i in members:
            kinetic, more, own = gain_of(world, before, after, i, dt)
            moving += kinetic
            gain += more - islands.work[i] - allowance[i]
            size += own
        if gain <= ROUNDING * size:
            continue
        acted += 1
        removed += gain
        if not groups.grounded[island]:
            _damp_internal_motion(world, members, gain, after)
            continue
        scale = math.sqrt(max(0.0, 1.0 - gain / max(moving, 1e-300)))
        for i in members:
            put(after.velocities, i, times(scale, row(after.velocities, i)))
            put(after.angular_velocities, i, times(scale, row(after.angular_velocities, i)))
            if gain > moving:
                put(after.positions, i, row(before.positions, i))
    return acted, removed


@compiled
def _restore_momenta(
    world: World, before: Spheres, members: Indices, dt: float, after_out: Spheres
) -> None:
    """Give a free island the momenta of its ballistic flight.

    With m and T its mass and tensor of inertia, P and S its momenta in flight (0) and now (1), r
    from its centre: v <- v + (P0 - P1) / m + t x r, w <- w + t, t = T^-1 (S0 - S1). Impulses at
    different times within a frame, and push-out, keep P, but change S by up to a few per cent of
    what they exchange.
    """
    was, is_now = _rigid_motion(world, before, members), _rigid_motion(world, after_out, members)
    turn = solve_symmetric(is_now.tensor, minus(was.momentum, is_now.momentum))
    fall = (dt * world.gravity[0], dt * world.gravity[1], dt * world.gravity[2])
    push = minus(plus(was.velocity, fall), is_now.velocity)
    for i in members:
        arm = minus(row(after_out.positions, i), is_now.centre)
        add_to(after_out.velocities, i, plus(push, cross(turn, arm)))
        add_to(after_out.angular_velocities, i, turn)


@compiled
def _damp_internal_motion(world: World, members: Indices, gain: float, after_out: Spheres) -> None:
    """Take the energy `gain` from internal motion: v_in <- v_in sqrt(1 - gain / E_in), and w."""
    after = after_out
    body = _rigid_motion(world, after, members)
    turn, internal = solve_symmetric(body.tensor, body.momentum), 0.0
    for i in members:
        v, w = _internal_velocity(after, body, turn, i)
        internal += 0.5 * dot(v, v) / world.inverse_mass[i]
        internal += 0.5 * dot(w, w) / world.inverse_inertia[i]
    keep = math.sqrt(max(0.0, 1.0 - gain / max(internal, 1e-300)))
    for i in members:
        v, w = _internal_velocity(after, body, turn, i)
        put(after.velocities, i, plus(row(after.velocities, i), times(keep - 1.0, v)))
        put(after.angular_velocities, i, plus(turn, times(keep, w)))


@in_place
def _internal_velocity(
    after: Spheres, body: _RigidMotion, turn: Vector, i: int
) -> tuple[Vector, Vector]:
    """Velocity and spin of a sphere beyond those of the rigid body."""
    arm = minus(row(after.positions, i), body.centre)
    rigid = plus(body.velocity, cross(turn, arm))
    return minus(row(after.velocities, i), rigid), minus(row(after.angular_velocities, i), turn)
