# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One substep: free flight, contacts, impulses, push-out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .candidates import Candidates
from .contacts import Contacts, find_contacts
from .impulses import Bodies, Impulses, no_impulses
from .islands import connect, Islands, no_islands, root_of
from .law import law_of
from .overlap import push_out
from .solver import solve
from .world import UNIT_GRAVITY, World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import counting_sort, Flags, Indices
from ..kernels.vector import put, row
from ..scenes.state import Array

# islands whose last round still changed a contact by this part of g h get so many more of the law,
# or fewer where they change all by less than that part of it
_UNSETTLED, _MORE, _SETTLED = 1.0, 24, 0.1


class Motion(NamedTuple):
    """Moving state of the bodies that take part: spheres, shapes (m, 3); awake: shape (m,)."""

    positions: Array
    velocities: Array
    angular_velocities: Array
    awake: Flags


@compiled
def copy_motion(motion: Motion) -> Motion:
    """Return the same in other memory."""
    p, v, w = motion.positions, motion.velocities, motion.angular_velocities
    return Motion(p.copy(), v.copy(), w.copy(), motion.awake)


class Settings(NamedTuple):
    """A model.

    substeps: K of a frame; rounds: M of a substep.
    """

    substeps: int
    rounds: int


@compiled
def substep(
    world: World,
    motion: Motion,
    candidates: Candidates,
    chosen: Flags,
    h: float,
    pace: float,
    memory: Impulses,
    settings: Settings,
    islands: Islands,
) -> None:
    """Advance the motion by `h`, in place.

    Args:
        world: What does not move.
        motion: Of its spheres.
        candidates: What may touch.
        chosen: Which of them to look at.
        h: Length; 0 for one that only mends what the last one missed.
        pace: Length of a substep as such, to which speeds are compared.
        memory: Impulses of the last substep by candidate; overwritten with those of this one.
        settings: The model; contacts on their own need no rounds.
        islands: What touched is added.
    """
    p, v, w = motion.positions, motion.velocities, motion.angular_velocities
    count = len(p)
    contacts = find_contacts(world, p, v, candidates, chosen, h, pace)
    size = len(contacts.a)
    if size == 0:
        _fly(world, motion, h)
        _forget(memory)
        return
    alone, shared = _by_company(contacts, count)
    law = law_of(world, contacts)
    bodies = _bodies(world, motion, h)
    made, start = no_impulses(size), no_impulses(size)
    solve(world, contacts, law, alone, bodies, start, start, h, pace, 1, 0.0, made)
    for k in shared:
        _copy(memory, contacts.candidate[k], start, k)
    rounds = settings.rounds
    unsettled = solve(
        world, contacts, law, shared, bodies, start, start, h, pace, rounds, 0.0, made
    )
    again, begin = _struck(contacts, shared, unsettled, pace, count)
    if len(again):
        first = Impulses(made.normal.copy(), made.tangential.copy(), made.rolling.copy())
        enough = _SETTLED * UNIT_GRAVITY * pace
        for island in range(len(begin) - 1):
            some = again[begin[island] : begin[island + 1]]
            solve(world, contacts, law, some, bodies, first, start, h, pace, _MORE, enough, made)
    _fly(world, motion, h)
    for i in range(count):
        for axis in range(3):
            p[i, axis] += bodies.moved[i, axis]
            v[i, axis] += bodies.change[i, axis]
            w[i, axis] += bodies.turn[i, axis]
    _forget(memory)
    for k in range(size):
        _copy(made, k, memory, contacts.candidate[k])
        if contacts.open[k] == 0 or made.normal[k] > 0:
            connect(islands, contacts.a[k], contacts.b[k] if contacts.b[k] < count else -1)
    push_out(world, p, contacts)


@in_place
def _fly(world: World, motion: Motion, h: float) -> None:
    for i in range(len(motion.positions)):
        for axis in range(3):
            pull = h * world.gravity[axis] if motion.awake[i] else 0.0
            motion.positions[i, axis] += h * (motion.velocities[i, axis] + 0.5 * pull)
            motion.velocities[i, axis] += pull


@compiled
def _bodies(world: World, motion: Motion, h: float) -> Bodies:
    count = len(motion.positions)
    rows = np.zeros((6, count + 1, 3))
    for i in range(count):
        for axis in range(3):
            rows[0, i, axis] = motion.velocities[i, axis] + h * world.gravity[axis]
            rows[1, i, axis] = motion.velocities[i, axis]
            rows[2, i, axis] = motion.angular_velocities[i, axis]
    load, most = np.zeros(count + 1), np.zeros(count + 1)
    return Bodies(rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], load, most)


@in_place
def _copy(one: Impulses, i: int, other: Impulses, k: int) -> None:
    other.normal[k] = one.normal[i]
    put(other.tangential, k, row(one.tangential, i))
    put(other.rolling, k, row(one.rolling, i))


@in_place
def _forget(memory: Impulses) -> None:
    memory.normal[:] = 0.0
    memory.tangential[:] = 0.0
    memory.rolling[:] = 0.0


@compiled
def _by_company(contacts: Contacts, count: int) -> tuple[Indices, Indices]:
    """Contacts that share no body with another, and need no rounds; the rest."""
    load = np.zeros(count + 1, np.int64)
    for k in range(len(contacts.a)):
        load[contacts.a[k]] += 1
        load[contacts.b[k]] += 1
    load[count] = 0
    shared = np.empty(len(contacts.a), np.bool_)
    for k in range(len(contacts.a)):
        shared[k] = load[contacts.a[k]] > 1 or load[contacts.b[k]] > 1
    return np.flatnonzero(~shared), np.flatnonzero(shared)


@compiled
def _struck(
    contacts: Contacts, shared: Indices, unsettled: Array, pace: float, count: int
) -> tuple[Indices, Indices]:
    """Contacts of islands that a blow has left far from the law's end; where each island begins.

    Island by island, so that none feels what happens elsewhere.
    """
    loud = unsettled > _UNSETTLED * UNIT_GRAVITY * pace
    if not loud.any():
        return shared[:0], np.zeros(1, np.int64)
    islands = no_islands(count)
    for k in range(len(contacts.a)):
        if contacts.b[k] < count:
            connect(islands, contacts.a[k], contacts.b[k])
    number, found = np.full(count, -1), 0
    for q in range(len(shared)):
        root = root_of(islands.parent, contacts.a[shared[q]])
        if loud[q] and number[root] < 0:
            number[root] = found
            found += 1
    label = np.empty(len(shared), np.int64)
    for q in range(len(shared)):
        label[q] = number[root_of(islands.parent, contacts.a[shared[q]])]
    chosen = label >= 0
    order, begin = counting_sort(label[chosen], found)
    return shared[chosen][order], begin
