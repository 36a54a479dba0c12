# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts with planes that move: each has a fixed body of its own, that moves as the surface.

To the solver they are contacts like any other, with slip and approach relative to that body. The
work of a surface on a sphere is J . u + L . W, with the impulses J and L, the velocity u of the
surface at the contact and its angular velocity W; the energy guard lets an island gain as much.
"""

from __future__ import annotations

from .contacts import Contacts
from .impacts import Impacts
from .impulses import Bodies, Impulses
from .motion import Motion
from .plane_motion import moves
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import dot, plus, put, row, times


@compiled
def bodies_of_planes(world: World, planes: Indices) -> int:
    """How many candidates are of planes that move, shape (m,), -1 for two spheres."""
    count = 0
    if world.moving:
        for plane in planes:
            count += moves(world, plane)
    return count


@in_place
def give_bodies(
    world: World, impacts: Impacts, size: int, contacts_out: Contacts, bodies_out: Bodies
) -> None:
    """Give contacts with planes that move bodies after the fixed one, with their motion.

    Args:
        world: Properties.
        impacts: With the velocities of surfaces.
        size: How many contacts there are.
        contacts_out: Body b is written.
        bodies_out: Velocities are written.
    """
    if not world.moving:
        return
    body = len(world.restitution) + 1
    for k in range(size):
        plane = contacts_out.plane[k]
        if not moves(world, plane):
            continue
        contacts_out.b[k] = body
        velocity = row(impacts.surface_velocity, contacts_out.candidate[k])
        spin = row(world.twists.spin, plane)
        put(bodies_out.free_velocity, body, velocity)
        put(bodies_out.free_angular_velocity, body, spin)
        put(bodies_out.velocity, body, velocity)
        put(bodies_out.angular_velocity, body, spin)
        put(bodies_out.displacement, body, (0.0, 0.0, 0.0))
        body += 1


@in_place
def count_work(
    world: World, contacts: Contacts, impulses: Impulses, bodies: Bodies, motion_out: Motion
) -> None:
    """Add the work of planes that move to that on their spheres."""
    if not world.moving:
        return
    for k in range(len(contacts.a)):
        if moves(world, contacts.plane[k]):
            b = contacts.b[k]
            normal = times(impulses.normal[k], row(contacts.normal, k))
            push = plus(normal, row(impulses.tangential, k))
            work = dot(push, row(bodies.free_velocity, b))
            work += dot(row(impulses.rolling, k), row(bodies.free_angular_velocity, b))
            motion_out.work[contacts.a[k]] += work
