# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frame of few spheres that bounce or roll on faces of planes and stay apart, without its search.

The same substeps as in `frame.advance`, to the bit, on memory that is allocated once: in a frame
of one sphere that was half of the time. Substeps in which it is far from all planes only fly.
Where anything else happens (an edge, a path that is corrected, an energy that is limited, rest)
the general way decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates, PAD
from .clearance import is_clear, margin_of_flight
from .flight import find_accelerations, fly_in_place, fly_one, reach_in_wind, reach_of, slow_spins
from .frame import find_missed, outrun
from .guard import gain_of, ROUNDING
from .impulses import clear_impulses, copy_impulses, Impulses, no_impulses
from .islands import Islands, no_islands
from .motion import Motion, new_motion, Settings
from .spheres import Spheres
from .substep import substep
from .workspace import new_workspace, Workspace
from .world import weight_of, World, world_among
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.quaternions import turn
from ..kernels.vector import dot, length, minus, plus, put, row, times, Vector
from ..scenes.state import Array


class Lone(NamedTuple):
    """Memory of a frame of one sphere, but for the workspace, of which compilers copy each part.

    world: of it alone; candidates: it and each plane; motion, impulses, islands: as in
    `frame.advance`; before: impulses before the frame; start: where it was, shape (1, 3); reach:
    how far it may get, shape (1,); rotations: shape (1, 4); path, mean: accelerations in air,
    shape (1, 3); only, pairs: indices of the sphere and of all candidates; every: all flags.
    """

    world: World
    candidates: Candidates
    motion: Motion
    impulses: Impulses
    before: Impulses
    islands: Islands
    start: Array
    reach: Array
    rotations: Array
    path: Array
    mean: Array
    only: Indices
    pairs: Indices
    every: Flags


@compiled
def new_lone(world: World) -> tuple[Lone, Workspace]:
    """Memory for one sphere among the planes of a world that has spheres."""
    planes, first = len(world.point), np.zeros(1, np.int64)
    candidates = Candidates(
        a=np.zeros(planes, np.int64),
        b=np.ones(planes, np.int64),
        plane=np.arange(planes),
        key=1 + np.arange(planes),
        pairs=0,
    )
    lone = Lone(
        world=world_among(world, first, 1),
        candidates=candidates,
        motion=new_motion(1),
        impulses=no_impulses(planes),
        before=no_impulses(planes),
        islands=no_islands(1),
        start=np.empty((1, 3)),
        reach=np.empty(1),
        rotations=np.empty((1, 4)),
        path=np.empty((1, 3)),
        mean=np.empty((1, 3)),
        only=first,
        pairs=np.arange(planes),
        every=np.ones(planes, np.bool_),
    )
    return lone, new_workspace(1, 1, candidates)


@in_place
def bounce(
    world: World,
    before: Spheres,
    dt: float,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    threshold: Array,
    holds: bool,
    lone_out: Lone,
    work_out: Workspace,
    after_out: Spheres,
) -> tuple[bool, bool]:
    """Advance spheres by a frame, each by itself.

    Args:
        world: What does not move; no plane does.
        before: State at the start of the frame.
        dt: Length of the frame.
        settings: Substeps and iterations.
        guards: Whether no energy may rise.
        sleeps: Whether what is quiet may sleep.
        threshold: Speed below which a sphere is quiet, shape (n,).
        holds: Whether the only sphere touched planes in the last frame, with the impulses there.
        lone_out: Scratch.
        work_out: Scratch.
        after_out: State at the end; written.

    Returns:
        Whether this is all that happens; if not, the general way decides. And whether the only
        sphere touches planes at the end.
    """
    lone, own, motion, impulses = lone_out, lone_out.world, lone_out.motion, lone_out.impulses
    count, h, pairs, islands = len(threshold), dt / settings.substeps, lone.pairs, lone.islands
    start, reaches, rotations = lone.start, lone.reach, lone.rotations
    path, mean, only, candidates = lone.path, lone.mean, lone.only, lone.candidates
    if not holds:
        clear_impulses(pairs, impulses)
    copy_impulses(impulses, pairs, lone.before)
    if not _stay_apart(world, before, dt):
        return False, False
    for i in range(count):
        reach = _reach(world, before, i, dt)
        near, faces = _planes_within_reach(world, row(before.positions, i), world.radius[i], reach)
        if i > 0 or not near:
            clear_impulses(pairs, impulses)
        if not near:
            fly_one(world, before, i, True, dt, after_out)
            continue
        if not faces:
            return False, False
        _take_properties(world, i, own)
        _take_state(before, i, motion, rotations)
        put(start, 0, row(before.positions, i))
        reaches[0] = reach
        islands.touched[0] = islands.grounded[0] = False
        for done in range(settings.substeps):
            if outrun(own, motion, start, reaches, dt - done * h):
                return False, False
            if _only_fly(own, h, path, mean, only, motion):
                clear_impulses(pairs, impulses)
            else:
                substep(
                    world=own,
                    candidates=candidates,
                    chosen=lone.every,
                    h=h,
                    nominal_h=h,
                    iterations=settings.iterations,
                    work_out=work_out,
                    motion_out=motion,
                    impulses_out=impulses,
                    islands_out=islands,
                )
            turn(rotations, 0, row(motion.angular_velocities, 0), h)
        if outrun(own, motion, start, reaches, dt - settings.substeps * h):
            return False, False
        missed, deep = find_missed(own, motion, candidates, h, work_out)
        if missed or deep or (count > 1 and _touches(impulses)):
            return False, False
        if islands.touched[0]:
            _give_state(motion, rotations, i, after_out)
            _, gain, size = gain_of(world, before, after_out, i, dt)
            if guards and gain > ROUNDING * size:
                return False, False
        else:
            fly_one(world, before, i, True, dt, after_out)
    for i in range(count):
        speed, spin = row(after_out.velocities, i), row(after_out.angular_velocities, i)
        if sleeps and max(length(speed), world.radius[i] * length(spin)) < threshold[i]:
            return False, False
    return True, _touches(impulses)


@in_place
def _touches(impulses: Impulses) -> bool:
    """Whether any contact carries force."""
    found = False
    for normal in impulses.normal:
        found |= normal != 0
    return found


@in_place
def _reach(world: World, spheres: Spheres, i: int, dt: float) -> float:
    """How far sphere i may get in a frame."""
    velocity, weight = row(spheres.velocities, i), weight_of(world)
    reach = reach_of(length(velocity), weight, dt)
    if world.in_air:
        reach += reach_in_wind(world, i, velocity, weight, dt)
    return reach


@in_place
def _stay_apart(world: World, spheres: Spheres, dt: float) -> bool:
    """Whether no two spheres may touch in a frame."""
    for i in range(len(world.restitution)):
        extent = (1.0 + PAD) * world.radius[i] + _reach(world, spheres, i, dt)
        for j in range(i):
            other = (1.0 + PAD) * world.radius[j] + _reach(world, spheres, j, dt)
            apart = length(minus(row(spheres.positions, i), row(spheres.positions, j)))
            if apart <= extent + other:
                return False
    return True


@in_place
def _planes_within_reach(
    world: World, place: Vector, radius: float, reach: float
) -> tuple[bool, bool]:
    """Whether any plane is within reach, and whether all that are can be met on faces alone."""
    extent, near, faces = (1.0 + PAD) * radius + reach, False, True
    for plane in range(len(world.point)):
        axes, offset = world.axes[plane], minus(place, row(world.point, plane))
        height, beyond = dot(row(axes, 2), offset), -math.inf
        if world.two_sided[plane]:
            height = math.fabs(height)
            for axis in range(2):
                out = math.fabs(dot(row(axes, axis), offset)) - world.half[plane, axis]
                beyond = max(beyond, out)
        if height <= extent and beyond <= extent:
            near = True
            faces = faces and beyond < -reach
    return near, faces


@in_place
def _take_properties(world: World, i: int, own_out: World) -> None:
    """Make sphere i the one of a world of one sphere."""
    own_out.radius[0], own_out.inverse_mass[0] = world.radius[i], world.inverse_mass[i]
    own_out.inverse_inertia[0] = world.inverse_inertia[i]
    own_out.restitution[0], own_out.friction[0] = world.restitution[i], world.friction[i]
    own_out.rolling_friction[0] = world.rolling_friction[i]
    for column in range(world.flight.shape[1]):
        own_out.flight[0, column] = world.flight[i, column]


@in_place
def _take_state(spheres: Spheres, i: int, motion_out: Motion, rotations_out: Array) -> None:
    """Make the state of sphere i that of the only one."""
    put(motion_out.positions, 0, row(spheres.positions, i))
    put(motion_out.velocities, 0, row(spheres.velocities, i))
    put(motion_out.angular_velocities, 0, row(spheres.angular_velocities, i))
    motion_out.work[0] = 0.0
    for part in range(4):
        rotations_out[0, part] = spheres.quaternions[i, part]


@in_place
def _give_state(motion: Motion, rotations: Array, i: int, spheres_out: Spheres) -> None:
    """Make the state of the only sphere that of sphere i."""
    put(spheres_out.positions, i, row(motion.positions, 0))
    put(spheres_out.velocities, i, row(motion.velocities, 0))
    put(spheres_out.angular_velocities, i, row(motion.angular_velocities, 0))
    for part in range(4):
        spheres_out.quaternions[i, part] = rotations[0, part]


@in_place
def _only_fly(
    own: World, h: float, path_out: Array, mean_out: Array, only: Indices, motion_out: Motion
) -> bool:
    """Fly for a substep in which no plane is near; False, and nothing done, where one is.

    Args:
        own: World of one sphere.
        h: Length of the substep.
        path_out: Scratch, shape (1, 3).
        mean_out: Likewise.
        only: Index of the sphere, shape (1,).
        motion_out: Its motion.
    """
    p, v, w = motion_out.positions, motion_out.velocities, motion_out.angular_velocities
    path, mean = own.flight, own.flight
    if own.in_air:
        path, mean = path_out, mean_out
        find_accelerations(own, v, w, only, h, h, path, mean)
    end = plus(row(p, 0), times(h, plus(row(v, 0), times(0.5 * h, row(path, 0)))))
    after = plus(row(v, 0), times(h, row(mean, 0)))
    light, margin = margin_of_flight(own, 0, row(v, 0), after, h)
    margin += weight_of(own) * h**2  # bodies nearer than that are speculative contacts
    for plane in range(len(own.point)):
        if not is_clear(own, plane, row(p, 0), end, margin):
            return False
    if not light:
        return False
    if own.in_air:
        slow_spins(own, only, h, w)
    fly_in_place(path, mean, motion_out.awake, only, h, p, v)
    return True
