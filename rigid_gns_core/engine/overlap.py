# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Push-out: overlaps are undone by position alone, so that they give no speed."""

from __future__ import annotations

import numpy as np

from .broad_phase import find_candidates
from .contacts import Contacts, find_contacts, gap_of
from .containment import keep_sides
from .flight import Paths
from .world import World
from ..kernels.jit import compiled, entry
from ..kernels.vector import add_to, put, row, times
from ..scenes.state import Array

# most sweeps of push-out at the end of a substep
_SWEEPS = 4
# overlaps [radii] up to which they are rounding
ROUNDING = 1e-12
# most passes over a start, and overlaps [radii] up to which it is left as it is
_PASSES, _CLOSE = 500, 1e-6


@compiled
def push_out(world: World, contacts: Contacts, positions_out: Array) -> None:
    """Move overlapping bodies apart along their normals; the centre of mass of a pair stays.

    Each contact of depth d moves body a by d w_a / (n_a w_a + n_b w_b), and b by as much with w_b,
    with w the inverse masses, and n the number of contacts of a body, weighted by depth.
    """
    positions = positions_out
    count, bodies = len(contacts.a), len(positions) + 1
    inverse = world.inverse_mass
    depth, normal = np.empty(count), np.empty((count, 3))
    deepest, load = np.empty(bodies), np.empty(bodies)
    for _ in range(_SWEEPS):
        any_deep = False
        for k in range(count):
            gap, direction = gap_of(world, positions, contacts, k)
            deep = gap < -ROUNDING * world.radius[contacts.a[k]]
            depth[k] = -gap if deep else 0.0
            if deep:
                any_deep = True
                put(normal, k, direction)
        if not any_deep:
            return
        deepest[:], load[:] = 1e-30, 0.0
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
                if b < bodies - 1:
                    add_to(positions, b, times(-push * inverse[b], way))


@entry
def separate(world: World, dt: float, positions_out: Array) -> None:
    """Undo the overlaps of a start, however deep.

    Args:
        world: What does not move.
        dt: Length of a frame.
        positions_out: Centres, shape (n, 3); moved.
    """
    positions = positions_out
    still, everyone = np.zeros_like(positions), np.ones(len(positions), np.bool_)
    for _ in range(_PASSES):
        candidates = find_candidates(world, positions, still, dt, everyone)
        if len(candidates.a) == 0:
            return
        chosen = np.ones(len(candidates.a), np.bool_)
        contacts = find_contacts(
            world, Paths(positions, still, world.pull), candidates, chosen, 0.0, 0.0
        )
        deep = False
        for k in range(len(contacts.a)):
            gap, _ = gap_of(world, positions, contacts, k)
            deep = deep or gap < -_CLOSE * world.radius[contacts.a[k]]
        if not deep:
            return
        before = positions.copy()
        push_out(world, contacts, positions)
        keep_sides(world, candidates, before, np.zeros(len(before)), 0.0, positions, still)
