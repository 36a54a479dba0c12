# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A window of frames, sphere by sphere, as sums from which lines follow."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import entry, in_place
from .line_fit import accumulate, COLUMNS, Flags
from ..kernels.vector import length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

# a sphere within so many radii, and standard deviations of noise, of something may touch it
_NEAR, _NEAR_SIGMAS = 0.02, 4.0
# collisions are sought in so many of the last intervals
INTERVALS = 2


class Observations(NamedTuple):
    """Frames of n spheres.

    Args:
        stamps: Times of the frames, the last is 0 [s], shape (frames,).
        seen: Whether a sphere was seen in a frame, at least once each, shape (n, frames).
        last: The last frame that shows a sphere, shape (n,).
        origin: Where it was there [m], shape (n, 3).
        offsets: Centres, less `origin`; 0 where not seen [m], shape (n, frames, 3).
        turned: Rotation vectors since the first frame [rad], shape (n, frames, 3).
        flights: Sums of offsets less the fall, shape (n, frames + 1, COLUMNS).
        straight: Sums of offsets.
        turns: Sums of rotation vectors.
        radii: [m], shape (n,).
        sigma: Noise [m], shape (n,).
        near: What is so near to a sphere's surface may touch it [m], shape (n,).
        touch: The same from its centre.
        met: As far from its centre may be what it has met lately [m], shape (n,).
    """

    stamps: Array
    seen: Flags
    last: NDArray[np.int64]
    origin: Array
    offsets: Array
    turned: Array
    flights: Array
    straight: Array
    turns: Array
    radii: Array
    sigma: Array
    near: Array
    touch: Array
    met: Array

    @classmethod
    def of(cls, stamps: Array, count: int, radii: Array, sigma: Array) -> Observations:
        """One to be filled, for `count` spheres."""
        frames = len(stamps)
        return cls(
            stamps=stamps,
            seen=np.empty((count, frames), dtype=bool),
            last=np.zeros(count, dtype=np.int64),
            origin=np.empty((count, 3)),
            offsets=np.zeros((count, frames, 3)),
            turned=np.zeros((count, frames, 3)),
            flights=np.empty((count, frames + 1, COLUMNS)),
            straight=np.empty((count, frames + 1, COLUMNS)),
            turns=np.empty((count, frames + 1, COLUMNS)),
            radii=radii,
            sigma=sigma,
            near=np.empty(count),
            touch=np.empty(count),
            met=np.empty(count),
        )


@entry
def fill(
    window: Observations, places: Array, turns: Array, shown: Flags, gravity: Vector, fallen: Array
) -> None:
    """Fill a window with frames.

    Args:
        window: One that is empty yet.
        places: Centres [m], shape (frames, n, 3).
        turns: Rotations (x, y, z, w), shape (frames, n, 4).
        shown: Whether a sphere was seen in a frame, shape (frames, n).
        gravity: Acceleration of free flight [m/s^2].
        fallen: Overwritten, shape (frames, 3).
    """
    stamps, frames = window.stamps, len(window.stamps)
    for i in range(len(window.last)):
        seen, offsets = window.seen[i], window.offsets[i]
        for frame in range(frames):
            seen[frame] = shown[frame, i]
            if seen[frame]:
                window.last[i] = frame
        put(window.origin, i, row(places[window.last[i]], i))
        for frame in range(frames):
            for axis in range(3):
                if seen[frame]:
                    offsets[frame, axis] = places[frame, i, axis] - window.origin[i, axis]
                fall = 0.5 * stamps[frame] ** 2 * gravity[axis]
                fallen[frame, axis] = offsets[frame, axis] - fall
        _add_turns(window.turned[i], turns, seen, i)
        accumulate(window.flights[i], stamps, fallen, seen, 0)
        accumulate(window.straight[i], stamps, offsets, seen, 0)
        accumulate(window.turns[i], stamps, window.turned[i], seen, 0)
        window.near[i] = _NEAR * window.radii[i] + _NEAR_SIGMAS * window.sigma[i]
        window.touch[i] = window.radii[i] + window.near[i]
        window.met[i] = window.radii[i] + _way(stamps, offsets, seen)


@in_place
def _way(stamps: Array, offsets: Array, seen: Flags) -> float:
    """How far a sphere may have come since it met another lately [m].

    Args:
        stamps: Times of the frames, the last is 0 [s], shape (frames,).
        offsets: Its centres, less where it was seen last [m], shape (frames, 3).
        seen: Whether it was seen in a frame, shape (frames,).
    """
    first = max(0, len(stamps) - INTERVALS - 1)
    fastest = 0.0
    for frame in range(max(first, 1), len(stamps)):
        if seen[frame] and seen[frame - 1]:
            step = length(minus(row(offsets, frame), row(offsets, frame - 1)))
            fastest = max(fastest, step / (stamps[frame] - stamps[frame - 1]))
    # half as fast again, as a step may have been there and back
    return float(-1.5 * stamps[first] * fastest)


@in_place
def _add_turns(turned: Array, turns: Array, seen: Flags, i: int) -> None:
    """Rotation vectors of sphere i since the first frame with it [rad], shape (frames, 3)."""
    before = -1
    total = (0.0, 0.0, 0.0)
    for frame in range(len(turned)):
        if seen[frame]:
            # summed increments: the total may pass half a turn, and to first order their noise
            # telescopes
            if before >= 0:
                total = plus(total, _rotation(turns[before, i], turns[frame, i]))
            before = frame
        put(turned, frame, total)


@in_place
def _rotation(before: Array, after: Array) -> Vector:
    """As `rigid_gns_core.scenes.state.rotation_between`."""
    bx, by, bz, bw = before[0], before[1], before[2], before[3]
    ax, ay, az, aw = after[0], after[1], after[2], after[3]
    # terms in the order of that function: of a rotation that stays, rounding is to be the same
    vector = (
        ax * bw - aw * bx - ay * bz + az * by,
        ax * bz - aw * by + ay * bw - az * bx,
        ay * bx - (aw * bz + ax * by) + az * bw,
    )
    real = aw * bw + ax * bx + ay * by + az * bz
    sine = length(vector)
    # sin(x/2) / x tends to 1/2: below 1e-12 the ratio is exact in float64
    factor = 2.0 * math.atan2(sine, abs(real)) / sine if sine > 1e-12 else 2.0
    return times(factor if real >= 0 else -factor, vector)
