# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One substep: a step of all, and of small islands anew, from event to event.

A blow on a body that has other contacts takes no time: what holds the body acts until then, and
friction and gravity after it. So an island of few contacts is advanced to the blow, the blow is
solved alone, and then the rest. The same at an edge that a sphere rolls over. Islands of many
contacts, where blows follow one another without end, are not.
"""

from __future__ import annotations

from .broad_phase import Candidates
from .contacts import find_impacts
from .events import is_blow, NEAR, next_event
from .flight import find_accelerations, Paths
from .groups import contacts_among, contacts_by_island
from .impulses import clear_impulses, copy_impulses, Impulses, scale_impulses
from .islands import Islands
from .motion import Motion, restore_motion
from .plane_motion import set_clock
from .step import step
from .workspace import Workspace
from .world import World
from ..kernels.jit import in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import length, row

# most events of an island within a substep; what follows is one step
_MOST_EVENTS = 12


@in_place
def substep(
    world: World,
    candidates: Candidates,
    chosen: Flags,
    h: float,
    nominal_h: float,
    iterations: int,
    work_out: Workspace,
    motion_out: Motion,
    impulses_out: Impulses,
    islands_out: Islands,
) -> None:
    """Advance the motion of all spheres by `h`; see `step`."""
    work, clock = work_out, world.twists.clock[0]
    restore_motion(motion_out, work.everyone, work.before)
    for i in work.everyone:
        work.speeds[i] = length(row(motion_out.velocities, i))
    events = step(
        world=world,
        candidates=candidates,
        members=work.everyone,
        pairs=work.every_pair,
        chosen=chosen,
        h=h,
        path_h=h,
        last_h=nominal_h,
        nominal_h=nominal_h,
        iterations=iterations,
        is_whole=True,
        work_out=work,
        motion_out=motion_out,
        impulses_out=impulses_out,
        islands_out=islands_out,
        label_out=work.label,
        opening_out=work.opening,
    )
    if events == 0:
        return
    _sort_by_label(candidates, chosen, events, work)
    for event in range(events):
        spheres, pairs = work.sphere_begin, work.pair_begin
        set_clock(world, clock)
        _advance_by_events(
            world=world,
            candidates=candidates,
            members=work.spheres[spheres[event] : spheres[event + 1]],
            pairs=work.pairs[pairs[event] : pairs[event + 1]],
            opening=work.opening[event],
            h=h,
            nominal_h=nominal_h,
            iterations=iterations,
            work_out=work,
            motion_out=motion_out,
            impulses_out=impulses_out,
            islands_out=islands_out,
        )
    set_clock(world, clock + h)


@in_place
def _sort_by_label(
    candidates: Candidates, chosen: Flags, events: int, work_out: Workspace
) -> None:
    """Spheres of each island with events, and candidates among them and of them and planes."""
    work, size = work_out, len(candidates.a)
    begin, place = work.sphere_begin, work.place
    begin[: events + 1] = 0
    for i in work.everyone:
        if work.label[i] >= 0:
            begin[work.label[i] + 1] += 1
    for event in range(events):
        begin[event + 1] += begin[event]
        place[event] = begin[event]
    for i in work.everyone:
        own = work.label[i]
        if own >= 0:
            work.spheres[place[own]] = i
            place[own] += 1
    begin = work.pair_begin
    begin[: events + 1] = 0
    for k in range(size):
        own = _label_of_pair(candidates, chosen, work.label, k)
        if own >= 0:
            begin[own + 1] += 1
    for event in range(events):
        begin[event + 1] += begin[event]
        place[event] = begin[event]
    for k in range(size):
        own = _label_of_pair(candidates, chosen, work.label, k)
        if own >= 0:
            work.pairs[place[own]] = k
            place[own] += 1


@in_place
def _label_of_pair(candidates: Candidates, chosen: Flags, label: Indices, k: int) -> int:
    """Number of the island that both bodies of candidate k belong to, else -1."""
    own = label[candidates.a[k]]
    if chosen[k] and (candidates.plane[k] >= 0 or label[candidates.b[k]] == own):
        return own
    return -1


@in_place
def _advance_by_events(
    world: World,
    candidates: Candidates,
    members: Indices,
    pairs: Indices,
    opening: float,
    h: float,
    nominal_h: float,
    iterations: int,
    work_out: Workspace,
    motion_out: Motion,
    impulses_out: Impulses,
    islands_out: Islands,
) -> None:
    """Advance the spheres of an island anew, from event to event.

    Args:
        world: What does not move.
        candidates: All candidates of the frame.
        members: Spheres of the island.
        pairs: Candidates among them, and of them and planes.
        opening: When a contact of theirs opens, or infinite.
        h: Length of the substep.
        nominal_h: Length of a regular substep.
        iterations: Iterations of the solver.
        work_out: Scratch, with motion and impulses at the start of the substep.
        motion_out: Motion of all spheres; that of the members is written.
        impulses_out: Impulses by candidate; those of the pairs are written.
        islands_out: Contacts are added.
    """
    work, motion, impulses, chosen = work_out, motion_out, impulses_out, work_out.chosen
    restore_motion(work.before, members, motion)
    copy_impulses(work.warm, pairs, impulses)
    left, last = h, nominal_h
    for event in range(_MOST_EVENTS):
        for k in pairs:
            chosen[k] = True
        if event > 0:  # else the step has found them on the same paths
            path = world.flight
            if world.in_air:
                path = work.path
                find_accelerations(
                    world, motion.velocities, motion.angular_velocities, members, left, left,
                    path, work.mean,
                )  # fmt: skip
            paths = Paths(motion.positions, motion.velocities, path)
            find_impacts(world, paths, candidates, pairs, chosen, left, nominal_h, work.impacts)
        size, _ = contacts_by_island(
            candidates, members, pairs, work.impacts, work.order, work.contacts
        )
        contacts = contacts_among(work.contacts, 0, size)
        time, blow = next_event(world, contacts, left, nominal_h)
        if h - left < opening < h - left + time:
            time, blow = opening - (h - left), False
        if time >= left:
            break
        if time > 0:
            for k in range(size):
                chosen[contacts.candidate[k]] = not is_blow(world, contacts, k, nominal_h)
            # the forces of a tiny step are rounding
            tiny = time <= NEAR * nominal_h
            if tiny:
                copy_impulses(impulses, pairs, work.warm)
            scale_impulses(time / last, pairs, impulses)
            done = h - left
            found = step(
                world, candidates, members, pairs, chosen, time, left, last, nominal_h, iterations,
                False, work, motion, impulses, islands_out, work.inner_label, work.inner_opening,
            )  # fmt: skip
            if tiny:
                copy_impulses(work.warm, pairs, impulses)
            left, last = left - time, last if tiny else time
            if found == 1 and done + work.inner_opening[0] > h - left + NEAR * nominal_h:
                opening = done + work.inner_opening[0]
        if blow:
            for k in pairs:
                chosen[k] = True
            copy_impulses(impulses, pairs, work.warm)
            clear_impulses(pairs, impulses)
            step(
                world, candidates, members, pairs, chosen, 0.0, 0.0, last, nominal_h, iterations,
                False, work, motion, impulses, islands_out, work.inner_label, work.inner_opening,
            )  # fmt: skip
            copy_impulses(work.warm, pairs, impulses)
    if left > 0:
        for k in pairs:
            chosen[k] = True
        scale_impulses(left / last, pairs, impulses)
        step(
            world, candidates, members, pairs, chosen, left, left, last, nominal_h, iterations,
            False, work, motion, impulses, islands_out, work.inner_label, work.inner_opening,
        )  # fmt: skip
        last = left
    scale_impulses(nominal_h / last, pairs, impulses)
