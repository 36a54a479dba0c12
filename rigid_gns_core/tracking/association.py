# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data association: which pose of a frame belongs to which track.

A pose is associated with a track where it lies within the gate around the track's prediction.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from .gating import gates
from .jit import entry, plain
from .motion_models import Motion
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import length, minus, row
from ..scenes.state import Array


def match(predicted: Array, detections: Array, gates: Array) -> Indices:
    """Assign detections to tracks so that the sum of squared distances, in gates, is least.

    Args:
        predicted: Predicted position of each track [m], shape (n, 3).
        detections: Positions of a frame in any order [m], shape (k, 3).
        gates: Largest distance of a detection from each prediction [m], shape (n,).

    Returns:
        Index into `detections` for each track, -1 where none is within its gate, shape (n,).
    """
    predicted, detections, gates = plain(predicted), plain(detections), plain(gates)
    none = np.full(len(predicted), -1, dtype=np.int64)
    if not len(predicted) or not len(detections):
        return none
    distance, nearest = cKDTree(detections).query(predicted)
    inside = distance <= gates
    claimed = np.bincount(nearest[inside], minlength=len(detections))
    if claimed.max(initial=0) <= 1:  # every track has its nearest: no sum can be smaller
        return np.where(inside, nearest, none)
    # only the clusters with a contested detection need an assignment
    joined, wanted = np.zeros(len(predicted), dtype=bool), claimed > 1
    _cluster(
        joined, wanted, np.empty(len(detections), dtype=np.int64), predicted, detections, gates
    )
    spheres, poses = np.flatnonzero(joined), np.flatnonzero(wanted)
    index = np.where(inside, nearest, none)
    squares = np.square(predicted[spheres, None] - detections[poses]).sum(axis=-1)
    cost = np.minimum(squares / gates[spheres, None] ** 2, 1.0)
    rows, columns = linear_sum_assignment(cost)
    inside_gate = cost[rows, columns] < 1.0
    index[spheres] = -1
    index[spheres[rows[inside_gate]]] = poses[columns[inside_gate]]
    return index


def associate(
    predicted: Motion, detections: Array, *, radii: Array, noise: float, limit: float, time: float
) -> Indices:
    """Index of the detection of each track, -1 where there is none, shape (n,).

    Args:
        predicted: Motion of the tracks as predicted for the frame.
        detections: Positions of the frame in any order [m], shape (k, 3).
        radii: Of the tracks [m], shape (n,).
        noise: Standard deviation of each coordinate of a position [m].
        limit: Largest speed that widens a gate [m/s].
        time: Time since the previous frame [s].
    """
    spread = np.hypot(noise, np.minimum(predicted.errors, limit) * time)
    speeds = np.minimum(np.linalg.norm(predicted.velocities, axis=1), limit)
    reliable = predicted.frames > 2
    width = gates(speeds, predicted.positions, radii, spread, time, reliable)
    found = match(predicted.positions, detections, width)
    lost = np.flatnonzero(found < 0)
    free = np.setdiff1d(np.arange(len(detections)), found) if len(lost) else lost
    if len(free):  # a sphere that was thrown back is off by twice its travel
        width = gates(2.0 * speeds, predicted.positions, radii, spread, time, reliable)
        again = match(predicted.positions[lost], detections[free], width[lost])
        found[lost[again >= 0]] = free[again[again >= 0]]
    return found


@entry
def _cluster(
    spheres: Flags,
    poses: Flags,
    waiting: Indices,
    predicted: Array,
    detections: Array,
    gates: Array,
) -> None:
    """Mark all tracks and detections that gates connect to marked detections.

    Args:
        spheres: Marks of the tracks, shape (n,).
        poses: Marks of the detections, shape (k,).
        waiting: Scratch, overwritten, shape (k,).
        predicted: Predicted position of each track [m], shape (n, 3).
        detections: Positions of a frame [m], shape (k, 3).
        gates: Gate of each track [m], shape (n,).
    """
    count = 0
    for k in range(len(poses)):
        if poses[k]:
            waiting[count] = k
            count += 1
    while count:
        count -= 1
        position = row(detections, waiting[count])
        for i in range(len(spheres)):
            if spheres[i] or length(minus(position, row(predicted, i))) > gates[i]:
                continue
            spheres[i] = True
            for k in range(len(poses)):
                if (
                    not poses[k]
                    and length(minus(row(detections, k), row(predicted, i))) <= gates[i]
                ):
                    poses[k] = True
                    waiting[count] = k
                    count += 1
