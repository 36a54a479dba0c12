# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How well the regions about a forecast position hold what happened."""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from ...scenes.regions import NORMAL, Regions
from ...scenes.state import Array

REGIONS = (0.5, 0.9)
"""Probabilities of the regions whose coverage is counted."""


def region_distance(off: Array, covariance: Array, noise: float) -> float | None:
    """Distance of a sample from a forecast [deviations]: the root of off^T (C + s^2)^-1 off.

    Arguments as of `region_probability`; None where a value is not finite.
    """
    total = covariance + np.eye(3) * max(noise, 1e-9) ** 2
    if not (np.isfinite(total).all() and np.isfinite(off).all()):
        return None
    return float(np.sqrt(off @ np.linalg.solve(total, off)))


def region_probability(
    off: Array, covariance: Array, noise: float, time: float = 0.0, regions: Regions | None = None
) -> float | None:
    """Probability of the smallest region about a forecast that holds a sample.

    It is that of `region_distance`, with C of the forecast and s the noise of the sample.

    Args:
        off: Forecast less sample [m], shape (3,).
        covariance: C [m^2], shape (3, 3).
        noise: s [m].
        time: Time ahead [s].
        regions: Sizes of the regions; None: of a normal distribution.

    Returns:
        The probability; None where a value is not finite.
    """
    distance = region_distance(off, covariance, noise)
    return None if distance is None else (regions or NORMAL).probability(distance, time)


def crps(off: Array, covariance: Array, noise: float) -> float | None:
    """Continuous ranked probability score [m], mean over the three coordinates; less is better.

    Of a normal distribution s (z (2 Phi(z) - 1) + 2 phi(z) - 1 / sqrt(pi)), z = off / s
    (Gneiting et al., Calibrated probabilistic forecasting, 2005). It is |off| where s is 0, so it
    has the unit of the error, and grows with what is too wide as with what is too narrow.
    Arguments as of `region_probability`.
    """
    deviations = np.sqrt(np.diagonal(covariance) + max(noise, 1e-9) ** 2)
    if not (np.isfinite(deviations).all() and np.isfinite(off).all()):
        return None
    z = off / deviations
    density = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi)
    scores = z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi)
    return float((deviations * scores).mean())
