# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spin of a window by those that began alike, compiled; see `start_prior`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .jit import entry
from ..scenes.state import Array


class SpinWindows(NamedTuple):
    """Windows of known spin.

    features, spins, covariances: see `StartPrior`; counted: weight of each, less than 1 where the
    spin is hardly known; scales: unit of distance of each feature; mean, covariance: of all;
    bandwidth, shrinkage, floor: see `StartPrior`.
    """

    features: Array
    spins: Array
    covariances: Array
    counted: Array
    scales: Array
    mean: Array
    covariance: Array
    bandwidth: float
    shrinkage: float
    floor: float


@entry
def spin_at(
    windows: SpinWindows, counted: Array, guess: Array, mean_out: Array, covariance_out: Array
) -> None:
    """Mean and covariance of the spin of a window in world axes.

    Args:
        windows: Others.
        counted: Their weights, shape (k,).
        guess: Position and velocity at its start, shape (6,).
        mean_out: Mean [rad/s], shape (3,).
        covariance_out: Covariance, shape (3, 3).
    """
    mean, covariance = windows.mean.copy(), windows.covariance.copy()
    if math.isfinite(windows.bandwidth):
        total, near, square = 0.0, np.zeros(3), np.zeros((3, 3))
        for i in range(len(windows.spins)):
            apart = 0.0
            for c in range(6):
                off = (windows.features[i, c] - guess[c]) / windows.scales[c]
                apart += off * off / 6.0
            weight = counted[i] * math.exp(-0.5 * apart / windows.bandwidth**2)
            total += weight
            for a in range(3):
                near[a] += weight * windows.spins[i, a]
                for b in range(3):
                    product = (windows.spins[i, a] - mean[a]) * (windows.spins[i, b] - mean[b])
                    square[a, b] += weight * (product + windows.covariances[i, a, b])
        share = windows.shrinkage / (total + windows.shrinkage)
        if share < 1.0:
            apart_of = near / total - mean
            for a in range(3):
                for b in range(3):
                    product = apart_of[a] * apart_of[b]
                    spread = (1.0 - share) * (square[a, b] / total - product)
                    covariance[a, b] = (
                        spread + share * covariance[a, b] + share * (1.0 - share) * product
                    )
                mean[a] += (1.0 - share) * apart_of[a]
    for c in range(3):
        covariance[c, c] += windows.floor**2
    turn = heading(guess[3], guess[4])
    mean_out[:] = turn @ mean
    covariance_out[:] = turn @ covariance @ turn.T


@entry
def heading(along: float, across: float) -> Array:
    """Columns: along a horizontal velocity, across it, up; in world axes, shape (3, 3)."""
    size = math.hypot(along, across)
    c, s = (along / size, across / size) if size > 0.0 else (1.0, 0.0)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
