# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Islands at rest sleep: they cost nothing and do not creep. What may touch them wakes them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .candidates import Candidates, find_candidates
from .islands import groups_of, Islands
from .spheres import Spheres
from .world import World
from ..kernels.jit import compiled
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import length, minus, put, row
from ..scenes.state import Array

# a sphere is quiet below this speed [sqrt(g r)], also at its surface ..
_SPEED = 1.6e-3
# .. for so many frames, in which it ends within this part of what it could go at that speed
_FRAMES = 5
_DRIFT = 0.2


class Sleepers(NamedTuple):
    """Which spheres sleep; shape (n,) each.

    asleep: whether it sleeps; island: number of what it fell asleep with; quiet: frames that it
    has been quiet; place: where that began, shape (n, 3); limit: speed below which it is quiet;
    names: how many islands have fallen asleep, shape (1,).
    """

    asleep: Flags
    island: Indices
    quiet: Indices
    place: Array
    limit: Array
    names: Indices


def all_awake(radius: Array, gravity: float) -> Sleepers:
    """Nothing sleeps; without gravity nothing ever will."""
    count = len(radius)
    return Sleepers(
        asleep=np.zeros(count, np.bool_),
        island=np.full(count, -1),
        quiet=np.zeros(count, np.int64),
        place=np.zeros((count, 3)),
        limit=_SPEED * np.sqrt(gravity * radius),
        names=np.zeros(1, np.int64),
    )


@compiled
def wake(
    world: World, positions: Array, velocities: Array, dt: float, sleepers_out: Sleepers
) -> tuple[Candidates, Flags]:
    """Candidates of the frame to come, and who is awake in it.

    A sleeper wakes with all its island where a sphere that is awake might touch it.
    """
    sleepers = sleepers_out
    while True:
        awake = ~sleepers.asleep
        candidates = find_candidates(world, positions, velocities, dt, awake, positions)
        called = np.zeros(sleepers.names[0], np.bool_)
        for k in range(len(candidates.a)):
            if candidates.plane[k] < 0:
                for i in (candidates.a[k], candidates.b[k]):
                    if sleepers.asleep[i]:
                        called[sleepers.island[i]] = True
        if not called.any():
            return candidates, awake
        for i in range(len(awake)):
            if sleepers.asleep[i] and called[sleepers.island[i]]:
                sleepers.asleep[i] = False


@compiled
def put_to_sleep(
    radius: Array, islands: Islands, dt: float, after_out: Spheres, sleepers_out: Sleepers
) -> None:
    """Put islands to sleep that have been quiet; they get no velocity."""
    sleepers, after = sleepers_out, after_out
    count = len(sleepers.asleep)
    ready = np.zeros(count, np.bool_)
    for i in range(count):
        if sleepers.asleep[i]:
            ready[i] = True
            continue
        speed = length(row(after.velocities, i))
        surface = radius[i] * length(row(after.angular_velocities, i))
        if max(speed, surface) >= sleepers.limit[i]:
            sleepers.quiet[i] = 0
            continue
        if sleepers.quiet[i] == 0:
            put(sleepers.place, i, row(after.positions, i))
        sleepers.quiet[i] += 1
        if sleepers.quiet[i] <= _FRAMES:
            continue
        drift = length(minus(row(after.positions, i), row(sleepers.place, i)))
        if drift < _DRIFT * sleepers.limit[i] * _FRAMES * dt:
            ready[i] = islands.touched[i]
        else:
            sleepers.quiet[i] = 0
    if not ready.any():
        return
    groups = groups_of(islands)
    for island in range(len(groups.grounded)):
        members = groups.members[groups.start[island] : groups.start[island + 1]]
        if not groups.grounded[island] or not ready[members].all():
            continue
        for i in members:
            if not sleepers.asleep[i]:
                sleepers.asleep[i] = True
                sleepers.island[i] = sleepers.names[0]
                put(after.velocities, i, (0.0, 0.0, 0.0))
                put(after.angular_velocities, i, (0.0, 0.0, 0.0))
        sleepers.names[0] += 1
