# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Islands: spheres that contacts connect in a frame, by union-find. Surfaces belong to none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import counting_sort, Flags, Indices
from ..scenes.state import Array


class Islands(NamedTuple):
    """Spheres that touched something in a frame, and the islands they form.

    parent: forest over the spheres, whose roots name the islands, shape (n,); touched: spheres
    with a contact, shape (n,); grounded: spheres that touch a surface, shape (n,); work: done on
    each by surfaces that move, shape (n,).
    """

    parent: Indices
    touched: Flags
    grounded: Flags
    work: Array


class Groups(NamedTuple):
    """Islands of touched spheres, one after the other.

    members: spheres, by island; start: where each island begins, shape (islands + 1,); grounded:
    islands that touch a surface, shape (islands,).
    """

    members: Indices
    start: Indices
    grounded: Flags


@compiled
def no_islands(count: int) -> Islands:
    """Every sphere on its own."""
    return Islands(
        parent=np.arange(count),
        touched=np.zeros(count, np.bool_),
        grounded=np.zeros(count, np.bool_),
        work=np.zeros(count),
    )


@in_place
def root_of(parent: Indices, sphere: int) -> int:
    """Root of the island of a sphere: the index of one of its spheres."""
    while parent[sphere] != sphere:
        parent[sphere] = parent[parent[sphere]]
        sphere = parent[sphere]
    return sphere


@in_place
def connect(islands_out: Islands, a: int, b: int) -> None:
    """Add a contact of spheres a and b; b -1: of sphere a and a surface."""
    islands_out.touched[a] = True
    if b < 0:
        islands_out.grounded[a] = True
        return
    islands_out.touched[b] = True
    first, second = root_of(islands_out.parent, a), root_of(islands_out.parent, b)
    islands_out.parent[max(first, second)] = min(first, second)


@in_place
def join(local: Islands, members: Indices, islands_out: Islands) -> None:
    """Add the islands among some spheres, with indices of their own, to those of all.

    Args:
        local: Islands of the members.
        members: Index of each among all, shape (m,).
        islands_out: Islands of all; contacts are added.
    """
    for m in range(len(members)):
        if local.touched[m]:
            connect(islands_out, members[m], members[local.parent[m]])
            islands_out.grounded[members[m]] |= local.grounded[m]


@compiled
def groups_of(islands: Islands) -> Groups:
    """Touched spheres by island."""
    touched, count = np.flatnonzero(islands.touched), 0
    number, label = np.full(len(islands.parent), -1), np.empty(len(touched), np.int64)
    grounded = np.zeros(len(touched), np.bool_)
    for t in range(len(touched)):
        i = touched[t]
        root = root_of(islands.parent, i)
        if number[root] < 0:
            number[root] = count
            count += 1
        label[t] = number[root]
        grounded[label[t]] |= islands.grounded[i]
    order, start = counting_sort(label, count)
    return Groups(members=touched[order], start=start, grounded=grounded[:count])
