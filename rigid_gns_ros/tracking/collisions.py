"""Where two moving spheres meet, and what their velocities are then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from rigid_gns_core.state import Array


def pairs_near(positions: Array, reach: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs i < j of spheres no further apart than the sum of their reaches [m], shape (n,)."""
    pairs = cKDTree(positions).query_pairs(2.0 * reach.max(initial=0.0), output_type='ndarray')
    i, j = pairs[np.lexsort(pairs.T[::-1])].T
    near = np.linalg.norm(positions[i] - positions[j], axis=1) <= reach[i] + reach[j]
    return i[near], j[near]


def meeting(offsets: Array, speeds: Array, touch: Array) -> Array:
    """Time at which spheres in relative uniform motion come to touch [s]; NaN where they do not.

    Args:
        offsets: From one centre to the other at time 0 [m], shape (..., 3).
        speeds: Of the other relative to the one [m/s], shape (..., 3).
        touch: Sum of the radii [m], shape that fits (...).
    """
    a = np.square(speeds).sum(axis=-1)
    b = (offsets * speeds).sum(axis=-1)
    c = np.square(offsets).sum(axis=-1) - touch**2
    with np.errstate(invalid='ignore', divide='ignore'):
        root = np.sqrt(b**2 - a * c)
        when = np.where(b < 0, c / (root - b), (-b - root) / a)
    return np.where(np.isfinite(when) & (root > 0), when, np.nan)


def exchange(offsets: Array, speeds: Array, restitution: float) -> Array:
    """Change of the velocity of the first of two equal spheres that collide [m/s], shape (..., 3).

    Args:
        offsets: From its centre to the other's at the contact [m], shape (..., 3).
        speeds: Of the other relative to it [m/s], shape (..., 3).
        restitution: Of the pair.
    """
    normals = offsets / np.linalg.norm(offsets, axis=-1, keepdims=True)
    closing = np.minimum((speeds * normals).sum(axis=-1, keepdims=True), 0.0)
    return 0.5 * (1.0 + restitution) * closing * normals
