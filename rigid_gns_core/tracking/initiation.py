# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Track initiation: new tracks from poses that are associated with none.

Three such poses in three consecutive frames that agree with one flight, or with uniform motion,
start a track; false detections seldom agree. Before there is any track, nearest neighbours from
frame to frame start one too, as the first spheres may be bouncing.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .association import match
from .gating import GATE_SIGMAS
from ..kernels.neighbours import Indices
from ..scenes.state import Array

INITIATION_FRAMES = 3
# tolerance of that agreement [radii], beside the noise
_AGREE = 0.02
# the first spheres move at most a radius, and at this speed [sqrt(g r)], between two frames
_SLOW = 10.0


def initiate_tracks(
    positions: list[Array],
    times: Array,
    *,
    gravity: Array,
    radius: float,
    noise: float,
    max_speed: float,
    any_track: bool,
) -> Indices:
    """Find new tracks in the unassociated poses of one to three frames.

    Args:
        positions: Positions of each frame [m], shapes (k, 3).
        times: Times of the frames [s], shape (frames,).
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        radius: Radius of the largest sphere [m].
        noise: Standard deviation of each coordinate [m].
        max_speed: Largest speed of a new track [m/s].
        any_track: Whether there are tracks already.

    Returns:
        Indices into the positions of each frame, in the order of the first, shape (m, frames).
    """
    if len(positions) == 1:
        return np.arange(len(positions[0]), dtype=np.int64)[:, None]
    found = np.zeros((0, len(positions)), dtype=np.int64)
    if len(positions) == INITIATION_FRAMES:
        found = triples(
            (positions[0], positions[1], positions[2]),
            (float(times[0]), float(times[1]), float(times[2])),
            gravity=gravity,
            radius=radius,
            noise=noise,
            max_speed=max_speed,
        )
        if any_track:
            return found
    free = [
        np.setdiff1d(np.arange(len(centres)), column)
        for centres, column in zip(positions, found.T, strict=True)
    ]
    size = float(np.linalg.norm(gravity)) or 1.0
    chain = free[0][:, None]
    for frame in range(1, len(positions)):
        reach = radius + _SLOW * np.sqrt(size * radius) * (times[frame] - times[frame - 1])
        index = match(
            positions[frame - 1][chain[:, -1]],
            positions[frame][free[frame]],
            np.full(len(chain), reach),
        )
        continued = index >= 0
        chain = np.c_[chain[continued], free[frame][index[continued]]]
    rows = np.concatenate([found, chain])
    return rows[np.argsort(rows[:, 0])]


def triples(
    positions: tuple[Array, Array, Array],
    times: tuple[float, float, float],
    *,
    gravity: Array,
    radius: float,
    noise: float,
    max_speed: float,
) -> Indices:
    """Triples of poses of three frames that agree with one flight, or with uniform motion.

    Of several that agree the slowest is taken: in a row of spheres at rest, a motion from sphere
    to sphere agrees too.

    Args:
        positions: Positions of the frames [m], shapes (a, 3), (b, 3) and (c, 3).
        times: Times of the frames [s].
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        radius: Radius of the largest sphere [m].
        noise: Standard deviation of each coordinate [m].
        max_speed: Largest speed of a new track [m/s].

    Returns:
        Indices into each frame, in the order of the first, shape (m, 3).
    """
    first, second, third = positions
    if not (len(first) and len(second) and len(third)):
        return np.zeros((0, 3), dtype=np.int64)
    before, after = times[1] - times[0], times[2] - times[1]
    neighbours = cKDTree(second).query_ball_point(first, max_speed * before + radius)
    a = np.repeat(np.arange(len(first)), [len(one) for one in neighbours])
    if not len(a):
        return np.zeros((0, 3), dtype=np.int64)
    b = np.concatenate([np.asarray(one, dtype=np.int64) for one in neighbours])
    ratio = after / before
    step = second[b] - first[a]
    straight = second[b] + ratio * step
    tree = cKDTree(third)
    spread = noise * np.sqrt(1.0 + (1.0 + ratio) ** 2 + ratio**2)
    tolerance = GATE_SIGMAS * spread + _AGREE * radius
    candidates = []
    for acceleration in (gravity, np.zeros(3)):
        expected = straight + 0.5 * acceleration * after * (before + after)
        off, c = tree.query(expected, distance_upper_bound=tolerance)
        good = np.isfinite(off)
        cost = (off[good] / tolerance) ** 2 + np.linalg.norm(step[good], axis=1) / radius
        candidates.append(np.c_[cost, a[good], b[good], c[good]])
    rows = np.concatenate(candidates)
    rows = rows[np.lexsort(rows.T[::-1])]
    taken_poses: tuple[set[int], set[int], set[int]] = (set(), set(), set())
    taken = []
    for row in rows[:, 1:].astype(np.int64).tolist():
        if any(index in known for index, known in zip(row, taken_poses, strict=True)):
            continue
        taken.append(row)
        for index, known in zip(row, taken_poses, strict=True):
            known.add(index)
    return np.array(sorted(taken), dtype=np.int64).reshape(-1, 3)
