# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A window of frames, sphere by sphere, as prefix sums for line fits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import entry, in_place
from .line_fit import accumulate, COLUMNS
from ..kernels.neighbours import Flags
from ..kernels.vector import length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

# a gap below this many radii plus this many standard deviations of noise may be a contact
_NEAR, _NEAR_SIGMAS = 0.02, 4.0
# collisions are sought in this many of the last intervals between frames
INTERVALS = 2


class Observations(NamedTuple):
    """Frames of n spheres.

    Args:
        stamps: Times of the frames, the last of which is 0 [s], shape (frames,).
        seen: Whether a sphere was seen in a frame, at least once each, shape (n, frames).
        last: Last frame that shows a sphere, shape (n,).
        origin: Position of the sphere in that frame [m], shape (n, 3).
        offsets: Centres, less `origin`; 0 where not seen [m], shape (n, frames, 3).
        angles: Rotation vectors since the first frame [rad], shape (n, frames, 3).
        flight_sums: Prefix sums of offsets less the fall, shape (n, frames + 1, COLUMNS).
        uniform_sums: Prefix sums of offsets, of the same shape.
        angle_sums: Prefix sums of rotation vectors, of the same shape.
        radii: Radii [m], shape (n,).
        sigma: Noise of a coordinate [m], shape (n,).
        near: Largest gap to a sphere's surface that may be a contact [m], shape (n,).
        touch: Largest distance from a sphere's centre that may be a contact [m], shape (n,).
        met: Farthest from its centre that what it met lately can be [m], shape (n,).
    """

    stamps: Array
    seen: Flags
    last: NDArray[np.int64]
    origin: Array
    offsets: Array
    angles: Array
    flight_sums: Array
    uniform_sums: Array
    angle_sums: Array
    radii: Array
    sigma: Array
    near: Array
    touch: Array
    met: Array

    @classmethod
    def of(cls, stamps: Array, count: int, radii: Array, sigma: Array) -> Observations:
        """Uninitialised observations of `count` spheres, for `fill`."""
        frames = len(stamps)
        return cls(
            stamps=stamps,
            seen=np.empty((count, frames), dtype=bool),
            last=np.zeros(count, dtype=np.int64),
            origin=np.empty((count, 3)),
            offsets=np.zeros((count, frames, 3)),
            angles=np.zeros((count, frames, 3)),
            flight_sums=np.empty((count, frames + 1, COLUMNS)),
            uniform_sums=np.empty((count, frames + 1, COLUMNS)),
            angle_sums=np.empty((count, frames + 1, COLUMNS)),
            radii=radii,
            sigma=sigma,
            near=np.empty(count),
            touch=np.empty(count),
            met=np.empty(count),
        )


@entry
def fill(
    window: Observations,
    positions: Array,
    quaternions: Array,
    shown: Flags,
    gravity: Vector,
    fallen: Array,
) -> None:
    """Fill the observations from frames.

    Args:
        window: Overwritten, as `Observations.of` returns it.
        positions: Centres [m], shape (frames, n, 3).
        quaternions: Rotations (x, y, z, w), shape (frames, n, 4).
        shown: Whether a sphere was seen in a frame, shape (frames, n).
        gravity: Acceleration of free flight [m/s^2].
        fallen: Scratch, overwritten, shape (frames, 3).
    """
    stamps, frames = window.stamps, len(window.stamps)
    for i in range(len(window.last)):
        seen, offsets = window.seen[i], window.offsets[i]
        for frame in range(frames):
            seen[frame] = shown[frame, i]
            if seen[frame]:
                window.last[i] = frame
        put(window.origin, i, row(positions[window.last[i]], i))
        for frame in range(frames):
            for axis in range(3):
                if seen[frame]:
                    offsets[frame, axis] = positions[frame, i, axis] - window.origin[i, axis]
                fall = 0.5 * stamps[frame] ** 2 * gravity[axis]
                fallen[frame, axis] = offsets[frame, axis] - fall
        _sum_rotations(window.angles[i], quaternions, seen, i)
        accumulate(window.flight_sums[i], stamps, fallen, seen, 0)
        accumulate(window.uniform_sums[i], stamps, offsets, seen, 0)
        accumulate(window.angle_sums[i], stamps, window.angles[i], seen, 0)
        window.near[i] = _NEAR * window.radii[i] + _NEAR_SIGMAS * window.sigma[i]
        window.touch[i] = window.radii[i] + window.near[i]
        window.met[i] = window.radii[i] + _way(stamps, offsets, seen)


@in_place
def _way(stamps: Array, offsets: Array, seen: Flags) -> float:
    """Upper bound of the distance that a sphere travelled in the last `INTERVALS` intervals [m].

    Args:
        stamps: Times of the frames, the last is 0 [s], shape (frames,).
        offsets: Its centres relative to the last measured one [m], shape (frames, 3).
        seen: Whether it was seen in a frame, shape (frames,).
    """
    first = max(0, len(stamps) - INTERVALS - 1)
    fastest = 0.0
    for frame in range(max(first, 1), len(stamps)):
        if seen[frame] and seen[frame - 1]:
            step = length(minus(row(offsets, frame), row(offsets, frame - 1)))
            fastest = max(fastest, step / (stamps[frame] - stamps[frame - 1]))
    # a factor of 1.5, as a step may have been there and back
    return float(-1.5 * stamps[first] * fastest)


@in_place
def _sum_rotations(angles: Array, quaternions: Array, seen: Flags, i: int) -> None:
    """Rotation vectors of sphere i since the first frame with it [rad], shape (frames, 3)."""
    before = -1
    total = (0.0, 0.0, 0.0)
    for frame in range(len(angles)):
        if seen[frame]:
            # summed increments: the total may pass half a turn, and to first order their noise
            # telescopes
            if before >= 0:
                total = plus(total, _rotation(quaternions[before, i], quaternions[frame, i]))
            before = frame
        put(angles, frame, total)


@in_place
def _rotation(before: Array, after: Array) -> Vector:
    """Rotation vector from one quaternion to another [rad], as `scenes.state.rotation_between`."""
    bx, by, bz, bw = before[0], before[1], before[2], before[3]
    ax, ay, az, aw = after[0], after[1], after[2], after[3]
    # terms in the order of that function, so that an unchanged rotation gives exactly zero
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
