# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data association: which pose of a frame belongs to which sphere, where trackers give no names.

A sphere is sought where its motion so far leads, within a gate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from .collisions import Pairs, pairs_near
from .jit import entry, plain
from ..kernels.vector import length, minus, row
from ..scenes.state import Array

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

# standard deviations of noise that a gate adds
GATE_SIGMAS = 6.0


def match(predicted: Array, found: Array, gates: Array) -> Indices:
    """Assign poses to spheres so that the sum of squared distances, in gates, is least.

    Args:
        predicted: Where spheres are expected [m], shape (n, 3).
        found: Positions of a frame in any order [m], shape (k, 3).
        gates: Largest distance of each sphere from where it is expected [m], shape (n,).

    Returns:
        Index into `found` of each sphere, -1 where none is within its gate, shape (n,).
    """
    predicted, found, gates = plain(predicted), plain(found), plain(gates)
    none = np.full(len(predicted), -1, dtype=np.int64)
    if not len(predicted) or not len(found):
        return none
    distance, nearest = cKDTree(found).query(predicted)
    inside = distance <= gates
    claimed = np.bincount(nearest[inside], minlength=len(found))
    if claimed.max(initial=0) <= 1:  # each has its nearest: no sum can be smaller
        return np.where(inside, nearest, none)
    # only those hang on each other that gates join to a pose that is the nearest of several
    joined, wanted = np.zeros(len(predicted), dtype=bool), claimed > 1
    _cluster(joined, wanted, np.empty(len(found), dtype=np.int64), predicted, found, gates)
    spheres, poses = np.flatnonzero(joined), np.flatnonzero(wanted)
    index = np.where(inside, nearest, none)
    squares = np.square(predicted[spheres, None] - found[poses]).sum(axis=-1)
    cost = np.minimum(squares / gates[spheres, None] ** 2, 1.0)
    rows, columns = linear_sum_assignment(cost)
    kept = cost[rows, columns] < 1.0
    index[spheres] = -1
    index[spheres[rows[kept]]] = poses[columns[kept]]
    return index


@entry
def _cluster(
    spheres: Flags, poses: Flags, waiting: Indices, predicted: Array, found: Array, gates: Array
) -> None:
    """Mark all spheres and poses that gates join to marked poses.

    Args:
        spheres: Marks, shape (n,).
        poses: Marks, shape (k,).
        waiting: Overwritten, shape (k,).
        predicted: Where spheres are expected [m], shape (n, 3).
        found: Positions [m], shape (k, 3).
        gates: Of spheres [m], shape (n,).
    """
    count = 0
    for k in range(len(poses)):
        if poses[k]:
            waiting[count] = k
            count += 1
    while count:
        count -= 1
        place = row(found, waiting[count])
        for i in range(len(spheres)):
            if spheres[i] or length(minus(place, row(predicted, i))) > gates[i]:
                continue
            spheres[i] = True
            for k in range(len(poses)):
                if not poses[k] and length(minus(row(found, k), row(predicted, i))) <= gates[i]:
                    poses[k] = True
                    waiting[count] = k
                    count += 1


def gates(
    speeds: Array, positions: Array, radii: Array, spread: Array, time: float, reliable: Flags
) -> Array:
    """How far spheres may be from where they are expected [m], shape (n,).

    A radius, as others are two away; the noise; and how far the sphere itself, or the fastest that
    can reach it, comes meanwhile, as either may have been struck.

    Args:
        speeds: Sizes of velocities [m/s], shape (n,).
        positions: Expected centres [m], shape (n, 3).
        radii: [m], shape (n,).
        spread: Standard deviation of the expected positions [m], shape (n,).
        time: Since the frame before [s].
        reliable: Whether a speed is that of three frames or more, shape (n,): one that was matched
            wrongly must not widen the gates of others.
    """
    positions, radii, travel = plain(positions), plain(radii), plain(speeds * time)
    fastest = travel.copy()
    _raise_to_fastest(fastest, travel, reliable, pairs_near(positions, radii + travel))
    return radii + GATE_SIGMAS * spread + fastest


@entry
def _raise_to_fastest(fastest: Array, travel: Array, reliable: Flags, pairs: Pairs) -> None:
    """Raise the way of each sphere to that of the fastest sure one that can reach it."""
    one, other = pairs
    for k in range(len(one)):
        i, j = one[k], other[k]
        if reliable[j]:
            fastest[i] = max(fastest[i], travel[j])
        if reliable[i]:
            fastest[j] = max(fastest[j], travel[i])
