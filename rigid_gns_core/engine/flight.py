# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Free flight: p + v t + a_p t^2 / 2, v + a_v t; in a vacuum both are g, and spin stays.

In air (`kernels.flight`) a sphere has accelerations of its own, constant over a step: of the path,
on which times of impact are found, and of the velocity. Both lead to the end of its flight by the
law, and the parabola leaves its path by less than 1e-9 m within a step of 2 ms.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .spheres import Spheres
from .world import World
from ..kernels.flight import flight_at, mean_accelerations, spin_after
from ..kernels.jit import in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.quaternions import turn
from ..kernels.vector import dot, length, minus, plus, put, row, times, Vector
from ..scenes.state import Array


class Paths(NamedTuple):
    """Paths p + v t + a t^2 / 2 of all spheres over a step, shape (n, 3) each."""

    positions: Array
    velocities: Array
    accelerations: Array


@in_place
def position_on_path(start: Vector, velocity: Vector, acceleration: Vector, time: float) -> Vector:
    """Position after a time: p + t (v + a t / 2)."""
    return plus(start, times(time, plus(velocity, times(0.5 * time, acceleration))))


@in_place
def velocity_on_path(velocity: Vector, acceleration: Vector, time: float) -> Vector:
    """Velocity after a time: v + a t."""
    return plus(velocity, times(time, acceleration))


@in_place
def find_accelerations(
    world: World,
    velocities: Array,
    spins: Array,
    members: Indices,
    h: float,
    path_h: float,
    path_out: Array,
    mean_out: Array,
) -> None:
    """Accelerations in air of the path over a time `path_h`, and of the velocity over `h`.

    A step that ends at an event keeps the path on which the event was found.
    """
    for i in members:
        v, w, flight = row(velocities, i), row(spins, i), flight_at(world.flight, i)
        along, change = mean_accelerations(v, w, flight, path_h)
        if h != path_h:
            _, change = mean_accelerations(v, w, flight, h)
        put(path_out, i, along)
        put(mean_out, i, change)


@in_place
def slow_spins(world: World, members: Indices, h: float, spins_out: Array) -> None:
    """Let air slow spins down over a substep."""
    for i in members:
        put(spins_out, i, spin_after(row(spins_out, i), flight_at(world.flight, i), h))


@in_place
def fly_in_place(
    path: Array,
    mean: Array,
    awake: Flags,
    members: Indices,
    h: float,
    positions_out: Array,
    velocities_out: Array,
) -> None:
    """Flight of spheres over a substep; sleepers keep their velocity.

    Args:
        path: Accelerations of the paths, shape (n, 3).
        mean: Accelerations of the velocities, shape (n, 3).
        awake: Shape (n,).
        members: Which spheres.
        h: Length of the substep.
        positions_out: Shape (n, 3); those of the members are written.
        velocities_out: Shape (n, 3); likewise.
    """
    for i in members:
        for axis in range(3):
            bend, fall = h * path[i, axis], h * mean[i, axis]
            if not awake[i]:
                bend = fall = 0.0
            positions_out[i, axis] += h * (velocities_out[i, axis] + 0.5 * bend)
            velocities_out[i, axis] += fall


@in_place
def fly(
    world: World, before: Spheres, excluded: Flags, awake: Flags, time: float, spheres_out: Spheres
) -> None:
    """Free flight of all but the excluded; sleepers stay."""
    for i in range(len(excluded)):
        if not excluded[i]:
            fly_one(world, before, i, awake[i], time, spheres_out)


@in_place
def fly_one(
    world: World, before: Spheres, i: int, awake: bool, time: float, spheres_out: Spheres
) -> None:
    """Free flight of sphere i; a sleeper stays."""
    if world.in_air and awake:
        _fly_in_air(world, before, i, time, spheres_out)
        return
    for axis in range(3):
        fall, speed = time * world.gravity[axis], before.velocities[i, axis]
        displacement = time * (speed + 0.5 * fall)
        if not awake:
            displacement = fall = 0.0
        spheres_out.positions[i, axis] = before.positions[i, axis] + displacement
        spheres_out.velocities[i, axis] = speed + fall
    spin = row(before.angular_velocities, i)
    put(spheres_out.angular_velocities, i, spin)
    for part in range(4):
        spheres_out.quaternions[i, part] = before.quaternions[i, part]
    if dot(spin, spin) > 0:
        turn(spheres_out.quaternions, i, spin, time)


@in_place
def _fly_in_air(world: World, before: Spheres, i: int, time: float, spheres_out: Spheres) -> None:
    v, w, flight = (
        row(before.velocities, i),
        row(before.angular_velocities, i),
        flight_at(world.flight, i),
    )
    path, mean = mean_accelerations(v, w, flight, time)
    put(spheres_out.positions, i, position_on_path(row(before.positions, i), v, path, time))
    put(spheres_out.velocities, i, velocity_on_path(v, mean, time))
    put(spheres_out.angular_velocities, i, spin_after(w, flight, time))
    for part in range(4):
        spheres_out.quaternions[i, part] = before.quaternions[i, part]
    turn(spheres_out.quaternions, i, times(share_of_spin(flight.spin_decay, time), w), time)


@in_place
def share_of_spin(decay: float, time: float) -> float:
    """Mean of a spin that air slows down over a time, as a share of that at its start."""
    turned = decay * time
    return -math.expm1(-turned) / turned if turned > 0 else 1.0


@in_place
def reach_in_wind(world: World, i: int, velocity: Vector, gravity: float, dt: float) -> float:
    """How much farther than `reach_of` wind may carry a sphere in a frame; 0 where it is calm.

    Without wind air only takes energy. In wind the relative speed |u| grows by gravity alone, to
    at most U = |u| + g dt, so that air accelerates by at most q (C_d + a) U^2, and changes the
    velocity by at most |u| + U.
    """
    flight = flight_at(world.flight, i)
    if dot(flight.wind, flight.wind) == 0:
        return 0.0
    relative = length(minus(velocity, flight.wind))
    most, change = relative + gravity * dt, 2.0 * relative + gravity * dt
    if flight.drag_slope == 0:
        push = flight.load * (flight.drag + flight.lift) * most * most
        change = min(change, push * dt)
    return change * dt


@in_place
def reach_of(speed: float, gravity: float, dt: float) -> float:
    """How far a sphere may get in a frame, in any direction: v dt + g dt^2."""
    return speed * dt + gravity * dt**2
