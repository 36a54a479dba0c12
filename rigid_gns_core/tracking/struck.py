# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a ball that another has struck had before: smooth balls keep their spin in the blow.

A ball at rest that is struck slides at first, without spin, and loses 2/7 of its velocity before
it rolls. The frames while it slides do not tell how long it will, as sliding friction is the same
at any slip. So the spin that it had before, that of rolling at the velocity before the blow, is
the prior of a window that begins at one.
"""

from __future__ import annotations

import math

import numpy as np

from .jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import length, minus, row, Vector
from ..kernels.vector import times as scaled
from ..scenes.state import Array

# two balls nearer than this many sums of radii may have touched
NEAR = 1.04
# another ball struck it where one was no farther than it moved in this time [s], beside the radii
_REACH = 0.05
# the motion before is seen until so long before [s], and over this time [s]; a ball that was not
# seen for longer rested if it is still at its place
_UNTIL, _OVER, _RESTED = 0.03, 0.06, 0.15
# deviation of the spin, as a speed at the equator: beside what friction of the balls gives it, as
# a part of the blow [m/s]
_LEAST, _PART = 0.1, 0.15


@compiled
def last_near(
    positions: Array, seen: Flags, radii: Array, begin: int, near_out: Indices, met_out: Indices
) -> None:
    """First frame after the last in which another ball was near.

    A ball that is not seen is where it was.

    Args:
        positions: As of `motion_before`, as the next two.
        seen: See there.
        radii: See there.
        begin: First frame of the memory.
        near_out: That frame for each ball, or `begin`, shape (n,).
        met_out: First frame after the last two between which another ball may have been near, as
            it came nearer by as much in the step before, or `begin`, and which that was, or -1;
            shape (n, 2).
    """
    m, n = seen.shape
    places, known = np.zeros((n, 3)), np.zeros(n, dtype=np.bool_)
    gaps = np.full((n, n), math.inf)
    near_out[:] = begin
    met_out[:, 0], met_out[:, 1] = begin, -1
    for frame in range(m):
        for i in range(n):
            if seen[frame, i]:
                places[i] = positions[frame, i]
                known[i] = True
        if frame < begin:
            continue
        for i in range(n):
            for j in range(i):
                if not (known[i] and known[j]):
                    continue
                apart = length(minus(row(places, i), row(places, j)))
                gap, before = apart - NEAR * (radii[i] + radii[j]), gaps[i, j]
                gaps[i, j] = gap
                if gap < 0.0:
                    near_out[i] = near_out[j] = frame + 1
                if gap < 0.0 or 2.0 * gap < before < math.inf:
                    met_out[i, 0] = met_out[j, 0] = frame + 1
                    met_out[i, 1], met_out[j, 1] = j, i


@in_place
def _velocity(times: Array, positions: Array, ball: int, frames: Indices) -> tuple[Vector, float]:
    """Velocity of a ball in the first frames since, and its speed."""
    first, then = frames[0], frames[min(3, len(frames) - 1)]
    step = minus(row(positions[then], ball), row(positions[first], ball))
    velocity = scaled(1.0 / (times[then] - times[first]), step)
    return velocity, length(velocity)


@in_place
def striker_of(
    times: Array, positions: Array, seen: Flags, radii: Array, ball: int, frames: Indices
) -> int:
    """The nearest ball that may have struck a ball before its frames, or -1.

    The arguments are as of `motion_before`.
    """
    first, striker = frames[0], -1
    _, speed = _velocity(times, positions, ball, frames)
    # of one that stopped in the blow, that of before
    last = first - 1
    while last >= 0 and not seen[last, ball]:
        last -= 1
    early = last - 1
    while early >= 0 and not seen[early, ball]:
        early -= 1
    if early >= 0:
        step = length(minus(row(positions[last], ball), row(positions[early], ball)))
        speed = max(speed, step / (times[last] - times[early]))
    nearest = _REACH * speed
    for other in range(len(radii)):
        at = first
        while at >= 0 and not seen[at, other]:
            at -= 1
        if other == ball or at < 0:
            continue
        apart = minus(row(positions[at], other), row(positions[first], ball))
        gap = length(apart) - radii[ball] - radii[other]
        if gap < nearest:
            striker, nearest = other, gap
    return striker


@compiled
def motion_before(
    times: Array,
    positions: Array,
    seen: Flags,
    radii: Array,
    ball: int,
    striker: int,
    frames: Indices,
    before_out: Array,
) -> None:
    """Velocity of a ball before another struck it, where that is known.

    Args:
        times: Rising times [s], shape (m,).
        positions: Centres [m], shape (m, n, 3).
        seen: Whether a ball is seen, shape (m, n).
        radii: Of the balls [m], shape (n,).
        ball: Number of the ball.
        striker: That of the one that struck it, or -1.
        frames: Frames that show it since, 2 or more.
        before_out: Velocity [m/s], and deviation of the spin as a speed at the equator [m/s]; 0:
            it was not struck, or how it moved is not known. Shape (4,).
    """
    before_out[:] = 0.0
    first, place = frames[0], positions[frames[0], ball]
    last = first - 1
    while last >= 0 and not (seen[last, ball] and times[last] <= times[first] - _UNTIL):
        last -= 1
    if striker < 0 or last < 0:
        return
    if times[first] - times[last] > _RESTED:
        moved = 0.0
        for c in range(3):
            moved += (place[c] - positions[last, ball, c]) ** 2
        if math.sqrt(moved) > radii[ball]:
            return
    else:
        early = last - 1
        while early >= 0 and not (seen[early, ball] and times[early] <= times[last] - _OVER):
            early -= 1
        if early < 0:
            return
        for c in range(3):
            step = positions[last, ball, c] - positions[early, ball, c]
            before_out[c] = step / (times[last] - times[early])
    now, _ = _velocity(times, positions, ball, frames)
    blow = length(minus(now, (before_out[0], before_out[1], before_out[2])))
    before_out[3] = _LEAST + _PART * blow
