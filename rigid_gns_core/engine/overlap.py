# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Push-out: overlaps are undone by position alone, so that they give no speed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contacts import Contacts, gap_of
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.vector import add_to, dot, minus, put, row, times
from ..scenes.state import Array

# most sweeps of push-out at the end of a substep
_SWEEPS = 4
# overlaps [radii] up to which they are rounding
ROUNDING = 1e-12


class Overlaps(NamedTuple):
    """Scratch of `push_out`; c contacts, n spheres.

    depth: of each contact, shape (c,); normal: its direction now, shape (c, 3); deepest, load: of
    each body, shape (n + 1,).
    """

    depth: Array
    normal: Array
    deepest: Array
    load: Array


@compiled
def new_overlaps(spheres: int, contacts: int) -> Overlaps:
    """Room for so many, to be written."""
    bodies = np.empty((2, spheres + 1))
    return Overlaps(
        depth=np.empty(contacts), normal=np.empty((contacts, 3)), deepest=bodies[0], load=bodies[1]
    )


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
