# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Impulses at contacts, and what they make of the bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contacts import Contacts
from .law import Law
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import across, add_to, cross, dot, minus, plus, put, row, times, Vector
from ..scenes.state import Array


class Impulses(NamedTuple):
    """Impulses on body a of each contact; body b gets the opposite.

    normal: along the normal, at least 0, shape (c,); tangential: across it, friction, shape
    (c, 3); rolling: angular impulse of rolling friction, zero between spheres, shape (c, 3).
    """

    normal: Array
    tangential: Array
    rolling: Array


class Bodies(NamedTuple):
    """Moving bodies in a substep, and the fixed one last.

    velocity: free of contacts, at the end of the substep; before: at its start; spin: angular
    velocity; change, turn: what impulses add to velocity and spin; moved: displacement beyond that
    of free flight; shape (n + 1, 3) each. load: contacts that press, weighed, and
    most: the strongest of them, shape (n + 1,).
    """

    velocity: Array
    before: Array
    spin: Array
    change: Array
    turn: Array
    moved: Array
    load: Array
    most: Array


@compiled
def no_impulses(count: int) -> Impulses:
    """Zeros."""
    return Impulses(np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3)))


@in_place
def push(world: World, c: Contacts, bodies: Bodies, k: int, impulse: Vector) -> None:
    """Apply an impulse at contact k to velocities."""
    a, b = c.a[k], c.b[k]
    add_to(bodies.change, a, times(world.inverse_mass[a], impulse))
    add_to(bodies.change, b, times(-world.inverse_mass[b], impulse))


@in_place
def spin(world: World, c: Contacts, law: Law, bodies: Bodies, k: int, impulse: Vector) -> None:
    """Apply the same impulse to angular velocities."""
    a, b = c.a[k], c.b[k]
    torque = cross(row(c.normal, k), impulse)
    add_to(bodies.turn, a, times(-law.arm_a[k] * world.inverse_inertia[a], torque))
    add_to(bodies.turn, b, times(-law.arm_b[k] * world.inverse_inertia[b], torque))


@in_place
def slip_of(
    c: Contacts, law: Law, k: int, one: Vector, other: Vector, w: Vector, u: Vector
) -> Vector:
    """Velocity of two surfaces against each other, of velocities and spins of a and b."""
    normal = row(c.normal, k)
    turning = plus(times(law.arm_a[k], w), times(law.arm_b[k], u))
    return minus(across(minus(one, other), normal), cross(turning, normal))


@in_place
def slip_now(c: Contacts, law: Law, bodies: Bodies, k: int) -> Vector:
    """Return the same with the impulses so far."""
    a, b = c.a[k], c.b[k]
    return slip_of(
        c,
        law,
        k,
        plus(row(bodies.velocity, a), row(bodies.change, a)),
        plus(row(bodies.velocity, b), row(bodies.change, b)),
        plus(row(bodies.spin, a), row(bodies.turn, a)),
        plus(row(bodies.spin, b), row(bodies.turn, b)),
    )


@in_place
def parting_of(c: Contacts, bodies: Bodies, k: int) -> float:
    """Return the normal velocity with the impulses so far."""
    a, b = c.a[k], c.b[k]
    free = minus(row(bodies.velocity, a), row(bodies.velocity, b))
    return dot(row(c.normal, k), plus(free, minus(row(bodies.change, a), row(bodies.change, b))))


@in_place
def begin(
    world: World, c: Contacts, law: Law, group: Indices, given: Impulses, bodies: Bodies,
    made: Impulses,
) -> None:  # fmt: skip
    """Take `given` as the impulses so far."""
    for k in group:
        for body in (c.a[k], c.b[k]):
            put(bodies.change, body, (0.0, 0.0, 0.0))
            put(bodies.turn, body, (0.0, 0.0, 0.0))
    for k in group:
        normal = row(c.normal, k)
        tangential = across(row(given.tangential, k), normal)
        made.normal[k] = given.normal[k]
        put(made.tangential, k, tangential)
        put(made.rolling, k, row(given.rolling, k))
        push(world, c, bodies, k, plus(times(given.normal[k], normal), tangential))
        spin(world, c, law, bodies, k, tangential)
        a = c.a[k]
        add_to(bodies.turn, a, times(world.inverse_inertia[a], row(given.rolling, k)))
