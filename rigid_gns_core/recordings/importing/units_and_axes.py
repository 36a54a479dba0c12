# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Units and axes of a tracker, turned by options."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..decoded_topic import DecodedTopic
from ...data.tracks import known_rotations, Track
from ...scenes.state import Array, quaternion_multiply

# rows: the scene's x, y, z by the tracker's axes, right-handed; the named axis becomes z
AXES: dict[str, tuple[tuple[int, int, int], ...]] = {
    'z': ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    'y': ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    'x': ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    '-z': ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    '-y': ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    '-x': ((0, 1, 0), (0, 0, -1), (-1, 0, 0)),
}


def turned(track: Track, scale: float, up: str) -> Track:
    """The track in metres, with z up.

    Args:
        track: Track in the tracker's units and axes.
        scale: Metres in a unit of the tracker.
        up: Axis of the tracker that points up, of `AXES`.
    """
    matrix = np.array(AXES[up], dtype=np.float64)
    rotations = track.quaternions
    if rotations is not None:
        rotations = known_rotations(quaternion_multiply(_quaternion(matrix), rotations))
    return replace(track, positions=scale * track.positions @ matrix.T, quaternions=rotations)


def turned_frames(decoded: DecodedTopic, scale: float, up: str) -> DecodedTopic:
    """The frames of a topic in metres, with z up; arguments as in `turned`."""
    if (scale, up) == (1.0, 'z'):
        return decoded
    matrix = np.array(AXES[up], dtype=np.float64)
    turn = _quaternion(matrix)

    def found(poses: Array) -> Array:
        rotations = quaternion_multiply(turn, poses[:, 3:])
        return np.concatenate([scale * poses[:, :3] @ matrix.T, rotations], axis=1)

    frames = [replace(frame, poses=found(frame.poses)) for frame in decoded.frames]
    return replace(decoded, frames=frames)


def _quaternion(matrix: Array) -> Array:
    """Quaternion (x, y, z, w) of a rotation by a multiple of a quarter turn about each axis."""
    # q q^T from the matrix: the column of its largest diagonal entry is a multiple of q
    (a, b, c), (d, e, f), (g, h, i) = matrix.tolist()
    outer = np.array(
        [
            [1 + a - e - i, b + d, c + g, h - f],
            [b + d, 1 - a + e - i, f + h, c - g],
            [c + g, f + h, 1 - a - e + i, d - b],
            [h - f, c - g, d - b, 1 + a + e + i],
        ]
    )
    column = outer[int(np.argmax(np.diag(outer)))]
    unit: Array = column / np.linalg.norm(column)
    return unit
