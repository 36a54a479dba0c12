# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One substep: a step of all, and of small islands anew, from event to event.

A blow on a body that has other contacts takes no time: what holds the body acts until then, and
friction and gravity after it. So an island of few contacts is advanced to the blow, the blow is
solved alone, and then the rest. The same at an edge that a sphere rolls over. Islands of many
contacts, where blows follow one another without end, are not.
"""

from __future__ import annotations

import numpy as np

from .broad_phase import Candidates
from .contacts import find_contacts
from .containment import speeds_of
from .events import is_blow, NEAR, next_event
from .flight import accelerations_of, Paths
from .impulses import copy_impulse, copy_impulses, Impulses, no_impulses
from .islands import Islands, join, no_islands
from .step import copy_motion, Motion, step
from .world import World, world_among
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import counting_sort, Flags, Indices
from ..kernels.vector import put, row, times

# most events of an island within a substep; what follows is one step
_MOST_EVENTS = 12


@compiled
def substep(
    world: World,
    candidates: Candidates,
    chosen: Flags,
    h: float,
    nominal_h: float,
    iterations: int,
    motion_out: Motion,
    impulses_out: Impulses,
    islands_out: Islands,
) -> None:
    """Advance the motion by `h`; see `step`."""
    count = len(motion_out.positions)
    before, warm = copy_motion(motion_out), copy_impulses(impulses_out)
    label, opening = np.empty(count, np.int64), np.empty(count)
    events = step(
        world=world,
        candidates=candidates,
        chosen=chosen,
        h=h,
        path_h=h,
        last_h=nominal_h,
        nominal_h=nominal_h,
        iterations=iterations,
        speeds=speeds_of(before.velocities),
        motion_out=motion_out,
        impulses_out=impulses_out,
        islands_out=islands_out,
        label_out=label,
        opening_out=opening,
    )
    if events == 0:
        return
    spheres, first_sphere = counting_sort(label + 1, events + 1)
    pairs, first_pair = counting_sort(_labels_of_pairs(candidates, chosen, label) + 1, events + 1)
    for event in range(1, events + 1):
        _advance_by_events(
            world=world,
            candidates=candidates,
            members=spheres[first_sphere[event] : first_sphere[event + 1]],
            pairs=pairs[first_pair[event] : first_pair[event + 1]],
            opening=opening[event - 1],
            h=h,
            nominal_h=nominal_h,
            iterations=iterations,
            before=before,
            warm=warm,
            motion_out=motion_out,
            impulses_out=impulses_out,
            islands_out=islands_out,
        )


@compiled
def _labels_of_pairs(candidates: Candidates, chosen: Flags, label: Indices) -> Indices:
    """Number of the island that both bodies of each candidate belong to, else -1."""
    labels = np.full(len(candidates.a), -1)
    for k in range(len(labels)):
        own = label[candidates.a[k]]
        if chosen[k] and (candidates.plane[k] >= 0 or label[candidates.b[k]] == own):
            labels[k] = own
    return labels


@compiled
def _advance_by_events(
    world: World,
    candidates: Candidates,
    members: Indices,
    pairs: Indices,
    opening: float,
    h: float,
    nominal_h: float,
    iterations: int,
    before: Motion,
    warm: Impulses,
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
        before: Motion of all spheres at the start of the substep.
        warm: Impulses of the last substep, by candidate.
        motion_out: Motion of all spheres; that of the members is written.
        impulses_out: Impulses by candidate; those of the pairs are written.
        islands_out: Contacts are added.
    """
    place = np.full(len(before.positions) + 1, len(members))
    for m in range(len(members)):
        place[members[m]] = m
    local = Candidates(
        a=place[candidates.a[pairs]],
        b=place[candidates.b[pairs]],
        plane=candidates.plane[pairs],
        key=candidates.key[pairs],
    )
    here, islands = world_among(world, members), no_islands(len(members))
    motion = Motion(
        positions=before.positions[members],
        velocities=before.velocities[members],
        angular_velocities=before.angular_velocities[members],
        awake=before.awake[members],
    )
    impulses = Impulses(
        normal=warm.normal[pairs], tangential=warm.tangential[pairs], rolling=warm.rolling[pairs]
    )
    every, label = np.ones(len(pairs), np.bool_), np.empty(len(members), np.int64)
    opens = np.empty(len(members))
    left, last, speeds = h, nominal_h, speeds_of(motion.velocities)
    for _ in range(_MOST_EVENTS):
        path, _ = accelerations_of(here, motion.velocities, motion.angular_velocities, left, left)
        contacts = find_contacts(
            here, Paths(motion.positions, motion.velocities, path), local, every, left, nominal_h
        )
        time, blow = next_event(here, contacts, left, nominal_h)
        if h - left < opening < h - left + time:
            time, blow = opening - (h - left), False
        if time >= left:
            break
        if time > 0:
            chosen = every.copy()
            for k in range(len(contacts.a)):
                if is_blow(here, contacts, k, nominal_h):
                    chosen[contacts.candidate[k]] = False
            _scale(impulses, time / last)
            done = h - left
            found = step(
                here, local, chosen, time, left, last, nominal_h, iterations, speeds, motion,
                impulses, islands, label, opens,
            )  # fmt: skip
            left, last = left - time, time
            if found == 1 and done + opens[0] > h - left + NEAR * nominal_h:
                opening = done + opens[0]
        if blow:
            nothing = no_impulses(len(pairs))
            step(
                here, local, every, 0.0, 0.0, last, nominal_h, iterations, speeds, motion,
                nothing, islands, label, opens,
            )  # fmt: skip
    if left > 0:
        _scale(impulses, left / last)
        step(
            here, local, every, left, left, last, nominal_h, iterations, speeds, motion,
            impulses, islands, label, opens,
        )  # fmt: skip
        last = left
    _scale(impulses, nominal_h / last)
    for m in range(len(members)):
        i = members[m]
        put(motion_out.positions, i, row(motion.positions, m))
        put(motion_out.velocities, i, row(motion.velocities, m))
        put(motion_out.angular_velocities, i, row(motion.angular_velocities, m))
    join(islands, members, islands_out)
    for k in range(len(pairs)):
        copy_impulse(impulses, k, impulses_out, pairs[k])


@in_place
def _scale(impulses_out: Impulses, factor: float) -> None:
    """Impulses of forces that last, for a step of another length."""
    for k in range(len(impulses_out.normal)):
        impulses_out.normal[k] *= factor
        put(impulses_out.tangential, k, times(factor, row(impulses_out.tangential, k)))
        put(impulses_out.rolling, k, times(factor, row(impulses_out.rolling, k)))
