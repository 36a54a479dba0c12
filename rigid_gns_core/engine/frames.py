# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames one after the other: laws, energy guard, sleep; few spheres in the air only fly."""

from __future__ import annotations

from .clearance import flies_clear_of_surface, fly_clear_of_each_other, margin_of_flight
from .flight import fly_one
from .frame import advance
from .guard import limit_energy
from .islands import Islands
from .motion import Settings
from .plane_motion import advance_planes
from .sleep import put_to_sleep, Sleepers
from .spheres import is_finite, part_of, Spheres, store
from .warm_start import no_contacts, WarmStart
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.vector import length, row

# with more spheres, that no two of them meet costs as much as to find those that may
FEW = 8


@compiled
def advance_frames(
    world: World,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    until_flight: bool,
    first: int,
    sleepers_out: Sleepers,
    frames_out: Spheres,
) -> tuple[int, bool, WarmStart, int, float]:
    """Write frames from the `first` on into `frames_out`, shapes (frames, n, k).

    Up to one that is not finite; with `until_flight`, to one in which all only fly.

    Returns how many there are then, whether all are finite, the warm start, how many islands the
    guard limited, and the energy it took.
    """
    acted, removed = 0, 0.0
    for frame in range(first, len(frames_out.positions)):
        after = part_of(frames_out, frame)
        if only_fly(world, spheres, dt, sleeps, sleepers_out, after):
            warm_start = no_contacts()
            if not is_finite(after):
                return frame, False, warm_start, acted, removed
            if until_flight:
                return frame + 1, True, warm_start, acted, removed
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
            return frame, False, warm_start, acted, removed
        acted += held
        removed += taken
        store(after, frame, frames_out)
        spheres = after
    return len(frames_out.positions), True, warm_start, acted, removed


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
def only_fly(
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
    if count > FEW:
        return False
    for i in range(count):
        if sleepers_out.asleep[i]:
            return False
    for i in range(count):
        fly_one(world, before, i, True, dt, after_out)
        velocity = row(before.velocities, i)
        light, margin = margin_of_flight(world, i, velocity, row(after_out.velocities, i), dt)
        if not light:
            return False
        for plane in range(len(world.point)):
            if not flies_clear_of_surface(world, plane, before, after_out, i, margin, dt):
                return False
        for j in range(i):
            velocity, after = row(before.velocities, j), row(after_out.velocities, j)
            _, other = margin_of_flight(world, j, velocity, after, dt)
            if not fly_clear_of_each_other(before, after_out, i, j, margin + other):
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
