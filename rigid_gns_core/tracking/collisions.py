# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where two moving spheres meet, and what their velocities are then."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import in_place
from ..kernels.neighbours import find_pairs
from ..kernels.vector import dot, length, minus, row, times, Vector
from ..scenes.state import Array

# first and second spheres of pairs, shape (m,) each
Pairs = tuple[NDArray[np.int64], NDArray[np.int64]]
NONE_NEAR: Pairs = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))


def pairs_near(positions: Array, reach: Array) -> Pairs:
    """Pairs i < j of spheres no further apart than the sum of their reaches [m], shape (n,)."""
    if not len(reach):
        return NONE_NEAR
    return find_pairs(positions, reach, np.ones(len(reach), dtype=bool))


@in_place
def within(positions: Array, reach: Array, i: int, j: int) -> bool:
    """Whether two spheres are no further apart than the sum of their reaches [m], shape (n,)."""
    return bool(length(minus(row(positions, i), row(positions, j))) <= reach[i] + reach[j])


@in_place
def time_of_contact(offset: Vector, speed: Vector, touch: float) -> float:
    """Time at which spheres in relative uniform motion come to touch [s]; NaN where they do not.

    Args:
        offset: From one centre to the other at time 0 [m].
        speed: Of the other relative to the one [m/s].
        touch: Sum of the radii [m].
    """
    a, b, c = dot(speed, speed), dot(offset, speed), dot(offset, offset) - touch**2
    square = b * b - a * c
    if not square > 0:
        return math.nan
    root = math.sqrt(square)
    return c / (root - b) if b < 0 else (-b - root) / a


@in_place
def velocity_change(offset: Vector, speed: Vector, restitution: float) -> Vector:
    """Change of the velocity of the first of two equal spheres that collide [m/s].

    Args:
        offset: From its centre to the other's at the contact [m].
        speed: Of the other relative to it [m/s].
        restitution: Of the pair.
    """
    apart = length(offset)
    if apart == 0.0:  # in one place, as two measurements of one sphere may be
        return 0.0, 0.0, 0.0
    normal = times(1.0 / apart, offset)
    closing = min(dot(speed, normal), 0.0)
    return times(0.5 * (1.0 + restitution) * closing, normal)
