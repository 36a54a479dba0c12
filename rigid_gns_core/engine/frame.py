# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One frame: K substeps of the spheres that may touch something, free flight of all others."""

from __future__ import annotations

import numpy as np

from .broad_phase import Candidates, find_candidates, PAD
from .contacts import find_contacts
from .containment import keep_sides
from .flight import fly, Paths, reach_in_wind, reach_of
from .impulses import no_impulses
from .islands import Islands, join, no_islands
from .overlap import push_out
from .sleep import Sleepers, wake
from .spheres import copy_spheres, Spheres
from .step import copy_motion, Motion, Settings
from .substep import substep
from .warm_start import active_impulses, impulses_of, WarmStart, with_sleepers
from .world import UNIT_GRAVITY, weight_of, World, world_among
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.quaternions import turn
from ..kernels.vector import length, minus, put, row
from ..scenes.state import Array

# most corrections after the last substep, of collisions on paths that contacts bent within it
_CORRECTIONS = 3
# iterations of the solver that find the impulses of a start, where there is no warm start
_COLD_ITERATIONS = 60


@compiled
def advance(
    world: World,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    sleepers_out: Sleepers,
) -> tuple[Spheres, WarmStart, Islands]:
    """Spheres a frame later, the warm start of the next frame, and the islands in contact.

    Args:
        world: What does not move.
        spheres: State at the start of the frame.
        dt: Length of the frame.
        warm_start: Impulses of the last frame.
        settings: Substeps and iterations.
        sleepers_out: Who sleeps; those that wake are changed.
    """
    candidates, awake = wake(world, spheres.positions, spheres.velocities, dt, sleepers_out)
    islands, h, started = no_islands(len(awake)), dt / settings.substeps, 0
    now, after, old = spheres, copy_spheres(spheres), warm_start
    if len(candidates.a) == 0:
        fly(world, spheres, islands.touched, awake, dt, after)
        nothing = WarmStart(key=np.zeros(0, np.int64), impulses=no_impulses(0), known=True)
        return after, with_sleepers(nothing, old, awake, len(world.point)), islands
    while True:
        # only spheres that may touch something take part, with indices of their own
        members, local = _members(candidates, len(awake))
        members_world = world_among(world, members)
        members_islands = no_islands(len(members))
        motion = Motion(
            positions=now.positions[members],
            velocities=now.velocities[members],
            angular_velocities=now.angular_velocities[members],
            awake=awake[members],
        )
        impulses, quaternions = impulses_of(warm_start, candidates.key), now.quaternions[members]
        every = np.ones(len(local.a), np.bool_)
        if not warm_start.known:  # at a start: a substep of a copy, for its impulses
            substep(
                world=members_world,
                candidates=local,
                chosen=every,
                h=h,
                nominal_h=h,
                iterations=_COLD_ITERATIONS,
                motion_out=copy_motion(motion),
                impulses_out=impulses,
                islands_out=no_islands(len(members)),
            )
        start, reach, done = motion.positions.copy(), _reaches(members_world, motion, dt), started
        while done < settings.substeps and not _outrun(
            members_world, motion, start, reach, dt - done * h
        ):
            substep(
                world=members_world,
                candidates=local,
                chosen=every,
                h=h,
                nominal_h=h,
                iterations=settings.iterations,
                motion_out=motion,
                impulses_out=impulses,
                islands_out=members_islands,
            )
            for i in range(len(quaternions)):
                turn(quaternions, i, row(motion.angular_velocities, i), h)
            done += 1
        outran = _outrun(members_world, motion, start, reach, dt - done * h)
        for _ in range(0 if outran else _CORRECTIONS):
            missed = _missed_contacts(members_world, motion, local, h)
            if not missed.any():
                break
            substep(
                world=members_world,
                candidates=local,
                chosen=missed,
                h=0.0,
                nominal_h=h,
                iterations=settings.iterations,
                motion_out=motion,
                impulses_out=no_impulses(len(missed)),
                islands_out=members_islands,
            )
            _separate(members_world, motion, local, every)
        _scatter(motion, quaternions, members_islands, members, after, islands)
        if not outran and started == 0:
            break
        fly(world, now, _flags(members, len(awake)), awake, (done - started) * h, after)
        if not outran:
            break
        now, after, started = after, copy_spheres(after), done
        warm_start = WarmStart(key=candidates.key, impulses=impulses, known=True)
        candidates = find_candidates(world, now.positions, now.velocities, dt, awake)
    # spheres without contact fly in one step from the start of the frame
    fly(world, spheres, islands.touched, awake, dt, after)
    new = active_impulses(candidates.key, impulses)
    return after, with_sleepers(new, old, awake, len(world.point)), islands


@compiled
def _members(candidates: Candidates, count: int) -> tuple[Indices, Candidates]:
    """Spheres that have candidates, and the candidates with indices into these."""
    taken = np.zeros(count + 1, np.bool_)
    for k in range(len(candidates.a)):
        taken[candidates.a[k]] = taken[candidates.b[k]] = True
    taken[count] = False
    members = np.flatnonzero(taken)
    place = np.full(count + 1, len(members))
    for m in range(len(members)):
        place[members[m]] = m
    local = Candidates(
        a=place[candidates.a], b=place[candidates.b], plane=candidates.plane, key=candidates.key
    )
    return members, local


@compiled
def _flags(members: Indices, count: int) -> Flags:
    flags = np.zeros(count, np.bool_)
    flags[members] = True
    return flags


@compiled
def _reaches(world: World, motion: Motion, dt: float) -> Array:
    """Reach of each sphere, within which its candidates are."""
    weight = weight_of(world)
    reach = np.empty(len(motion.awake))
    for i in range(len(reach)):
        reach[i] = reach_of(length(row(motion.velocities, i)), weight, dt)
        if world.in_air:
            reach[i] += reach_in_wind(world, i, row(motion.velocities, i), weight, dt)
    return reach


@in_place
def _outrun(world: World, motion: Motion, start: Array, reach: Array, left: float) -> bool:
    """Whether a sphere that was struck may leave its reach in the time `left` of the frame."""
    for i in range(len(reach)):
        gone = length(minus(row(motion.positions, i), row(start, i)))
        if (
            gone + length(row(motion.velocities, i)) * left
            > reach[i] + 0.5 * PAD * world.radius[i]
        ):
            return True
    return False


@compiled
def _missed_contacts(world: World, motion: Motion, candidates: Candidates, h: float) -> Flags:
    """Candidates of bodies that overlap and approach, since contacts bent their paths."""
    count, size = len(motion.awake), len(candidates.a)
    every, missed = np.ones(size, np.bool_), np.zeros(size, np.bool_)
    paths = Paths(motion.positions, motion.velocities, world.pull)
    contacts = find_contacts(world, paths, candidates, every, 0.0, h)
    hit = np.zeros(count + 1, np.bool_)
    for k in range(len(contacts.a)):
        if contacts.time[k] < 0 and contacts.approach_speed[k] > UNIT_GRAVITY * h:
            hit[contacts.a[k]] = hit[contacts.b[k]] = True
    hit[count] = False
    for k in range(size):
        missed[k] = hit[candidates.a[k]] or hit[candidates.b[k]]
    return missed


@compiled
def _separate(world: World, motion: Motion, candidates: Candidates, every: Flags) -> None:
    """Push out overlaps among all candidates, also those that a correction left out."""
    paths = Paths(motion.positions, motion.velocities, world.pull)
    contacts = find_contacts(world, paths, candidates, every, 0.0, 0.0)
    before = motion.positions.copy()
    push_out(world, contacts, motion.positions)
    still = np.zeros(len(before))
    keep_sides(world, candidates, before, still, 0.0, motion.positions, motion.velocities)


@in_place
def _scatter(
    motion: Motion,
    quaternions: Array,
    members_islands: Islands,
    members: Indices,
    spheres_out: Spheres,
    islands_out: Islands,
) -> None:
    """Write the state of the members into that of all spheres."""
    for m in range(len(members)):
        i = members[m]
        put(spheres_out.positions, i, row(motion.positions, m))
        put(spheres_out.velocities, i, row(motion.velocities, m))
        put(spheres_out.angular_velocities, i, row(motion.angular_velocities, m))
        for part in range(4):
            spheres_out.quaternions[i, part] = quaternions[m, part]
    join(members_islands, members, islands_out)
