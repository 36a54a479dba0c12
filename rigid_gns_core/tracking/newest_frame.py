# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is done with each frame that shows all spheres in their order, compiled.

NumPy takes about 2 us for each of these small steps, of which there were dozens in a frame.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import entry
from ..scenes.state import Array, UNIT


@entry
def is_usual(poses: Array, most: float) -> bool:
    """Whether poses are there, none beyond a bound, and no coordinate of a place is zero.

    Args:
        poses: Positions and quaternions, shape (n, 7).
        most: Largest magnitude of a value.
    """
    for i in range(len(poses)):
        for k in range(7):
            if not abs(poses[i, k]) <= most:  # also NaN
                return False
        if poses[i, 0] == 0.0 or poses[i, 1] == 0.0 or poses[i, 2] == 0.0:
            return False
    return len(poses) > 0


@entry
def append_frame(
    frame: Array,
    poses: Array,
    seen: NDArray[np.bool_],
    poses_out: Array,
    seen_out: NDArray[np.bool_],
) -> bool:
    """Write the newest frames and one more, whose quaternions are normalised as by `as_unit`.

    Args:
        frame: Poses of the frame, shape (n, 7).
        poses: Poses in the frames before, shape (m, n, 7).
        seen: Whether a sphere was seen in them, shape (m, n).
        poses_out: Poses in the newest k - 1 of them and in the frame, shape (k, n, 7).
        seen_out: What was seen in those, shape (k, n).

    Returns:
        Whether all poses of the frame are measurements; if not, what is written is of no use.
    """
    last = len(poses_out) - 1
    first = len(poses) - last
    for f in range(last):
        for i in range(len(frame)):
            seen_out[f, i] = seen[first + f, i]
            for k in range(7):
                poses_out[f, i, k] = poses[first + f, i, k]
    for i in range(len(frame)):
        there = False
        for k in range(7):
            value = frame[i, k]
            if not math.isfinite(value):
                return False
            there |= value != 0.0
            poses_out[last, i, k] = value
        if not there:
            return False
        seen_out[last, i] = True
        x, y, z, w = frame[i, 3], frame[i, 4], frame[i, 5], frame[i, 6]
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        if norm > 0.0 and abs(norm - 1.0) > UNIT:
            for k in range(3, 7):
                poses_out[last, i, k] = frame[i, k] / norm
    return True
