# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Track initiation: new spheres, in the poses that are associated with no track.

Three such poses in three frames in a row that agree with one flight, or with uniform motion, are a
sphere; false detections seldom do. Before there is any sphere, also those are taken that are
nearest to each other from frame to frame, as they may be bouncing.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from .association import GATE_SIGMAS, Indices, match
from ..scenes.state import Array

INITIATION_FRAMES = 3
# three such poses agree with one motion up to so many radii, beside the noise
_AGREE = 0.02
# the first spheres are sought a radius away, and as far as so many sqrt(g r) of speed reach
_SLOW = 10.0


def initiate_tracks(
    places: list[Array],
    times: Array,
    *,
    gravity: Array,
    radius: float,
    noise: float,
    max_speed: float,
    any_track: bool,
) -> Indices:
    """Return new spheres in the unassociated poses of one to three frames.

    Args:
        places: Positions of each frame [m], shapes (k, 3).
        times: Of the frames [s].
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        radius: [m].
        noise: Standard deviation of each coordinate [m].
        max_speed: Faster ones are not sought [m/s].
        any_track: Whether there are spheres already.

    Returns:
        Indices into the positions of each frame, in the order of the first, shape (m, frames).
    """
    if len(places) == 1:
        return np.arange(len(places[0]), dtype=np.int64)[:, None]
    found = np.zeros((0, len(places)), dtype=np.int64)
    if len(places) == INITIATION_FRAMES:
        found = triples(
            (places[0], places[1], places[2]),
            (float(times[0]), float(times[1]), float(times[2])),
            gravity=gravity,
            radius=radius,
            noise=noise,
            max_speed=max_speed,
        )
        if any_track:
            return found
    free = [
        np.setdiff1d(np.arange(len(place)), column)
        for place, column in zip(places, found.T, strict=True)
    ]
    size = float(np.linalg.norm(gravity)) or 1.0
    chain = free[0][:, None]
    for frame in range(1, len(places)):
        reach = radius + _SLOW * np.sqrt(size * radius) * (times[frame] - times[frame - 1])
        index = match(
            places[frame - 1][chain[:, -1]], places[frame][free[frame]], np.full(len(chain), reach)
        )
        kept = index >= 0
        chain = np.c_[chain[kept], free[frame][index[kept]]]
    rows = np.concatenate([found, chain])
    return rows[np.argsort(rows[:, 0])]


def triples(
    places: tuple[Array, Array, Array],
    times: tuple[float, float, float],
    *,
    gravity: Array,
    radius: float,
    noise: float,
    max_speed: float,
) -> Indices:
    """Unassociated poses of three frames that agree with one flight, or with uniform motion.

    Of several that agree, the slow ones are taken: in a row of spheres at rest, each agrees with a
    motion from sphere to sphere too.

    Args:
        places: Positions of the frames [m], shapes (a, 3), (b, 3) and (c, 3).
        times: Of the frames [s].
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        radius: [m].
        noise: Standard deviation of each coordinate [m].
        max_speed: Faster ones are not sought [m/s].

    Returns:
        Indices into each frame, in the order of the first, shape (m, 3).
    """
    first, second, third = places
    if not (len(first) and len(second) and len(third)):
        return np.zeros((0, 3), dtype=np.int64)
    before, after = times[1] - times[0], times[2] - times[1]
    near = cKDTree(second).query_ball_point(first, max_speed * before + radius)
    a = np.repeat(np.arange(len(first)), [len(one) for one in near])
    if not len(a):
        return np.zeros((0, 3), dtype=np.int64)
    b = np.concatenate([np.asarray(one, dtype=np.int64) for one in near])
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
    used: tuple[set[int], set[int], set[int]] = (set(), set(), set())
    taken = []
    for row in rows[:, 1:].astype(np.int64).tolist():
        if any(index in known for index, known in zip(row, used, strict=True)):
            continue
        taken.append(row)
        for index, known in zip(row, used, strict=True):
            known.add(index)
    return np.array(sorted(taken), dtype=np.int64).reshape(-1, 3)
