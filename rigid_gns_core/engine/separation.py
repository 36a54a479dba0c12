# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Overlaps of a start, and those that a correction leaves, are undone by position alone."""

from __future__ import annotations

import numpy as np

from .broad_phase import Candidates, find_candidates
from .contacts import find_impacts
from .containment import keep_sides
from .flight import Paths
from .groups import contacts_among, contacts_by_island
from .islands import Islands, no_islands
from .overlap import gap_of, push_out
from .plane_bodies import bodies_of_planes
from .workspace import new_workspace, Workspace
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.vector import put, row
from ..scenes.state import Array

# most passes over a start, and overlaps [radii] up to which bodies are left as they are
_PASSES, _CLOSE = 500, 1e-6


@in_place
def separate_once(
    world: World,
    positions_out: Array,
    velocities_out: Array,
    candidates: Candidates,
    work_out: Workspace,
    islands_out: Islands,
) -> bool:
    """Push bodies out once, where any overlap; whether they do.

    Args:
        world: What does not move.
        positions_out: Centres, shape (n, 3); moved.
        velocities_out: Shape (n, 3); turned where a plane stops a centre.
        candidates: Pairs that may overlap.
        work_out: Scratch.
        islands_out: Overlaps are added as contacts.
    """
    work, p, v = work_out, positions_out, velocities_out
    find_impacts(
        world, Paths(p, v, world.flight), candidates, work.every_pair, work.every, 0.0, 0.0,
        work.impacts,
    )  # fmt: skip
    size, _ = contacts_by_island(
        candidates, work.everyone, work.every_pair, work.impacts, work.order, work.contacts
    )
    contacts, deep = contacts_among(work.contacts, 0, size), False
    for k in range(size):
        gap, _ = gap_of(world, p, contacts, k)
        deep = deep or gap < -_CLOSE * world.radius[contacts.a[k]]
    if not deep:
        return False
    for i in work.everyone:
        put(work.positions, i, row(p, i))
        work.speeds[i] = 0.0
    push_out(world, contacts, work.overlaps, p, islands_out)
    keep_sides(
        world, candidates, work.everyone, work.every_pair, work.positions, work.speeds, 0.0,
        work.cuts, p, v,
    )  # fmt: skip
    return True


@compiled
def separate(world: World, dt: float, positions_out: Array) -> None:
    """Undo the overlaps of a start, however deep.

    Args:
        world: What does not move.
        dt: Length of a frame.
        positions_out: Centres, shape (n, 3); moved.
    """
    still, everyone = np.zeros_like(positions_out), np.ones(len(positions_out), np.bool_)
    unused = no_islands(len(positions_out))
    for _ in range(_PASSES):
        candidates = find_candidates(world, positions_out, still, dt, everyone, 0.0)
        if len(candidates.a) == 0:
            return
        work = new_workspace(
            len(positions_out), 1 + bodies_of_planes(world, candidates.plane), candidates
        )
        if not separate_once(world, positions_out, still, candidates, work, unused):
            return
