# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts by island, one island after the other, so that each is solved in a row of memory."""

from __future__ import annotations

import numpy as np

from .contacts import Contacts
from .islands import connect, no_islands, root_of
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import counting_sort, Indices


@compiled
def by_island(contacts: Contacts, count: int) -> tuple[Contacts, Indices]:
    """Contacts that share no moving body with another; then the rest by island.

    Returns the contacts in this order and where each of the islands of several begins, and ends
    the last one: isolated contacts are those before the first.

    Args:
        contacts: In any order.
        count: Number of spheres, the index of the fixed body.
    """
    size = len(contacts.a)
    contacts_of = np.zeros(count + 1, np.int64)
    for k in range(size):
        contacts_of[contacts.a[k]] += 1
        contacts_of[contacts.b[k]] += 1
    contacts_of[count] = 0
    islands = no_islands(count)
    for k in range(size):
        if contacts.b[k] < count:
            connect(islands, contacts.a[k], contacts.b[k])
    number, islands_so_far = np.full(count, -1), 0
    label = np.zeros(size, np.int64)
    for k in range(size):
        if contacts_of[contacts.a[k]] > 1 or contacts_of[contacts.b[k]] > 1:
            root = root_of(islands.parent, contacts.a[k])
            if number[root] < 0:
                islands_so_far += 1
                number[root] = islands_so_far
            label[k] = number[root]
    order, start = counting_sort(label, islands_so_far + 1)
    return _in_order(contacts, order), start[1:]


@compiled
def _in_order(contacts: Contacts, order: Indices) -> Contacts:
    return Contacts(
        candidate=contacts.candidate[order],
        a=contacts.a[order],
        b=contacts.b[order],
        plane=contacts.plane[order],
        normal=contacts.normal[order],
        time=contacts.time[order],
        gap=contacts.gap[order],
        speculative_gap=contacts.speculative_gap[order],
        approach_speed=contacts.approach_speed[order],
        acceleration=contacts.acceleration[order],
        turning_speed=contacts.turning_speed[order],
        crossing_time=contacts.crossing_time[order],
        rest_gap=contacts.rest_gap[order],
    )


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
