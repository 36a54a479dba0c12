# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Covariances of samples, and how far the planes are that gave them blows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import entry
from .vector import dot, length, minus, row, times
from ..scenes.state import Array


@entry
def find_covariances(samples: Array, covariances_out: Array) -> None:
    """Find sum (x - mean) (x - mean)^T / (s - 1) of samples (s, k, 3), shape (k, 3, 3)."""
    count = len(samples)
    for k in range(samples.shape[1]):
        mean = np.zeros(3)
        for s in range(count):
            for axis in range(3):
                mean[axis] += samples[s, k, axis] / count
        covariances_out[k] = 0.0
        for s in range(count):
            for a in range(3):
                for b in range(3):
                    off = (samples[s, k, a] - mean[a]) * (samples[s, k, b] - mean[b])
                    covariances_out[k, a, b] += off / max(count - 1, 1)


@entry
def find_gaps(
    arms: Array, blows: Array, axes: Array, half: Array, radius: float, cosine: float,
    gaps_out: Array, beyond_out: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Find how far from touching planes spheres were that got blows.

    Args:
        arms: Centres from the points of the planes, shape (m, planes, 3).
        blows: Changes of velocity, likewise.
        axes: Of each plane along itself, shape (planes, 2, 3).
        half: Half lengths along these, shape (planes, 2).
        radius: Of the sphere.
        cosine: Least cosine of a blow and the way from the closest point.
        gaps_out: Distance less radius, without sign; infinite where the blow points elsewhere.
        beyond_out: Whether the centre is past an end.
    """
    for m in range(len(arms)):
        for k in range(arms.shape[1]):
            way, beyond = row(arms[m], k), False
            for side in range(2):
                axis = row(axes[k], side)
                along = dot(row(arms[m], k), axis)
                inside = min(max(along, -half[k, side]), half[k, side])
                beyond = beyond or inside != along
                way = minus(way, times(inside, axis))
            blow, distance = row(blows[m], k), length(way)
            pushes = dot(way, blow) > cosine * max(distance * length(blow), 1e-300)
            gaps_out[m, k] = abs(distance - radius) if pushes else math.inf
            beyond_out[m, k] = beyond
