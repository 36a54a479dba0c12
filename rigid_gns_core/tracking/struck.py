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

from .jit import compiled
from ..kernels.neighbours import Flags, Indices
from ..scenes.state import Array

# another ball struck it where one was no farther than it moved in this time [s], beside the radii
_REACH = 0.05
# the motion before is seen until so long before [s], and over this time [s]; a ball that was not
# seen for longer rested if it is still at its place
_UNTIL, _OVER, _RESTED = 0.03, 0.06, 0.15
# deviation of the spin, as a speed at the equator: beside what friction of the balls gives it, as
# a part of the blow [m/s]
_LEAST, _PART = 0.1, 0.15


@compiled
def motion_before(
    times: Array,
    positions: Array,
    seen: Flags,
    radii: Array,
    ball: int,
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
        frames: Frames that show it since, 2 or more.
        before_out: Velocity [m/s], and deviation of the spin as a speed at the equator [m/s]; 0:
            it was not struck, or how it moved is not known. Shape (4,).
    """
    before_out[:] = 0.0
    first = frames[0]
    then = frames[min(3, len(frames) - 1)]
    place, later = positions[first, ball], positions[then, ball]
    span = times[then] - times[first]
    speed = 0.0
    for c in range(3):
        speed += (later[c] - place[c]) ** 2
    speed = math.sqrt(speed) / span
    struck = False
    for other in range(len(radii)):
        at = first
        while at >= 0 and not seen[at, other]:
            at -= 1
        if other == ball or at < 0:
            continue
        apart = 0.0
        for c in range(3):
            apart += (positions[at, other, c] - place[c]) ** 2
        struck = struck or math.sqrt(apart) < radii[ball] + radii[other] + _REACH * speed
    last = first - 1
    while last >= 0 and not (seen[last, ball] and times[last] <= times[first] - _UNTIL):
        last -= 1
    if not struck or last < 0:
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
    blow = 0.0
    for c in range(3):
        blow += ((later[c] - place[c]) / span - before_out[c]) ** 2
    before_out[3] = _LEAST + _PART * math.sqrt(blow)
