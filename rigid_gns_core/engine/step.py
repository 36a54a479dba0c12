# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step in time: narrow phase, solver, free flight, push-out, containment."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates
from .contact_law import Law, law_of
from .contacts import Contacts, find_contacts
from .containment import keep_sides
from .direct import MOST_CONTACTS
from .events import has_event, MOST_OF_EVENTS, opening_time
from .flight import accelerations_of, fly_in_place, Paths, slow_spins
from .impulses import Bodies, copy_impulse, copy_impulses, Impulses, no_impulses
from .islands import connect, Islands, no_islands, root_of
from .overlap import push_out
from .solver import solve
from .world import UNIT_GRAVITY, weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import counting_sort, Flags, Indices
from ..scenes.state import Array

# Islands of few contacts are solved until an iteration changes none by more than this [g h, and
# approach speed]; blows need it, and resting contacts have it after the first iteration
_EXACT, _MOST_ITERATIONS = 3e-4, 16
# Larger islands whose last iteration changed a contact by more than this [g h] have not converged,
# as after a blow; they get at most so many more, until one changes none by more than that [g h]
_UNCONVERGED, _EXTRA_ITERATIONS, _CONVERGED = 1.0, 24, 0.1


class Motion(NamedTuple):
    """Moving state of the spheres that take part, shapes (m, 3); awake: shape (m,)."""

    positions: Array
    velocities: Array
    angular_velocities: Array
    awake: Flags


@compiled
def copy_motion(motion: Motion) -> Motion:
    """Motion in arrays of its own."""
    p, v, w = motion.positions, motion.velocities, motion.angular_velocities
    return Motion(
        positions=p.copy(), velocities=v.copy(), angular_velocities=w.copy(), awake=motion.awake
    )


class Settings(NamedTuple):
    """How finely a frame is solved.

    substeps: K of a frame; iterations: M of the solver in a substep.
    """

    substeps: int
    iterations: int


@compiled
def step(
    world: World,
    candidates: Candidates,
    chosen: Flags,
    h: float,
    path_h: float,
    last_h: float,
    nominal_h: float,
    iterations: int,
    speeds: Array,
    motion_out: Motion,
    impulses_out: Impulses,
    islands_out: Islands,
    label_out: Indices,
    opening_out: Array,
) -> int:
    """Advance the motion by `h`; returns how many islands have events within it.

    Args:
        world: What does not move.
        candidates: Pairs that may touch.
        chosen: Which of them to consider.
        h: Length; 0 for a correction of collisions that the last one missed.
        path_h: Length over which the paths in flight are found: larger where an event ends it.
        last_h: Length of the last step.
        nominal_h: Length of a regular substep, for thresholds of speed.
        iterations: Iterations of the solver; isolated contacts need but one.
        speeds: Of the spheres where their candidates were found, at least; shape (n,).
        motion_out: Motion of the spheres; advanced in place.
        impulses_out: Impulses by candidate; those of the last substep, which warm start this one,
            are replaced.
        islands_out: Contacts are added.
        label_out: Number of the island with events that each sphere belongs to, else -1; shape
            (n,), written.
        opening_out: When a contact of each of these islands opens, shape (n,); written.
    """
    motion, p = motion_out, motion_out.positions
    v, w = motion_out.velocities, motion_out.angular_velocities
    count = len(p)
    label_out[:] = -1
    path, mean = accelerations_of(world, v, w, h, path_h)
    slow_spins(world, h, w)
    contacts = find_contacts(world, Paths(p, v, path), candidates, chosen, h, nominal_h)
    size = len(contacts.a)
    if size == 0:
        fly_in_place(path, mean, motion.awake, h, motion.positions, motion.velocities)
        _clear(impulses_out)
        return 0
    isolated, shared, begin = _islands_of_contacts(contacts, count)
    law = law_of(world, contacts)
    bodies = _bodies(motion, mean, h)
    impulses, start = no_impulses(size), no_impulses(size)
    solve(
        world=world,
        contacts=contacts,
        law=law,
        group=isolated,
        start=start,
        lasting=start,
        accelerations=path,
        h=h,
        nominal_h=nominal_h,
        iterations=1,
        tolerance=0.0,
        shared=False,
        bodies_out=bodies,
        impulses_out=impulses,
    )
    for k in shared:
        copy_impulse(impulses_out, contacts.candidate[k], start, k)
    # by island, so that none depends on what happens elsewhere
    for island in range(len(begin) - 1):
        _solve_island(
            world=world,
            contacts=contacts,
            law=law,
            group=shared[begin[island] : begin[island + 1]],
            start=start,
            accelerations=path,
            h=h,
            nominal_h=nominal_h,
            iterations=iterations,
            bodies_out=bodies,
            impulses_out=impulses,
        )
    events = 0
    for island in range(len(isolated) + len(begin) - 1):
        if island < len(isolated):
            group = isolated[island : island + 1]
        else:
            first = begin[island - len(isolated)]
            group = shared[first : begin[island - len(isolated) + 1]]
        if h == 0 or len(group) > MOST_OF_EVENTS:
            continue
        opening, has = math.inf, False
        for k in group:
            has |= has_event(world, contacts, k, h, nominal_h, len(group) > 1)
            last = impulses_out.normal[contacts.candidate[k]]
            time = opening_time(contacts, law, bodies, k, last, impulses.normal[k], last_h, h)
            opening = min(opening, time)
        if has or 0 < opening < h or (h < nominal_h and opening < nominal_h):
            for k in group:
                label_out[contacts.a[k]] = events
                if contacts.b[k] < count:
                    label_out[contacts.b[k]] = events
            opening_out[events] = opening
            events += 1
    before = p.copy()
    fly_in_place(path, mean, motion.awake, h, motion.positions, motion.velocities)
    for i in range(count):
        for axis in range(3):
            p[i, axis] += bodies.displacement[i, axis]
            v[i, axis] += bodies.velocity_change[i, axis]
            w[i, axis] += bodies.angular_change[i, axis]
    _clear(impulses_out)
    for k in range(size):
        copy_impulse(impulses, k, impulses_out, contacts.candidate[k])
        if contacts.speculative_gap[k] == 0 or impulses.normal[k] > 0:
            connect(islands_out, contacts.a[k], contacts.b[k] if contacts.b[k] < count else -1)
    push_out(world, contacts, p)
    keep_sides(world, candidates, before, speeds, h, p, v)
    return events


@compiled
def _solve_island(
    world: World,
    contacts: Contacts,
    law: Law,
    group: Indices,
    start: Impulses,
    accelerations: Array,
    h: float,
    nominal_h: float,
    iterations: int,
    bodies_out: Bodies,
    impulses_out: Impulses,
) -> None:
    """Solve the contacts of one island; see `solve`."""
    impulses, first = impulses_out, start
    fall = weight_of(world) * nominal_h
    few, fastest = len(group) <= MOST_CONTACTS, 0.0
    for k in group:
        fastest = max(fastest, contacts.approach_speed[k])
    most, tolerance = iterations, 0.0
    if few:
        most, tolerance = max(iterations, _MOST_ITERATIONS), _EXACT * (fall + fastest)
    while True:
        change = solve(
            world=world,
            contacts=contacts,
            law=law,
            group=group,
            start=first,
            lasting=start,
            accelerations=accelerations,
            h=h,
            nominal_h=nominal_h,
            iterations=most,
            tolerance=tolerance,
            shared=True,
            bodies_out=bodies_out,
            impulses_out=impulses,
        )
        if few or tolerance > 0 or change.max() <= _UNCONVERGED * UNIT_GRAVITY * nominal_h:
            return
        most, tolerance = _EXTRA_ITERATIONS, _CONVERGED * UNIT_GRAVITY * nominal_h
        first = copy_impulses(impulses)


@compiled
def _bodies(motion: Motion, mean: Array, h: float) -> Bodies:
    count = len(motion.positions)
    rows = np.zeros((5, count + 1, 3))
    for i in range(count):
        for axis in range(3):
            fall = h * mean[i, axis] if motion.awake[i] else 0.0
            rows[0, i, axis] = motion.velocities[i, axis] + fall
            rows[1, i, axis] = motion.angular_velocities[i, axis]
    return Bodies(
        free_velocity=rows[0],
        angular_velocity=rows[1],
        velocity_change=rows[2],
        angular_change=rows[3],
        displacement=rows[4],
        strongest=np.zeros(count + 1),
        number=np.full(count + 1, -1),
    )


@in_place
def _clear(impulses_out: Impulses) -> None:
    impulses_out.normal[:] = 0.0
    impulses_out.tangential[:] = 0.0
    impulses_out.rolling[:] = 0.0


@compiled
def _islands_of_contacts(contacts: Contacts, count: int) -> tuple[Indices, Indices, Indices]:
    """Contacts that share no moving body with another; the rest by island; where each begins."""
    contacts_of = np.zeros(count + 1, np.int64)
    for k in range(len(contacts.a)):
        contacts_of[contacts.a[k]] += 1
        contacts_of[contacts.b[k]] += 1
    contacts_of[count] = 0
    islands, shares = no_islands(count), np.empty(len(contacts.a), np.bool_)
    for k in range(len(contacts.a)):
        shares[k] = contacts_of[contacts.a[k]] > 1 or contacts_of[contacts.b[k]] > 1
        if contacts.b[k] < count:
            connect(islands, contacts.a[k], contacts.b[k])
    shared, number, size = np.flatnonzero(shares), np.full(count, -1), 0
    label = np.empty(len(shared), np.int64)
    for q in range(len(shared)):
        root = root_of(islands.parent, contacts.a[shared[q]])
        if number[root] < 0:
            number[root] = size
            size += 1
        label[q] = number[root]
    order, begin = counting_sort(label, size)
    return np.flatnonzero(~shares), shared[order], begin
