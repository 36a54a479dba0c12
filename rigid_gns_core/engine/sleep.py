# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sleep: islands at rest cost nothing and do not creep, until something may touch them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates, find_candidates
from .islands import groups_of, Islands
from .spheres import Spheres
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import length, minus, put, row
from ..scenes.state import Array

# sleep threshold: a sphere is quiet where max(v, r w) is below this [sqrt(g r)]
_THRESHOLD = 1.6e-3
# an island may sleep after more than so many quiet frames of all its spheres, if none has moved
# farther in them than this part of its path at the threshold
_FRAMES = 5
_DRIFT = 0.2


class Sleepers(NamedTuple):
    """Which spheres sleep; shape (n,) each.

    asleep: whether it sleeps; island: number of the island it fell asleep in; quiet: frames that
    it has been quiet; place: where that began, shape (n, 3); threshold: speed below which it is
    quiet; islands: how many have fallen asleep so far, shape (1,).
    """

    asleep: Flags
    island: Indices
    quiet: Indices
    place: Array
    threshold: Array
    islands: Indices


def all_awake(radius: Array, gravity: float) -> Sleepers:
    """Sleepers of a start: none. Without gravity the threshold is 0, and none ever will be."""
    count = len(radius)
    return Sleepers(
        asleep=np.zeros(count, np.bool_),
        island=np.full(count, -1),
        quiet=np.zeros(count, np.int64),
        place=np.zeros((count, 3)),
        threshold=_THRESHOLD * np.sqrt(gravity * radius),
        islands=np.zeros(1, np.int64),
    )


@in_place
def wake_all(sleepers_out: Sleepers) -> None:
    """Make them those of a start."""
    for i in range(len(sleepers_out.asleep)):
        sleepers_out.asleep[i] = False
        sleepers_out.island[i] = -1
        sleepers_out.quiet[i] = 0
    sleepers_out.islands[0] = 0


@compiled
def wake(
    world: World, positions: Array, velocities: Array, dt: float, sleepers_out: Sleepers
) -> tuple[Candidates, Flags]:
    """Candidates of the next frame, and who is awake in it.

    A sphere that is awake and might touch a sleeper wakes its island.
    """
    sleepers = sleepers_out
    while True:
        awake = ~sleepers.asleep
        candidates = find_candidates(world, positions, velocities, dt, awake, 0.0)
        woken = np.zeros(sleepers.islands[0], np.bool_)
        for k in range(len(candidates.a)):
            if candidates.plane[k] < 0:
                for i in (candidates.a[k], candidates.b[k]):
                    if sleepers.asleep[i]:
                        woken[sleepers.island[i]] = True
        if not woken.any():
            return candidates, awake
        for i in range(len(awake)):
            if sleepers.asleep[i] and woken[sleepers.island[i]]:
                sleepers.asleep[i] = False


@compiled
def put_to_sleep(
    radius: Array, islands: Islands, dt: float, after_out: Spheres, sleepers_out: Sleepers
) -> None:
    """Put quiet islands on surfaces to sleep; their velocities become zero."""
    sleepers, after = sleepers_out, after_out
    count = len(sleepers.asleep)
    ready = np.zeros(count, np.bool_)
    for i in range(count):
        if sleepers.asleep[i]:
            ready[i] = True
            continue
        speed = length(row(after.velocities, i))
        surface = radius[i] * length(row(after.angular_velocities, i))
        if max(speed, surface) >= sleepers.threshold[i]:
            sleepers.quiet[i] = 0
            continue
        if sleepers.quiet[i] == 0:
            put(sleepers.place, i, row(after.positions, i))
        sleepers.quiet[i] += 1
        if sleepers.quiet[i] <= _FRAMES:
            continue
        drift = length(minus(row(after.positions, i), row(sleepers.place, i)))
        if drift < _DRIFT * sleepers.threshold[i] * _FRAMES * dt:
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
                sleepers.island[i] = sleepers.islands[0]
                put(after.velocities, i, (0.0, 0.0, 0.0))
                put(after.angular_velocities, i, (0.0, 0.0, 0.0))
        sleepers.islands[0] += 1
