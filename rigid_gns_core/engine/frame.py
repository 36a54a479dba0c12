# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One frame: K substeps of the spheres that may touch something; all others fall."""

from __future__ import annotations

import numpy as np

from .candidates import Candidates, find_candidates, reach_of
from .contacts import find_contacts
from .impulses import no_impulses
from .islands import connect, Islands, no_islands
from .overlap import push_out
from .sleep import Sleepers, wake
from .spheres import copy_spheres, Spheres
from .substep import copy_motion, Motion, Settings, substep
from .warm_start import active_impulses, impulses_of, WarmStart, with_sleepers
from .world import UNIT_GRAVITY, World, world_among
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.quaternions import turn
from ..kernels.vector import dot, length, minus, put, row
from ..scenes.state import Array

# passes that correct collisions in paths that contacts bent within the last substep
_CORRECTIONS = 3
# of the solver, to find impulses of contacts that last, where none are known to warm start from
_COLD_ITERATIONS = 60


@compiled
def advance(
    world: World,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    sleepers: Sleepers,
) -> tuple[Spheres, WarmStart, Islands]:
    """Return the spheres a frame later, the impulses at its end, and the islands in contact.

    Args:
        world: What does not move.
        spheres: Before the frame.
        dt: Length of the frame.
        warm_start: Of the last frame.
        settings: How finely it is solved.
        sleepers: Who sleeps; some may wake.
    """
    candidates, awake = wake(world, spheres.positions, spheres.velocities, dt, sleepers)
    islands, h, started = no_islands(len(awake)), dt / settings.substeps, 0
    now, after, old = spheres, copy_spheres(spheres), warm_start
    if len(candidates.a) == 0:
        _fly(world, spheres, islands.touched, awake, dt, after)
        nothing = WarmStart(key=np.zeros(0, np.int64), impulses=no_impulses(0), known=True)
        return after, with_sleepers(nothing, old, awake, len(world.point)), islands
    while True:
        # only spheres that may touch something take part, numbered through
        members, local = _members(candidates, len(awake))
        part, own = world_among(world, members), no_islands(len(members))
        motion = Motion(
            positions=now.positions[members],
            velocities=now.velocities[members],
            angular_velocities=now.angular_velocities[members],
            awake=awake[members],
        )
        impulses, turning = impulses_of(warm_start, candidates.key), now.quaternions[members]
        every = np.ones(len(local.a), np.bool_)
        if not warm_start.known:  # a substep that only finds impulses
            substep(
                world=part,
                candidates=local,
                chosen=every,
                h=h,
                nominal_h=h,
                iterations=_COLD_ITERATIONS,
                motion_out=copy_motion(motion),
                impulses_out=impulses,
                islands_out=no_islands(len(members)),
            )
        start, reach, done = motion.positions.copy(), _reaches(world, motion, dt), started
        while done < settings.substeps and not _outrun(motion, start, reach, dt - done * h):
            substep(
                world=part,
                candidates=local,
                chosen=every,
                h=h,
                nominal_h=h,
                iterations=settings.iterations,
                motion_out=motion,
                impulses_out=impulses,
                islands_out=own,
            )
            for i in range(len(turning)):
                turn(turning, i, row(motion.angular_velocities, i), h)
            done += 1
        outran = _outrun(motion, start, reach, dt - done * h)
        for _ in range(0 if outran else _CORRECTIONS):
            missed = _missed_contacts(part, motion, local, h)
            if not missed.any():
                break
            substep(
                world=part,
                candidates=local,
                chosen=missed,
                h=0.0,
                nominal_h=h,
                iterations=settings.iterations,
                motion_out=motion,
                impulses_out=no_impulses(len(missed)),
                islands_out=own,
            )
            _separate(part, motion, local, every)
        _scatter(motion, turning, own, members, after, islands)
        if not outran and started == 0:
            break
        _fly(world, now, _flags(members, len(awake)), awake, (done - started) * h, after)
        if not outran:
            break
        now, after, started = after, copy_spheres(after), done
        warm_start = WarmStart(key=candidates.key, impulses=impulses, known=True)
        candidates = find_candidates(
            world, now.positions, now.velocities, dt, awake, spheres.positions
        )
    # spheres without contact keep the exact parabolas of their start
    _fly(world, spheres, islands.touched, awake, dt, after)
    new = active_impulses(candidates.key, impulses)
    return after, with_sleepers(new, old, awake, len(world.point)), islands


@compiled
def _members(candidates: Candidates, count: int) -> tuple[Indices, Candidates]:
    """Spheres of candidates, and the candidates by their place among them."""
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
        side=candidates.side,
        key=candidates.key,
    )
    return members, local


@compiled
def _flags(members: Indices, count: int) -> Flags:
    flags = np.zeros(count, np.bool_)
    flags[members] = True
    return flags


@compiled
def _reaches(world: World, motion: Motion, dt: float) -> Array:
    """How far each sphere's candidates were looked for."""
    weight = length((world.gravity[0], world.gravity[1], world.gravity[2]))
    reach = np.empty(len(motion.awake))
    for i in range(len(reach)):
        reach[i] = reach_of(length(row(motion.velocities, i)), weight, dt)
    return reach


@in_place
def _outrun(motion: Motion, start: Array, reach: Array, left: float) -> bool:
    """Whether a sphere that was struck may leave its reach, with `left` of the frame to go."""
    for i in range(len(reach)):
        gone = length(minus(row(motion.positions, i), row(start, i)))
        if gone + length(row(motion.velocities, i)) * left > reach[i] * 1.001 + 1e-3:
            return True
    return False


@compiled
def _missed_contacts(world: World, motion: Motion, candidates: Candidates, h: float) -> Flags:
    """Candidates around bodies that overlap and approach, met by paths that contacts bent."""
    count, size = len(motion.awake), len(candidates.a)
    every, missed = np.ones(size, np.bool_), np.zeros(size, np.bool_)
    contacts = find_contacts(world, motion.positions, motion.velocities, candidates, every, 0.0, h)
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
    """Undo overlaps, also with bodies that a correction had no contact with."""
    contacts = find_contacts(
        world, motion.positions, motion.velocities, candidates, every, 0.0, 0.0
    )
    push_out(world, contacts, motion.positions)


@in_place
def _scatter(
    motion: Motion,
    turning: Array,
    own: Islands,
    members: Indices,
    spheres_out: Spheres,
    islands_out: Islands,
) -> None:
    """Write the motion of the members among that of all spheres."""
    for m in range(len(members)):
        i = members[m]
        put(spheres_out.positions, i, row(motion.positions, m))
        put(spheres_out.velocities, i, row(motion.velocities, m))
        put(spheres_out.angular_velocities, i, row(motion.angular_velocities, m))
        for part in range(4):
            spheres_out.quaternions[i, part] = turning[m, part]
        if own.touched[m]:
            connect(islands_out, i, members[own.parent[m]])
            islands_out.grounded[i] |= own.grounded[m]


@in_place
def _fly(
    world: World, before: Spheres, others: Flags, awake: Flags, time: float, spheres_out: Spheres
) -> None:
    """Spheres not among `others` fly freely."""
    for i in range(len(others)):
        if others[i]:
            continue
        for axis in range(3):
            fall, speed = time * world.gravity[axis], before.velocities[i, axis]
            way = time * (speed + 0.5 * fall)
            if not awake[i]:
                way = fall = 0.0
            spheres_out.positions[i, axis] = before.positions[i, axis] + way
            spheres_out.velocities[i, axis] = speed + fall
        spin = row(before.angular_velocities, i)
        put(spheres_out.angular_velocities, i, spin)
        for part in range(4):
            spheres_out.quaternions[i, part] = before.quaternions[i, part]
        if dot(spin, spin) > 0:
            turn(spheres_out.quaternions, i, spin, time)
