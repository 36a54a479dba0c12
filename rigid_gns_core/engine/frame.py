# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One frame: K substeps of the spheres that may touch something, free flight of all others.

A sphere that touches nothing flies in one step from the start of the frame.
"""

from __future__ import annotations

import numpy as np

from .broad_phase import Candidates, find_candidates, PAD
from .contacts import find_impacts
from .flight import fly, Paths, reach_in_wind, reach_of
from .free_groups import without_free_groups
from .groups import contacts_by_island
from .impulses import Impulses, no_impulses
from .islands import Islands, join, no_islands
from .motion import copy_motion, Motion, Settings
from .plane_bodies import bodies_of_planes
from .plane_motion import advance_planes, set_clock
from .separation import separate_once
from .sleep import Sleepers, wake
from .spheres import copy_spheres, replace_others, Spheres
from .substep import substep
from .warm_start import active_impulses, impulses_of, no_contacts, WarmStart, with_sleepers
from .workspace import has_room, new_workspace, Workspace, workspace_among
from .world import UNIT_GRAVITY, weight_of, World, world_among
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.quaternions import turn_all
from ..kernels.vector import length, minus, put, row
from ..scenes.state import Array

# most corrections after the last substep, of collisions on paths that contacts bent within it
_CORRECTIONS = 3
# overlaps [radii] that are pushed out at the end of a frame, among all candidates
_DEEP = 2e-3
# with more candidates of two spheres than this, they are looked for anew after so many substeps,
# so far out [radii] that few blows lead a sphere beyond: it was after nearly each substep before
_MANY, _PART, _SPARE = 2000, 2, 0.15
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
    now, free, old = spheres, copy_spheres(spheres), warm_start
    clock = world.twists.clock[0]
    fly(world, spheres, islands.touched, awake, dt, free)
    near = weight_of(world) * h**2
    candidates = without_free_groups(world, candidates, spheres, free, awake, dt, near)
    if len(candidates.a) == 0:
        advance_planes(world, dt)
        return free, with_sleepers(no_contacts(), old, awake, len(world.point)), islands
    after = copy_spheres(free)
    # for how long candidates hold, and how much farther out they are
    part, span, spare = settings.substeps, dt, 0.0
    if candidates.pairs > _MANY:
        part, spare = min(_PART, part), _SPARE
        span = part * h
        candidates = find_candidates(
            world, spheres.positions, spheres.velocities, span, awake, spare
        )
    members, local = _members(candidates, len(awake))
    moved = bodies_of_planes(world, local.plane)
    room = new_workspace(len(members), 1 + moved, local)
    while True:
        # only spheres that may touch something take part, with indices of their own
        members_world = world_among(world, members, 1 + moved)
        members_islands = no_islands(len(members))
        motion = Motion(
            positions=now.positions[members],
            velocities=now.velocities[members],
            angular_velocities=now.angular_velocities[members],
            awake=awake[members],
            work=np.zeros(len(members)),
        )
        impulses, quaternions = impulses_of(warm_start, candidates.key), now.quaternions[members]
        work = workspace_among(room, len(members), len(local.a))
        if not warm_start.known:  # at a start: a substep of a copy, for its impulses
            substep(
                world=members_world,
                candidates=local,
                chosen=work.every,
                h=h,
                nominal_h=h,
                iterations=_COLD_ITERATIONS,
                work_out=work,
                motion_out=copy_motion(motion),
                impulses_out=impulses,
                islands_out=no_islands(len(members)),
            )
            set_clock(world, clock)
        start, reach = motion.positions.copy(), _reaches(members_world, motion, span, spare)
        until = min(started + part, settings.substeps)
        done = _advance_part(
            members_world, local, start, reach, h, settings, started, until, work, motion,
            quaternions, impulses, members_islands,
        )  # fmt: skip
        again = done < settings.substeps or outrun(members_world, motion, start, reach, 0.0)
        for _ in range(0 if again else _CORRECTIONS):
            missed, deep = find_missed(members_world, motion, local, h, work)
            if not (missed or deep):
                break
            if missed:
                substep(
                    world=members_world,
                    candidates=local,
                    chosen=work.missed,
                    h=0.0,
                    nominal_h=h,
                    iterations=settings.iterations,
                    work_out=work,
                    motion_out=motion,
                    impulses_out=no_impulses(len(local.a)),
                    islands_out=members_islands,
                )
            separate_once(
                members_world, motion.positions, motion.velocities, local, work, members_islands
            )
        _scatter(motion, quaternions, members_islands, members, after, islands)
        if not again and started == 0:
            break
        fly(world, now, _flags(members, len(awake)), awake, (done - started) * h, after)
        if not again:
            break
        now, after, started = after, copy_spheres(after), done
        warm_start = WarmStart(key=candidates.key, impulses=impulses, known=True)
        candidates = find_candidates(world, now.positions, now.velocities, span, awake, spare)
        members, local = _members(candidates, len(awake))
        moved = bodies_of_planes(world, local.plane)
        if not has_room(room, len(members), 1 + moved, len(local.a)):
            room = new_workspace(len(members), 1 + moved, local)
    set_clock(world, clock + dt)
    replace_others(free, islands.touched, after)
    new = active_impulses(candidates.key, impulses)
    return after, with_sleepers(new, old, awake, len(world.point)), islands


@in_place
def _advance_part(
    world: World,
    candidates: Candidates,
    start: Array,
    reach: Array,
    h: float,
    settings: Settings,
    done: int,
    until: int,
    work_out: Workspace,
    motion_out: Motion,
    quaternions_out: Array,
    impulses_out: Impulses,
    islands_out: Islands,
) -> int:
    """Advance the members up to a substep, or until one outruns its reach; returns which is next.

    Args:
        world: Of the members.
        candidates: Of theirs.
        start: Their positions when the candidates were found, shape (m, 3).
        reach: From there, shape (m,).
        h: Length of a substep.
        settings: Substeps and iterations.
        done: Substeps before.
        until: Most substeps.
        work_out: Scratch.
        motion_out: Advanced.
        quaternions_out: Advanced, shape (m, 4).
        impulses_out: Impulses by candidate.
        islands_out: Contacts are added.
    """
    while done < until and not outrun(world, motion_out, start, reach, (until - done) * h):
        substep(
            world=world,
            candidates=candidates,
            chosen=work_out.every,
            h=h,
            nominal_h=h,
            iterations=settings.iterations,
            work_out=work_out,
            motion_out=motion_out,
            impulses_out=impulses_out,
            islands_out=islands_out,
        )
        # the rows of impacts are scratch of each substep
        turn_all(quaternions_out, motion_out.angular_velocities, h, work_out.impacts.rows)
        done += 1
    return done


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
        a=place[candidates.a],
        b=place[candidates.b],
        plane=candidates.plane,
        key=candidates.key,
        pairs=candidates.pairs,
    )
    return members, local


@compiled
def _flags(members: Indices, count: int) -> Flags:
    flags = np.zeros(count, np.bool_)
    flags[members] = True
    return flags


@compiled
def _reaches(world: World, motion: Motion, dt: float, spare: float) -> Array:
    """Reach of each sphere, within which its candidates are; see `find_candidates`."""
    weight = weight_of(world)
    reach = np.empty(len(motion.awake))
    for i in range(len(reach)):
        reach[i] = reach_of(length(row(motion.velocities, i)), weight, dt)
        reach[i] += spare * world.radius[i]
        if world.in_air:
            reach[i] += reach_in_wind(world, i, row(motion.velocities, i), weight, dt)
    return reach


@in_place
def outrun(world: World, motion: Motion, start: Array, reach: Array, left: float) -> bool:
    """Whether a sphere that was struck may leave its reach in the time `left` of the frame."""
    for i in range(len(reach)):
        gone = length(minus(row(motion.positions, i), row(start, i)))
        if (
            gone + length(row(motion.velocities, i)) * left
            > reach[i] + 0.5 * PAD * world.radius[i]
        ):
            return True
    return False


@in_place
def find_missed(
    world: World, motion: Motion, candidates: Candidates, h: float, work_out: Workspace
) -> tuple[bool, bool]:
    """Mark candidates of bodies that overlap and approach, since contacts bent their paths.

    Returns whether there are any, and whether any overlap is deep.
    """
    work, order = work_out, work_out.order
    paths = Paths(motion.positions, motion.velocities, world.flight)
    find_impacts(world, paths, candidates, work.every_pair, work.every, 0.0, h, work.impacts)
    size, _ = contacts_by_island(
        candidates, work.everyone, work.every_pair, work.impacts, order, work.contacts
    )
    contacts, hit, fixed = work.contacts, order.number, len(motion.awake)
    any_missed, deep = False, False
    hit[: fixed + 1] = 0
    for k in range(size):
        deep |= contacts.gap[k] < -_DEEP * world.radius[contacts.a[k]]
        if contacts.time[k] < 0 and contacts.approach_speed[k] > UNIT_GRAVITY * h:
            hit[contacts.a[k]] = hit[contacts.b[k]] = 1
    hit[fixed] = 0
    for k in work.every_pair:
        work.missed[k] = hit[candidates.a[k]] + hit[candidates.b[k]] > 0
        any_missed |= work.missed[k]
    return any_missed, deep


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
        islands_out.work[i] += motion.work[m]
    join(members_islands, members, islands_out)
