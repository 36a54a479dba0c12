# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames one after the other: laws, energy guard, sleep; few spheres in the air only fly."""

from __future__ import annotations

from .broad_phase import PAD
from .flight import fly_one
from .frame import advance
from .guard import limit_energy
from .islands import Islands
from .motion import Settings
from .plane_motion import advance_planes, speed_of_plane
from .sleep import put_to_sleep, Sleepers
from .solids import is_near_solid, is_solid
from .spheres import is_finite, part_of, Spheres, store
from .warm_start import no_contacts, WarmStart
from .world import weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.vector import dot, length, minus, row, Vector

# with more spheres, that no two of them meet costs as much as to find those that may
_FEW = 8
# margin [radii] within which a sphere counts as touched here; more than that of the engine
_MARGIN = 2.0 * PAD


@compiled
def advance_frames(
    world: World,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    sleepers_out: Sleepers,
    frames_out: Spheres,
) -> tuple[int, WarmStart, int, float]:
    """Write frames into `frames_out`, shapes (frames, n, k), up to one that is not finite.

    Returns how many there are, the warm start, how many islands the guard limited, and the energy
    it took.
    """
    acted, removed = 0, 0.0
    for frame in range(len(frames_out.positions)):
        after = part_of(frames_out, frame)
        if _only_fly(world, spheres, dt, sleeps, sleepers_out, after):
            warm_start = no_contacts()
            if not is_finite(after):
                return frame, warm_start, acted, removed
            spheres = after
            continue
        after, warm_start, islands = advance(
            world, spheres, dt, warm_start, settings, sleepers_out
        )
        held, taken = _finish(
            world=world,
            before=spheres,
            islands=islands,
            dt=dt,
            guards=guards,
            sleeps=sleeps,
            after_out=after,
            sleepers_out=sleepers_out,
        )
        if not is_finite(after):
            return frame, warm_start, acted, removed
        acted += held
        removed += taken
        store(after, frame, frames_out)
        spheres = after
    return len(frames_out.positions), warm_start, acted, removed


@compiled
def _finish(
    world: World,
    before: Spheres,
    islands: Islands,
    dt: float,
    guards: bool,
    sleeps: bool,
    after_out: Spheres,
    sleepers_out: Sleepers,
) -> tuple[int, float]:
    """Guard and sleep; returns how many islands the guard limited, and the energy it took."""
    acted, removed = 0, 0.0
    if guards:
        acted, removed = limit_energy(world, before, islands, dt, after_out)
    if sleeps:
        put_to_sleep(world.radius[:-1], islands, dt, after_out, sleepers_out)
    return acted, removed


@in_place
def _only_fly(
    world: World,
    before: Spheres,
    dt: float,
    sleeps: bool,
    sleepers_out: Sleepers,
    after_out: Spheres,
) -> bool:
    """Fly few spheres for a frame in which none can touch anything; False where one might.

    The same bytes as `frame.advance` gives, which lets what touches nothing fly in one step, too,
    but at the cost of its search: this is for the samples of a forecast.
    """
    count = len(before.positions)
    if count > _FEW:
        return False
    for i in range(count):
        if sleepers_out.asleep[i]:
            return False
    for i in range(count):
        fly_one(world, before, i, True, dt, after_out)
        # heavy drag, which bends a path more than the margin holds
        change = minus(row(after_out.velocities, i), row(before.velocities, i))
        if world.in_air and 2.0 * length(change) > length(row(before.velocities, i)):
            return False
        margin = (1.0 + _MARGIN) * world.radius[i] + _sag(world, before, after_out, i, dt)
        for plane in range(len(world.point)):
            p, q = row(before.positions, i), row(after_out.positions, i)
            moved = 0.0
            if world.moving:
                speed = max(speed_of_plane(world, plane, p), speed_of_plane(world, plane, q))
                moved = 1.1 * speed * dt  # its path bends as it turns
            if not _is_clear(world, plane, p, q, margin + moved):
                return False
        for j in range(i):
            if not _pass_clear(world, before, after_out, i, j, dt):
                return False
    if sleeps:
        for i in range(count):
            spin = length(row(after_out.angular_velocities, i))
            speed = length(row(after_out.velocities, i))
            if max(speed, world.radius[i] * spin) < sleepers_out.threshold[i]:
                return False  # one that is quiet is counted
        for i in range(count):
            sleepers_out.quiet[i] = 0
    advance_planes(world, dt)
    return True


@in_place
def _sag(world: World, before: Spheres, after: Spheres, i: int, dt: float) -> float:
    """How far a path may be from the straight line between its ends: max |a| dt^2 / 8.

    |a| is at most the weight and four times the mean change of the velocity by air.
    """
    change = length(minus(row(after.velocities, i), row(before.velocities, i)))
    return 0.125 * dt * (weight_of(world) * dt + 4.0 * change)


@in_place
def _is_clear(world: World, plane: int, p: Vector, q: Vector, margin: float) -> bool:
    """Whether all of the way from p to q is farther than `margin` from a plane."""
    if is_solid(world, plane):
        return not is_near_solid(world, plane, p, margin + length(minus(q, p)))
    axes, point = world.axes[plane], row(world.point, plane)
    begin, end = minus(p, point), minus(q, point)
    first, last = dot(row(axes, 2), begin), dot(row(axes, 2), end)
    if min(first, last) > margin:
        return True
    if not world.two_sided[plane]:
        return False
    if max(first, last) < -margin:
        return True
    for axis in range(2):
        edge = world.half[plane, axis] + margin
        first, last = dot(row(axes, axis), begin), dot(row(axes, axis), end)
        if min(first, last) > edge or max(first, last) < -edge:
            return True
    return False


@in_place
def _pass_clear(world: World, before: Spheres, after: Spheres, i: int, j: int, dt: float) -> bool:
    """Whether spheres i and j cannot meet, wherever they are on their ways."""
    near = (1.0 + _MARGIN) * (world.radius[i] + world.radius[j])
    near += _sag(world, before, after, i, dt) + _sag(world, before, after, j, dt)
    near += length(minus(row(after.positions, i), row(before.positions, i)))
    near += length(minus(row(after.positions, j), row(before.positions, j)))
    return length(minus(row(before.positions, i), row(before.positions, j))) > near
