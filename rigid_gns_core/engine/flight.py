# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Free flight under gravity: p + v t + g t^2 / 2, v + g t; spin stays.

Two places besides assume this law: times of impact (`contacts.py`), where pairs of spheres
approach on straight relative paths since both fall alike, and the guard, which knows the momenta
of a flight.
"""

from __future__ import annotations

from .spheres import Spheres
from .world import World
from ..kernels.jit import in_place
from ..kernels.neighbours import Flags
from ..kernels.quaternions import turn
from ..kernels.vector import dot, plus, put, row, times, Vector
from ..scenes.state import Array


@in_place
def position_on_path(start: Vector, velocity: Vector, acceleration: Vector, time: float) -> Vector:
    """Position after a time: p + t (v + a t / 2)."""
    return plus(start, times(time, plus(velocity, times(0.5 * time, acceleration))))


@in_place
def velocity_on_path(velocity: Vector, acceleration: Vector, time: float) -> Vector:
    """Velocity after a time: v + a t."""
    return plus(velocity, times(time, acceleration))


@in_place
def fly_in_place(
    world: World, awake: Flags, h: float, positions_out: Array, velocities_out: Array
) -> None:
    """Flight of all spheres over a substep; sleepers keep their velocity."""
    for i in range(len(positions_out)):
        for axis in range(3):
            fall = h * world.gravity[axis] if awake[i] else 0.0
            positions_out[i, axis] += h * (velocities_out[i, axis] + 0.5 * fall)
            velocities_out[i, axis] += fall


@in_place
def fly(
    world: World, before: Spheres, excluded: Flags, awake: Flags, time: float, spheres_out: Spheres
) -> None:
    """Free flight of all but the excluded: p + v t + g t^2 / 2, v + g t; sleepers stay."""
    for i in range(len(excluded)):
        if excluded[i]:
            continue
        for axis in range(3):
            fall, speed = time * world.gravity[axis], before.velocities[i, axis]
            displacement = time * (speed + 0.5 * fall)
            if not awake[i]:
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
def reach_of(speed: float, gravity: float, dt: float) -> float:
    """How far a sphere may get in a frame, in any direction: v dt + g dt^2."""
    return speed * dt + gravity * dt**2
