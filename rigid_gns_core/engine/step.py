# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step in time: narrow phase, solver, free flight, push-out, containment."""

from __future__ import annotations

import math

from .broad_phase import Candidates
from .contact_law import find_law, Law
from .contacts import Contacts, find_impacts
from .containment import keep_sides
from .events import has_event, MOST_OF_EVENTS, opening_time, set_events_aside
from .flight import find_accelerations, fly_in_place, Paths, slow_spins
from .groups import contacts_among, find_islands, sort_contacts
from .impulses import Bodies, copy_impulse, copy_impulses_where, Impulses, keep_impulses
from .islands import connect, Islands
from .motion import Motion
from .overlap import push_out
from .plane_bodies import count_work, give_bodies
from .plane_motion import advance_planes
from .solver import solve, solve_isolated
from .workspace import Workspace
from .world import World
from ..kernels.jit import in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import add_to, plus, put, row, times
from ..scenes.state import Array


@in_place
def step(
    world: World,
    candidates: Candidates,
    members: Indices,
    pairs: Indices,
    chosen: Flags,
    h: float,
    path_h: float,
    last_h: float,
    nominal_h: float,
    iterations: int,
    is_whole: bool,
    work_out: Workspace,
    motion_out: Motion,
    impulses_out: Impulses,
    islands_out: Islands,
    label_out: Indices,
    opening_out: Array,
) -> int:
    """Advance the motion of some spheres by `h`; returns how many islands have events within it.

    Args:
        world: What does not move.
        candidates: Pairs that may touch.
        members: The spheres.
        pairs: Candidates of theirs; none is of a member and another sphere.
        chosen: Which candidates to consider, shape (m,).
        h: Length; 0 for a correction of collisions that the last one missed.
        path_h: Length over which the paths in flight are found: larger where an event ends it.
        last_h: Length of the last step.
        nominal_h: Length of a regular substep, for thresholds of speed.
        iterations: Iterations of the solver; isolated contacts need but one.
        is_whole: Whether it is a whole substep, after which islands with events are advanced
            anew: those that are known before are not solved, and impulses before are kept.
        work_out: Scratch, with the speeds at the start of the substep.
        motion_out: Motion of all spheres; that of the members is advanced.
        impulses_out: Impulses by candidate; those of the last step, which warm start this one, are
            replaced.
        islands_out: Contacts are added.
        label_out: Number of the island with events that each member belongs to, else -1; shape
            (n,), written.
        opening_out: When a contact of each of these islands opens, shape (n,); written.
    """
    motion, work, p = motion_out, work_out, motion_out.positions
    v, w, path, mean = motion.velocities, motion.angular_velocities, world.flight, world.flight
    if world.in_air:
        path, mean = work.path, work.mean
        find_accelerations(world, v, w, members, h, path_h, path, mean)
        slow_spins(world, members, h, w)
    find_impacts(world, Paths(p, v, path), candidates, pairs, chosen, h, nominal_h, work.impacts)
    size, islands = find_islands(candidates, members, pairs, work.impacts, work.order)
    for i in members:
        put(work.positions, i, row(p, i))
        label_out[i] = -1
    events = 0
    if is_whole and h > 0 and islands > 0:
        events = set_events_aside(
            world, candidates, work.impacts, impulses_out, size, islands, h, nominal_h, work.order,
            label_out, opening_out,
        )  # fmt: skip
    size = sort_contacts(candidates, work.impacts, size, islands, work.order, work.contacts)
    if size == 0:
        if is_whole and events > 0:
            copy_impulses_where(impulses_out, pairs, candidates.a, label_out, work.warm)
        fly_in_place(path, mean, motion.awake, members, h, p, v)
        advance_planes(world, h)
        keep_impulses(pairs, work.impacts.found, impulses_out)
        # one that was struck in this substep may meet planes that are no candidates
        keep_sides(
            world, candidates, members, pairs, work.positions, work.speeds, h, work.cuts, p, v
        )
        return events
    contacts, impulses, bodies = contacts_among(work.contacts, 0, size), work.impulses, work.bodies
    find_law(world, contacts, work.law)
    _free_motion(motion, mean, members, h, bodies)
    give_bodies(world, work.impacts, size, contacts, bodies)
    begin = work.order.begin
    for k in range(size):
        copy_impulse(impulses_out, contacts.candidate[k], work.start, k)
    solve_isolated(
        world=world,
        contacts=contacts,
        law=work.law,
        last=begin[1],
        accelerations=path,
        h=h,
        nominal_h=nominal_h,
        state_out=work.state,
        bodies_out=bodies,
        impulses_out=impulses,
    )
    # by island, so that none depends on what happens elsewhere
    for island in range(1, islands + 1):
        if begin[island] == begin[island + 1]:  # set aside
            continue
        solve(
            world=world,
            contacts=contacts,
            law=work.law,
            start=work.start,
            first=begin[island],
            last=begin[island + 1],
            accelerations=path,
            h=h,
            nominal_h=nominal_h,
            iterations=iterations,
            couplings_out=work.couplings,
            pivots_out=work.pivots,
            blocks_out=work.blocks,
            state_out=work.state,
            bodies_out=bodies,
            impulses_out=impulses,
        )
    events = _islands_with_events(
        world, contacts, work.law, bodies, impulses_out, impulses, begin, islands, events, h,
        last_h, nominal_h, label_out, opening_out,
    )  # fmt: skip
    if is_whole and events > 0:
        copy_impulses_where(impulses_out, pairs, candidates.a, label_out, work.warm)
    count_work(world, contacts, impulses, bodies, motion)
    fly_in_place(path, mean, motion.awake, members, h, p, v)
    advance_planes(world, h)
    for i in members:
        add_to(p, i, row(bodies.displacement, i))
        put(v, i, row(bodies.velocity, i))
        put(w, i, row(bodies.angular_velocity, i))
    keep_impulses(pairs, work.impacts.found, impulses_out)
    fixed = len(p)
    for k in range(size):
        copy_impulse(impulses, k, impulses_out, contacts.candidate[k])
        if contacts.speculative_gap[k] == 0 or impulses.normal[k] > 0:
            connect(islands_out, contacts.a[k], contacts.b[k] if contacts.b[k] < fixed else -1)
    push_out(world, contacts, work.overlaps, p, islands_out)
    keep_sides(world, candidates, members, pairs, work.positions, work.speeds, h, work.cuts, p, v)
    return events


@in_place
def _free_motion(
    motion: Motion, mean: Array, members: Indices, h: float, bodies_out: Bodies
) -> None:
    """Motion at the end of a step without contacts."""
    zero = (0.0, 0.0, 0.0)
    for i in members:
        fall = times(h, row(mean, i)) if motion.awake[i] else zero
        velocity, spin = plus(row(motion.velocities, i), fall), row(motion.angular_velocities, i)
        put(bodies_out.free_velocity, i, velocity)
        put(bodies_out.free_angular_velocity, i, spin)
        put(bodies_out.velocity, i, velocity)
        put(bodies_out.angular_velocity, i, spin)
        put(bodies_out.displacement, i, zero)
    fixed = len(motion.positions)
    put(bodies_out.free_velocity, fixed, zero)
    put(bodies_out.free_angular_velocity, fixed, zero)
    put(bodies_out.velocity, fixed, zero)
    put(bodies_out.angular_velocity, fixed, zero)


@in_place
def _islands_with_events(
    world: World,
    contacts: Contacts,
    law: Law,
    bodies: Bodies,
    before: Impulses,
    impulses: Impulses,
    begin: Indices,
    islands: int,
    events: int,
    h: float,
    last_h: float,
    nominal_h: float,
    label_out: Indices,
    opening_out: Array,
) -> int:
    """Number the islands that have events within a step; returns how many there are.

    Args:
        world: What does not move.
        contacts: All contacts, by island.
        law: Their coefficients.
        bodies: With the changes by all impulses.
        before: Impulses of the last step, by candidate.
        impulses: Those of this one, by contact.
        begin: Where island i begins, i = 1, 2, ...; before those are isolated contacts.
        islands: How many there are.
        events: How many of them are numbered already, and have no contacts here.
        h: Length of the step.
        last_h: Of the last one.
        nominal_h: Of a regular substep.
        label_out: Number of the island of each member, else -1; written.
        opening_out: When a contact of each of these islands opens; written.
    """
    isolated, fixed = begin[1], len(world.restitution)
    if h == 0:
        return events
    for group in range(isolated + islands):
        first, last = group, group + 1
        if group >= isolated:
            island = group - isolated + 1
            first, last = begin[island], begin[island + 1]
        if last - first > MOST_OF_EVENTS:
            continue
        opening, has = math.inf, False
        for k in range(first, last):
            has |= has_event(world, contacts, k, h, nominal_h, last - first > 1)
            earlier = before.normal[contacts.candidate[k]]
            time = opening_time(contacts, law, bodies, k, earlier, impulses.normal[k], last_h, h)
            opening = min(opening, time)
        if has or 0 < opening < h or (h < nominal_h and opening < nominal_h):
            for k in range(first, last):
                label_out[contacts.a[k]] = events
                if contacts.b[k] < fixed:
                    label_out[contacts.b[k]] = events
            opening_out[events] = opening
            events += 1
    return events
