# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Interpolation of poses between frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..scenes.state import Array, rotate_quaternions, rotation_between
from ..tracking.usable_frames import Stamps


def between(start: Array, end: Array, weight: ArrayLike) -> Array:
    """Poses between two others: linear in position, along the shorter arc in rotation.

    Args:
        start: Position [m] and quaternion (x, y, z, w), shape (..., 7).
        end: Later poses, of the same shape.
        weight: 0 for `start` to 1 for `end`: a number, or an array of shape (..., 1).

    Returns:
        Poses, shape (..., 7).
    """
    share = np.asarray(weight)
    positions = (1 - share) * start[..., :3] + share * end[..., :3]
    turn = rotation_between(start[..., 3:], end[..., 3:])
    rotations = rotate_quaternions(start[..., 3:], share * turn)
    return np.concatenate([positions, rotations], axis=-1)


def interpolate(stamps: Stamps, poses: Array, wanted: Stamps) -> Array:
    """Poses at other times, see `between`.

    Args:
        stamps: Times [ns], rising, shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7).
        wanted: Times [ns] from the first to the last of `stamps`, shape (m,).

    Returns:
        Poses, shape (m, n, 7); exact where a time is one of `stamps`.
    """
    after = np.searchsorted(stamps, wanted, side='left')
    before = np.maximum(after - 1, 0)
    after = np.where(stamps[after] == wanted, after, np.maximum(after, 1))
    exact = stamps[after] == wanted
    before = np.where(exact, after, before)
    # differences first: nanoseconds since 1970 do not fit into a float64
    span = np.where(exact, 1, stamps[after] - stamps[before])
    weight = ((wanted - stamps[before]) / span)[:, None, None]
    return between(poses[before], poses[after], weight)
