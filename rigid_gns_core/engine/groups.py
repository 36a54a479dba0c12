# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts by island, one island after the other, so that each is solved in a row of memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates
from .contacts import Contacts
from .impacts import (
    ACCELERATION,
    APPROACH_SPEED,
    CROSSING_TIME,
    GAP,
    Impacts,
    REST_GAP,
    SPECULATIVE_GAP,
    TIME,
    TURNING_SPEED,
    X,
    Y,
    Z,
)
from .islands import root_of
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import put


class Order(NamedTuple):
    """Islands of contacts while they are found; n spheres, c contacts.

    parent: forest over the spheres; degree: contacts of each sphere; number: of the island of a
    root, shape (n + 1,); label: island of each contact, 0: it shares no moving body; which: its
    candidate, shape (c,); begin: where each island begins, shape (c + 2,); place: where the next
    contact of each belongs, likewise.
    """

    parent: Indices
    degree: Indices
    number: Indices
    label: Indices
    which: Indices
    begin: Indices
    place: Indices


@compiled
def new_order(spheres: int, contacts: int) -> Order:
    """Room for so many, to be written."""
    bodies, numbers = np.empty((3, spheres + 1), np.int64), np.empty((4, contacts + 2), np.int64)
    return Order(
        parent=bodies[0],
        degree=bodies[1],
        number=bodies[2],
        label=numbers[0],
        which=numbers[1],
        begin=numbers[2],
        place=numbers[3],
    )


@compiled
def new_contacts(size: int) -> Contacts:
    """Room for so many contacts, to be written."""
    index, values = np.empty((4, size), np.int64), np.empty((8, size))
    return Contacts(
        candidate=index[0],
        a=index[1],
        b=index[2],
        plane=index[3],
        normal=np.empty((size, 3)),
        time=values[0],
        gap=values[1],
        speculative_gap=values[2],
        approach_speed=values[3],
        acceleration=values[4],
        turning_speed=values[5],
        crossing_time=values[6],
        rest_gap=values[7],
    )


@in_place
def contacts_by_island(
    candidates: Candidates,
    members: Indices,
    pairs: Indices,
    impacts: Impacts,
    order_out: Order,
    contacts_out: Contacts,
) -> tuple[int, int]:
    """Contacts that share no moving body with another, then the rest by island; how many of each.

    Returns the number of contacts and of islands of several: island i = 1, 2, ... begins at
    `begin[i]`, and ends where the next one begins.

    Args:
        candidates: All of the frame.
        members: Spheres they are of.
        pairs: Candidates that were looked at.
        impacts: Those of the pairs.
        order_out: Written.
        contacts_out: Written.
    """
    size, islands = find_islands(candidates, members, pairs, impacts, order_out)
    size = sort_contacts(candidates, impacts, size, islands, order_out, contacts_out)
    return size, islands


@in_place
def find_islands(
    candidates: Candidates, members: Indices, pairs: Indices, impacts: Impacts, order_out: Order
) -> tuple[int, int]:
    """Label contacts by island, see `contacts_by_island`; how many of each there are."""
    order, fixed, size, islands = order_out, len(order_out.parent) - 1, 0, 0
    last, one = -1, -1
    for i in members:
        order.parent[i], order.degree[i], order.number[i] = i, 0, 0
    for k in pairs:
        if not impacts.found[k]:
            continue
        order.which[size] = k
        size += 1
        a, b = candidates.a[k], candidates.b[k]
        order.degree[a] += 1
        if b < fixed:
            order.degree[b] += 1
            if a != last:  # candidates are sorted, so that many follow each other with the same
                last, one = a, root_of(order.parent, a)
            other = root_of(order.parent, b)
            root = min(one, other)
            order.parent[max(one, other)] = root
            one = root
    order.degree[fixed], last, label = 0, -1, 0
    for c in range(size):
        a, b = candidates.a[order.which[c]], candidates.b[order.which[c]]
        order.label[c] = 0
        if order.degree[a] > 1 or order.degree[b] > 1:
            if a != last:
                last, root = a, root_of(order.parent, a)
                if order.number[root] == 0:
                    islands += 1
                    order.number[root] = islands
                label = order.number[root]
            order.label[c] = label
    return size, islands


@in_place
def sort_contacts(
    candidates: Candidates,
    impacts: Impacts,
    size: int,
    islands: int,
    order_out: Order,
    contacts_out: Contacts,
) -> int:
    """Write contacts by island; those of label -1 are left out. Returns how many there are.

    Args:
        candidates: All of the frame.
        impacts: Theirs.
        size: How many contacts are labelled.
        islands: How many islands of several there are.
        order_out: With the labels; the rest is written.
        contacts_out: Written.
    """
    order = order_out
    for island in range(islands + 2):
        order.begin[island] = 0
    for c in range(size):
        order.begin[order.label[c] + 1] += 1
    order.begin[0] = 0
    for island in range(islands + 1):
        order.begin[island + 1] += order.begin[island]
        order.place[island] = order.begin[island]
    for c in range(size):
        if order.label[c] >= 0:
            place = order.place[order.label[c]]
            order.place[order.label[c]] += 1
            _write(candidates, impacts, order.which[c], place, contacts_out)
    return order.begin[islands + 1]


@in_place
def _write(
    candidates: Candidates, impacts: Impacts, k: int, place: int, contacts_out: Contacts
) -> None:
    """Write the contact of candidate k."""
    out, values = contacts_out, impacts.values
    out.candidate[place], out.plane[place] = k, candidates.plane[k]
    out.a[place], out.b[place] = candidates.a[k], candidates.b[k]
    put(out.normal, place, (values[X, k], values[Y, k], values[Z, k]))
    out.time[place], out.gap[place] = values[TIME, k], values[GAP, k]
    out.speculative_gap[place] = values[SPECULATIVE_GAP, k]
    out.approach_speed[place] = values[APPROACH_SPEED, k]
    out.acceleration[place] = values[ACCELERATION, k]
    out.turning_speed[place] = values[TURNING_SPEED, k]
    out.crossing_time[place], out.rest_gap[place] = values[CROSSING_TIME, k], values[REST_GAP, k]


@in_place
def contacts_among(contacts: Contacts, first: int, last: int) -> Contacts:
    """View of some contacts in a row."""
    return Contacts(
        candidate=contacts.candidate[first:last],
        a=contacts.a[first:last],
        b=contacts.b[first:last],
        plane=contacts.plane[first:last],
        normal=contacts.normal[first:last],
        time=contacts.time[first:last],
        gap=contacts.gap[first:last],
        speculative_gap=contacts.speculative_gap[first:last],
        approach_speed=contacts.approach_speed[first:last],
        acceleration=contacts.acceleration[first:last],
        turning_speed=contacts.turning_speed[first:last],
        crossing_time=contacts.crossing_time[first:last],
        rest_gap=contacts.rest_gap[first:last],
    )
