# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impulses at contacts, and how they change the motion of the bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contact_law import Law
from .contacts import Contacts
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import across, add_to, cross, dot, minus, plus, put, row, times, Vector
from ..scenes.state import Array


class Impulses(NamedTuple):
    """Impulses on body a of each contact; body b gets the opposite ones.

    normal: along the normal, at least 0, shape (c,); tangential: across it, friction, shape
    (c, 3); rolling: angular impulse of rolling friction, zero between spheres, shape (c, 3).
    """

    normal: Array
    tangential: Array
    rolling: Array


class Bodies(NamedTuple):
    """Moving bodies in a substep, and the fixed one last.

    free_velocity, free_angular_velocity: at the end of the substep, without contacts; velocity,
    angular_velocity: with the impulses so far; displacement: by them, beyond that of free
    flight; shape (n + 1, 3) each. strongest: force of the strongest active contact of each body,
    as a speed, shape (n + 1,).
    """

    free_velocity: Array
    free_angular_velocity: Array
    velocity: Array
    angular_velocity: Array
    displacement: Array
    strongest: Array


@compiled
def no_impulses(count: int) -> Impulses:
    """Impulses of so many contacts, all zero."""
    return Impulses(
        normal=np.zeros(count), tangential=np.zeros((count, 3)), rolling=np.zeros((count, 3))
    )


@in_place
def impulses_among(impulses: Impulses, first: int, last: int) -> Impulses:
    """View of the impulses of some contacts in a row."""
    return Impulses(
        normal=impulses.normal[first:last],
        tangential=impulses.tangential[first:last],
        rolling=impulses.rolling[first:last],
    )


@in_place
def copy_impulse(impulses: Impulses, i: int, target_out: Impulses, k: int) -> None:
    """Copy the impulses of contact i to contact k of others."""
    target_out.normal[k] = impulses.normal[i]
    put(target_out.tangential, k, row(impulses.tangential, i))
    put(target_out.rolling, k, row(impulses.rolling, i))


@in_place
def copy_impulses(impulses: Impulses, pairs: Indices, target_out: Impulses) -> None:
    """Copy the impulses of some contacts; without a normal one there are no others."""
    for k in pairs:
        if impulses.normal[k] != 0 or target_out.normal[k] != 0:
            copy_impulse(impulses, k, target_out, k)


@in_place
def copy_impulses_where(
    impulses: Impulses, pairs: Indices, sphere: Indices, label: Indices, target_out: Impulses
) -> None:
    """The same of pairs whose sphere, by their indices, has a label of 0 or more."""
    for k in pairs:
        if label[sphere[k]] >= 0 and (impulses.normal[k] != 0 or target_out.normal[k] != 0):
            copy_impulse(impulses, k, target_out, k)


@in_place
def keep_impulses(pairs: Indices, kept: Flags, impulses_out: Impulses) -> None:
    """Take away the impulses of some contacts but those that are kept, which are overwritten."""
    for k in pairs:
        if impulses_out.normal[k] != 0 and not kept[k]:
            impulses_out.normal[k] = 0.0
            put(impulses_out.tangential, k, (0.0, 0.0, 0.0))
            put(impulses_out.rolling, k, (0.0, 0.0, 0.0))


@in_place
def clear_impulses(pairs: Indices, impulses_out: Impulses) -> None:
    """Take away the impulses of some contacts."""
    for k in pairs:
        if impulses_out.normal[k] != 0:
            impulses_out.normal[k] = 0.0
            put(impulses_out.tangential, k, (0.0, 0.0, 0.0))
            put(impulses_out.rolling, k, (0.0, 0.0, 0.0))


@in_place
def scale_impulses(factor: float, pairs: Indices, impulses_out: Impulses) -> None:
    """Impulses of forces that last, for a step of another length."""
    for k in pairs:
        impulses_out.normal[k] *= factor
        put(impulses_out.tangential, k, times(factor, row(impulses_out.tangential, k)))
        put(impulses_out.rolling, k, times(factor, row(impulses_out.rolling, k)))


@in_place
def apply_linear(
    world: World, contacts: Contacts, bodies_out: Bodies, k: int, impulse: Vector
) -> None:
    """Apply an impulse J at contact k to velocities: v_a += J / m_a, v_b -= J / m_b."""
    a, b = contacts.a[k], contacts.b[k]
    add_to(bodies_out.velocity, a, times(world.inverse_mass[a], impulse))
    add_to(bodies_out.velocity, b, times(-world.inverse_mass[b], impulse))


@in_place
def apply_angular(
    world: World, contacts: Contacts, law: Law, bodies_out: Bodies, k: int, impulse: Vector
) -> None:
    """Apply the torque of an impulse J at contact k: w -= l n x J / I, for both bodies."""
    a, b = contacts.a[k], contacts.b[k]
    torque = cross(row(contacts.normal, k), impulse)
    add_to(bodies_out.angular_velocity, a, times(-law.arm_a[k] * world.inverse_inertia[a], torque))
    add_to(bodies_out.angular_velocity, b, times(-law.arm_b[k] * world.inverse_inertia[b], torque))


@in_place
def slip_velocity(contacts: Contacts, law: Law, bodies: Bodies, k: int) -> Vector:
    """Tangential velocity of surface a on surface b with the impulses so far.

    u = (v_a - v_b) across n - (l_a w_a + l_b w_b) x n, l from the centre to the contact point.
    """
    a, b, normal = contacts.a[k], contacts.b[k], row(contacts.normal, k)
    turning = plus(
        times(law.arm_a[k], row(bodies.angular_velocity, a)),
        times(law.arm_b[k], row(bodies.angular_velocity, b)),
    )
    moving = minus(row(bodies.velocity, a), row(bodies.velocity, b))
    return minus(across(moving, normal), cross(turning, normal))


@in_place
def free_slip(contacts: Contacts, law: Law, bodies: Bodies, k: int) -> Vector:
    """Slip as of `slip_velocity`, but of the free motion."""
    a, b, normal = contacts.a[k], contacts.b[k], row(contacts.normal, k)
    moving = minus(row(bodies.free_velocity, a), row(bodies.free_velocity, b))
    turning = plus(
        times(law.arm_a[k], row(bodies.free_angular_velocity, a)),
        times(law.arm_b[k], row(bodies.free_angular_velocity, b)),
    )
    return minus(across(moving, normal), cross(turning, normal))


@in_place
def separation_velocity(contacts: Contacts, bodies: Bodies, k: int) -> float:
    """Rate at which the gap opens at the end of the substep, with the impulses so far.

    n . (v_a - v_b), and what the turn of the normal until then adds.
    """
    a, b = contacts.a[k], contacts.b[k]
    moving = minus(row(bodies.velocity, a), row(bodies.velocity, b))
    return dot(row(contacts.normal, k), moving) + contacts.turning_speed[k]


@in_place
def start_from(
    world: World,
    contacts: Contacts,
    law: Law,
    initial: Impulses,
    bodies_out: Bodies,
    impulses_out: Impulses,
) -> None:
    """Warm start: set the impulses so far to `initial`, and the bodies' changes to theirs."""
    for k in range(len(contacts.a)):
        for body in (contacts.a[k], contacts.b[k]):
            put(bodies_out.velocity, body, row(bodies_out.free_velocity, body))
            put(bodies_out.angular_velocity, body, row(bodies_out.free_angular_velocity, body))
    for k in range(len(contacts.a)):
        normal = row(contacts.normal, k)
        # the normal has turned since the last substep
        tangential = across(row(initial.tangential, k), normal)
        impulses_out.normal[k] = initial.normal[k]
        put(impulses_out.tangential, k, tangential)
        put(impulses_out.rolling, k, row(initial.rolling, k))
        impulse = plus(times(initial.normal[k], normal), tangential)
        apply_linear(world, contacts, bodies_out, k, impulse)
        apply_angular(world, contacts, law, bodies_out, k, tangential)
        a = contacts.a[k]
        rolling = times(world.inverse_inertia[a], row(initial.rolling, k))
        add_to(bodies_out.angular_velocity, a, rolling)
