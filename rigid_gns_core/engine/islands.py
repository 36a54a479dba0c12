"""Islands: spheres that contacts connect in a frame. Surfaces belong to none."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import compiled, in_place
from .neighbours import Flags, Indices


class Islands(NamedTuple):
    """Spheres that were touched in a frame and the islands they make.

    parent: forest over the spheres, whose roots name the islands, shape (n,); touched: spheres with
    a contact, shape (n,); grounded: spheres that touch a surface, shape (n,).
    """

    parent: Indices
    touched: Flags
    grounded: Flags


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
    return Islands(np.arange(count), np.zeros(count, np.bool_), np.zeros(count, np.bool_))


@in_place
def root_of(parent: Indices, sphere: int) -> int:
    """The island of a sphere, by the number of one of its spheres."""
    while parent[sphere] != sphere:
        parent[sphere] = parent[parent[sphere]]
        sphere = parent[sphere]
    return sphere


@in_place
def connect(islands: Islands, one: int, other: int) -> None:
    """A contact between spheres; `other` -1: with a surface."""
    islands.touched[one] = True
    if other < 0:
        islands.grounded[one] = True
        return
    islands.touched[other] = True
    first, second = root_of(islands.parent, one), root_of(islands.parent, other)
    islands.parent[max(first, second)] = min(first, second)


@compiled
def groups_of(islands: Islands) -> Groups:
    """The islands of touched spheres."""
    count = len(islands.parent)
    number = np.full(count, -1)
    label = np.empty(count, np.int64)
    islands_found, touched = 0, 0
    for i in range(count):
        label[i] = -1
        if not islands.touched[i]:
            continue
        touched += 1
        root = root_of(islands.parent, i)
        if number[root] < 0:
            number[root] = islands_found
            islands_found += 1
        label[i] = number[root]
    start = np.zeros(islands_found + 1, np.int64)
    grounded = np.zeros(islands_found, np.bool_)
    for i in range(count):
        if label[i] >= 0:
            start[label[i] + 1] += 1
            grounded[label[i]] |= islands.grounded[i]
    for k in range(islands_found):
        start[k + 1] += start[k]
    place, members = start[:-1].copy(), np.empty(touched, np.int64)
    for i in range(count):
        if label[i] >= 0:
            members[place[label[i]]] = i
            place[label[i]] += 1
    return Groups(members, start, grounded)
