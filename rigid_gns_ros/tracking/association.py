"""Which pose of a frame belongs to which sphere, where trackers give no names.

A sphere is sought where its motion so far leads, within a gate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from rigid_gns_core.state import Array

from .collisions import pairs_near

Indices = NDArray[np.int64]

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
    none = np.full(len(predicted), -1, dtype=np.int64)
    if not len(predicted) or not len(found):
        return none
    distance, nearest = cKDTree(found).query(predicted)
    inside = distance <= gates
    claimed = np.bincount(nearest[inside], minlength=len(found))
    if claimed.max(initial=0) <= 1:  # each has its nearest: no sum can be smaller
        return np.where(inside, nearest, none)
    squares = np.square(predicted[:, None] - found).sum(axis=-1)
    cost = np.minimum(squares / gates[:, None] ** 2, 1.0)
    rows, columns = linear_sum_assignment(cost)
    kept = cost[rows, columns] < 1.0
    none[rows[kept]] = columns[kept]
    return none


def gates(
    speeds: Array,
    positions: Array,
    radii: Array,
    spread: Array,
    time: float,
    sure: NDArray[np.bool_],
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
        sure: Whether a speed is that of three frames or more, shape (n,): one that was matched
            wrongly must not widen the gates of others.
    """
    travel = speeds * time
    i, j = pairs_near(positions, radii + travel)
    fastest = travel.copy()
    np.maximum.at(fastest, i, np.where(sure[j], travel[j], 0.0))
    np.maximum.at(fastest, j, np.where(sure[i], travel[i], 0.0))
    return radii + GATE_SIGMAS * spread + fastest
