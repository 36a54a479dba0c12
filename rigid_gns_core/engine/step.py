# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step in time: narrow phase, solver, free flight, push-out, containment."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates
from .contact_law import law_of
from .contacts import find_contacts
from .containment import keep_sides
from .couplings import find_couplings
from .direct import new_pivots
from .events import has_event, MOST_OF_EVENTS, opening_time
from .flight import accelerations_of, fly_in_place, Paths, slow_spins
from .groups import by_island
from .impulses import Bodies, copy_impulse, Impulses, no_impulses
from .islands import connect, Islands
from .overlap import push_out
from .residuals import new_state
from .solver import solve, solve_isolated
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..scenes.state import Array


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
    contacts, begin = by_island(contacts, count)
    isolated, law = begin[0], law_of(world, contacts)
    bodies = _bodies(motion, mean, h)
    impulses, start, state = no_impulses(size), no_impulses(size), new_state(size)
    for k in range(isolated, size):
        copy_impulse(impulses_out, contacts.candidate[k], start, k)
    solve_isolated(
        world=world,
        contacts=contacts,
        law=law,
        start=start,
        last=isolated,
        accelerations=path,
        h=h,
        nominal_h=nominal_h,
        state_out=state,
        bodies_out=bodies,
        impulses_out=impulses,
    )
    # by island, so that none depends on what happens elsewhere
    couplings, scratch = find_couplings(world, contacts, law, begin), new_pivots()
    for island in range(len(begin) - 1):
        solve(
            world=world,
            contacts=contacts,
            law=law,
            couplings=couplings,
            start=start,
            first=begin[island],
            last=begin[island + 1],
            accelerations=path,
            h=h,
            nominal_h=nominal_h,
            iterations=iterations,
            scratch_out=scratch,
            state_out=state,
            bodies_out=bodies,
            impulses_out=impulses,
        )
    events = 0
    for island in range(isolated + len(begin) - 1):
        first, last = island, island + 1
        if island >= isolated:
            first, last = begin[island - isolated], begin[island - isolated + 1]
        if h == 0 or last - first > MOST_OF_EVENTS:
            continue
        opening, has = math.inf, False
        for k in range(first, last):
            has |= has_event(world, contacts, k, h, nominal_h, last - first > 1)
            before = impulses_out.normal[contacts.candidate[k]]
            time = opening_time(contacts, law, bodies, k, before, impulses.normal[k], last_h, h)
            opening = min(opening, time)
        if has or 0 < opening < h or (h < nominal_h and opening < nominal_h):
            for k in range(first, last):
                label_out[contacts.a[k]] = events
                if contacts.b[k] < count:
                    label_out[contacts.b[k]] = events
            opening_out[events] = opening
            events += 1
    positions = p.copy()
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
    keep_sides(world, candidates, positions, speeds, h, p, v)
    return events


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
    )


@in_place
def _clear(impulses_out: Impulses) -> None:
    impulses_out.normal[:] = 0.0
    impulses_out.tangential[:] = 0.0
    impulses_out.rolling[:] = 0.0
