# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Push-out: overlaps are undone by position alone, so that they give no speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contacts import Contacts
from .islands import connect, Islands
from .rectangle import from_plane, offset_from_rectangle, to_plane
from .solids import is_solid, nearest_in_world
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import add_to, dot, length, minus, put, row, times, Vector
from ..scenes.state import Array

# most sweeps of push-out at the end of a substep
_SWEEPS = 4
# overlaps [radii] up to which they are rounding
ROUNDING = 1e-12


class Overlaps(NamedTuple):
    """Scratch of `push_out`; c contacts, b bodies.

    which: contacts that overlap, shape (c,); depth: of these, shape (c,); normal: their
    directions now, shape (c, 3); deepest, load: of each body, shape (b,); moved: first sweep
    after it was moved, shape (b,).
    """

    which: Indices
    depth: Array
    normal: Array
    deepest: Array
    load: Array
    moved: Indices


@compiled
def new_overlaps(bodies: int, contacts: int) -> Overlaps:
    """Room for so many, to be written."""
    own = np.empty((2, bodies))
    return Overlaps(
        which=np.empty(contacts, np.int64),
        depth=np.empty(contacts),
        normal=np.empty((contacts, 3)),
        deepest=own[0],
        load=own[1],
        moved=np.empty(bodies, np.int64),
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
    world: World,
    contacts: Contacts,
    overlaps_out: Overlaps,
    positions_out: Array,
    islands_out: Islands,
) -> None:
    """Move overlapping bodies apart along their normals; the centre of mass of a pair stays.

    They are of one island then: a sphere of none gets the place that free flight leads to, and the
    other one would have been moved alone.

    Each contact of depth d moves body a by d w_a / (n_a w_a + n_b w_b), and b by as much with w_b,
    with w the inverse masses, and n the number of contacts of a body, weighted by depth.
    """
    positions, fixed = positions_out, len(positions_out)
    inverse, which, moved = world.inverse_mass, overlaps_out.which, overlaps_out.moved
    depth, normal = overlaps_out.depth, overlaps_out.normal
    deepest, load = overlaps_out.deepest, overlaps_out.load
    for k in range(len(contacts.a)):
        moved[contacts.a[k]] = moved[contacts.b[k]] = 0
    for sweep in range(_SWEEPS):
        size = 0
        for k in range(len(contacts.a)):
            a, b = contacts.a[k], contacts.b[k]
            # contacts of bodies that did not move are as they were: they do not overlap
            if max(moved[a], moved[b]) < sweep or _is_apart(world, positions, contacts, k):
                continue
            gap, direction = gap_of(world, positions, contacts, k)
            if gap < -ROUNDING * world.radius[a]:
                which[size], depth[size] = k, -gap
                put(normal, size, direction)
                deepest[a], load[a], deepest[b], load[b] = 1e-30, 0.0, 1e-30, 0.0
                size += 1
        if size == 0:
            return
        for q in range(size):
            a, b = contacts.a[which[q]], contacts.b[which[q]]
            deepest[a], deepest[b] = max(deepest[a], depth[q]), max(deepest[b], depth[q])
        # weighted, so that contacts of no depth change nothing
        for q in range(size):
            a, b = contacts.a[which[q]], contacts.b[which[q]]
            load[a] += depth[q] / deepest[a]
            load[b] += depth[q] / deepest[b]
        for q in range(size):
            a, b = contacts.a[which[q]], contacts.b[which[q]]
            connect(islands_out, a, b if b < fixed else -1)
            push = depth[q] / (load[a] * inverse[a] + load[b] * inverse[b])
            way = row(normal, q)
            add_to(positions, a, times(push * inverse[a], way))
            moved[a] = sweep + 1
            if b < fixed:
                add_to(positions, b, times(-push * inverse[b], way))
                moved[b] = sweep + 1


@in_place
def _is_apart(world: World, positions: Array, contacts: Contacts, k: int) -> bool:
    """Whether contact k is one of two spheres with a gap, at a glance."""
    a, b = contacts.a[k], contacts.b[k]
    if contacts.plane[k] >= 0:
        return False
    offset, reach = minus(row(positions, a), row(positions, b)), world.radius[a] + world.radius[b]
    return dot(offset, offset) > reach * reach
