# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Push-out: overlaps are undone by position alone, so that they give no speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contacts import Contacts
from .rectangle import from_plane, offset_from_rectangle, to_plane
from .solids import is_solid, nearest_in_world
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.vector import add_to, dot, length, minus, put, row, times, Vector
from ..scenes.state import Array

# most sweeps of push-out at the end of a substep
_SWEEPS = 4
# overlaps [radii] up to which they are rounding
ROUNDING = 1e-12


class Overlaps(NamedTuple):
    """Scratch of `push_out`; c contacts, b bodies.

    depth: of each contact, shape (c,); normal: its direction now, shape (c, 3); deepest, load: of
    each body, shape (b,).
    """

    depth: Array
    normal: Array
    deepest: Array
    load: Array


@compiled
def new_overlaps(bodies: int, contacts: int) -> Overlaps:
    """Room for so many, to be written."""
    own = np.empty((2, bodies))
    return Overlaps(
        depth=np.empty(contacts), normal=np.empty((contacts, 3)), deepest=own[0], load=own[1]
    )


@in_place
def gap_of(world: World, positions: Array, contacts: Contacts, k: int) -> tuple[float, Vector]:
    """Gap and unit normal of contact k at these positions."""
    a, b, plane = contacts.a[k], contacts.b[k], contacts.plane[k]
    sign, place = 1.0, row(positions, a)
    if plane < 0:
        offset = minus(place, row(positions, b))
    elif is_solid(world, plane):
        distance, normal = nearest_in_world(world, plane, place)
        return distance - world.radius[a], normal
    else:
        axes = world.axes[plane]
        local = to_plane(axes, minus(place, row(world.point, plane)))
        rim = offset_from_rectangle(local, world.half[plane])
        if rim[2] < 0 and not world.two_sided[plane]:
            sign = -1.0  # the centre is behind the face
        offset = from_plane(axes, rim)
    far = length(offset)
    normal = times(sign / far, offset) if far > 1e-9 else row(contacts.normal, k)
    return sign * far - (world.radius[a] + world.radius[b]), normal


@in_place
def push_out(
    world: World, contacts: Contacts, overlaps_out: Overlaps, positions_out: Array
) -> None:
    """Move overlapping bodies apart along their normals; the centre of mass of a pair stays.

    Each contact of depth d moves body a by d w_a / (n_a w_a + n_b w_b), and b by as much with w_b,
    with w the inverse masses, and n the number of contacts of a body, weighted by depth.
    """
    positions, fixed = positions_out, len(positions_out)
    count, inverse = len(contacts.a), world.inverse_mass
    depth, normal = overlaps_out.depth, overlaps_out.normal
    deepest, load = overlaps_out.deepest, overlaps_out.load
    for _ in range(_SWEEPS):
        any_deep = False
        for k in range(count):
            if _is_apart(world, positions, contacts, k):
                depth[k] = 0.0
                continue
            gap, direction = gap_of(world, positions, contacts, k)
            deep = gap < -ROUNDING * world.radius[contacts.a[k]]
            depth[k] = -gap if deep else 0.0
            if deep:
                any_deep = True
                put(normal, k, direction)
        if not any_deep:
            return
        for k in range(count):
            for body in (contacts.a[k], contacts.b[k]):
                deepest[body], load[body] = 1e-30, 0.0
        for k in range(count):
            a, b = contacts.a[k], contacts.b[k]
            deepest[a], deepest[b] = max(deepest[a], depth[k]), max(deepest[b], depth[k])
        # weighted, so that contacts of no depth change nothing
        for k in range(count):
            if depth[k] > 0:
                a, b = contacts.a[k], contacts.b[k]
                load[a] += depth[k] / deepest[a]
                load[b] += depth[k] / deepest[b]
        for k in range(count):
            if depth[k] > 0:
                a, b = contacts.a[k], contacts.b[k]
                push = depth[k] / (load[a] * inverse[a] + load[b] * inverse[b])
                way = row(normal, k)
                add_to(positions, a, times(push * inverse[a], way))
                if b < fixed:
                    add_to(positions, b, times(-push * inverse[b], way))


@in_place
def _is_apart(world: World, positions: Array, contacts: Contacts, k: int) -> bool:
    """Whether contact k is one of two spheres with a gap, at a glance."""
    a, b = contacts.a[k], contacts.b[k]
    if contacts.plane[k] >= 0:
        return False
    offset, reach = minus(row(positions, a), row(positions, b)), world.radius[a] + world.radius[b]
    return dot(offset, offset) > reach * reach
