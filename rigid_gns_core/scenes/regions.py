# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How large regions of forecasts are, by what those of left-out tracks had to be.

About a forecast with covariance S the region that holds an outcome e with probability P is

    e^T S^-1 e <= r(P)^2,    log r = log r_n(P) + log f(P)

with r_n of a normal distribution (chi-squared of three degrees of freedom). Errors have heavier
tails, by how much depends on the time ahead, and in a plane they have two degrees of freedom: f is
told at 50 and at 90 %, and log f is linear in log r_n, so that r is a power of r_n.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammainc, gammaincinv

from .state import Array
from ..errors import UserError

PARTS = (0.5, 0.9)
"""Probabilities at which factors are told."""


def normal_radius(probability: ArrayLike) -> Array:
    """r_n [deviations] of the region of a normal distribution in three dimensions."""
    found: Array = np.sqrt(2.0 * gammaincinv(1.5, np.asarray(probability, dtype=np.float64)))
    return found


_RADII = normal_radius(PARTS)


@dataclass(frozen=True)
class Regions:
    """Factors on the radii of regions.

    Args:
        rows: Time ahead [s], rising, and the factors at 50 and 90 %; in between they are
            interpolated, beyond the last they stay.

    Raises:
        UserError: There are no rows, one has not three numbers above 0, times do not rise, or a
            region of 90 % is no larger than that of 50 %.
    """

    rows: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if not self.rows or {len(row) for row in self.rows} != {3}:
            raise UserError(
                'regions of a tracker are no rows of three numbers (time [s], factors at 50 and '
                '90 %); fit them anew by `rigid-gns calibrate`'
            )
        values = np.array(self.rows)
        if not (np.isfinite(values).all() and (values > 0.0).all()):
            raise UserError('regions of a tracker hold a number that is not finite and above 0')
        if not (np.diff(values[:, 0]) > 0.0).all():
            raise UserError('times of the regions of a tracker do not rise; sort the rows')
        if not (values[:, 2] * _RADII[1] > values[:, 1] * _RADII[0]).all():
            raise UserError('a region of 90 % of a tracker is no larger than that of 50 %')

    def radii(self, probability: float, times: ArrayLike) -> Array:
        """Radii [deviations] of the regions of a probability at times ahead [s], shape (k,)."""
        scale, power = self._power(np.asarray(times, dtype=np.float64))
        return np.asarray(scale * normal_radius(probability) ** power)

    def probability(self, distance: float, time: float) -> float:
        """Probability of the smallest region that holds what is so far off [deviations]."""
        scale, power = self._power(np.asarray(time))
        return float(gammainc(1.5, 0.5 * (distance / scale) ** (2.0 / power)))

    def _power(self, times: Array) -> tuple[Array, Array]:
        """Values c and p of r = c r_n^p."""
        values = np.array(self.rows)
        radii = [
            np.exp(np.interp(times, values[:, 0], np.log(values[:, 1 + k] * _RADII[k])))
            for k in (0, 1)
        ]
        power = np.log(radii[1] / radii[0]) / np.log(_RADII[1] / _RADII[0])
        return radii[0] / _RADII[0] ** power, power


NORMAL = Regions(((1.0, 1.0, 1.0),))
"""Regions of a normal distribution."""
