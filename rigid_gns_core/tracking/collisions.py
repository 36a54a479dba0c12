# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Collisions of two spheres: time of contact, and the change of their velocities."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import in_place
from ..kernels.neighbours import find_pairs
from ..kernels.vector import dot, length, minus, row, times, Vector
from ..scenes.state import Array

# first and second sphere of each pair, shape (m,) each
Pairs = tuple[NDArray[np.int64], NDArray[np.int64]]
NO_PAIRS: Pairs = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))


def pairs_near(positions: Array, reach: Array) -> Pairs:
    """Pairs i < j of spheres no further apart than the sum of their reaches [m], shape (n,)."""
    if not len(reach):
        return NO_PAIRS
    return find_pairs(positions, reach, np.ones(len(reach), dtype=bool))


@in_place
def within(positions: Array, reach: Array, i: int, j: int) -> bool:
    """Whether spheres i, j are no further apart than the sum of their reaches [m], shape (n,)."""
    return bool(length(minus(row(positions, i), row(positions, j))) <= reach[i] + reach[j])


@in_place
def time_of_contact(offset: Vector, velocity: Vector, reach_sum: float) -> float:
    """Time at which two spheres in uniform motion touch [s]; NaN where they never do.

    Args:
        offset: From the first centre to the second at time 0 [m].
        velocity: Of the second sphere relative to the first [m/s].
        reach_sum: Sum of the radii [m].
    """
    a, b, c = dot(velocity, velocity), dot(offset, velocity), dot(offset, offset) - reach_sum**2
    discriminant = b * b - a * c
    if not discriminant > 0:
        return math.nan
    root = math.sqrt(discriminant)
    return c / (root - b) if b < 0 else (-b - root) / a


@in_place
def velocity_change(offset: Vector, velocity: Vector, restitution: float) -> Vector:
    """Change of the velocity of the first of two equal spheres that collide [m/s].

    Args:
        offset: From the first centre to the second at the contact [m].
        velocity: Of the second sphere relative to the first [m/s].
        restitution: Restitution of the pair.
    """
    distance = length(offset)
    if distance == 0.0:  # no normal; two measurements of one sphere may coincide
        return 0.0, 0.0, 0.0
    normal = times(1.0 / distance, offset)
    closing = min(dot(velocity, normal), 0.0)
    return times(0.5 * (1.0 + restitution) * closing, normal)
