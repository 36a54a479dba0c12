# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How wide the regions of forecasts must be to hold what left-out tracks did.

The covariance of a forecast is spread C + (q t^3 / 3 + kappa^2 sum (u t_i)^2 + s^2) 1, with C of
the estimate, t the time ahead, u the approach speeds of impacts and t_i the times since. `spread`,
q and kappa are those for which regions of a normal distribution hold the parts that they should.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from .left_out import Forecast, HORIZONS
from ..scenes.state import Array

REGIONS = (0.5, 0.9)
# values that are tried: factors of the covariance, q, kappa
_SPREADS = np.geomspace(0.25, 16.0, 13)
_DRIFTS = np.concatenate([[0.0], np.geomspace(1e-5, 1.0, 16)])
_IMPACTS = (0.0, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.09, 0.13)
_BOUNDS = tuple(float(chi2.ppf(region, 3)) for region in REGIONS)
# a forecast beyond this distance met what cannot be foreseen, as a net; of all at most this part
_FAR, _MOST_FAR = 30.0, 0.1
# a group of forecasts counts as much as it could with so many more
_FEW = 10


def fit_coverage(
    found: Sequence[Forecast], noise: Array
) -> tuple[tuple[float, float, float], dict[str, list[float]]]:
    """Spread, q and kappa of forecasts, and the parts held by horizon.

    First for the smaller region alone, of which the far ones cannot make a wide one; then for both
    without those that are far out of it.

    Args:
        found: Forecasts of left-out tracks.
        noise: s, q, kappa of the fit.

    Returns:
        `spread`, q, kappa; and for each horizon number of forecasts and the parts that the regions
        hold, far ones with them.
    """
    values, axes = np.linalg.eigh(np.array([one.covariance for one in found]))
    values = np.maximum(values, 0.0)
    squares = np.einsum('nab,na->nb', axes, np.array([one.off for one in found])) ** 2
    leads = np.array([one.lead for one in found])
    kicks = np.array([one.kicks for one in found])
    horizons = np.array([one.horizon for one in found])
    groups = 2 * np.searchsorted(HORIZONS, horizons) + np.array(
        [one.contacts > 0 for one in found]
    )

    def distances(spread: float, drift: float, impact: float) -> Array:
        more = drift * leads**3 / 3.0 + impact**2 * kicks + noise[0] ** 2
        total: Array = (squares / (spread * values + more[:, None])).sum(axis=1)
        return total

    def search(taken: NDArray[np.int64], regions: int) -> tuple[float, float, float]:
        best, least = (1.0, 0.0, 0.0), np.inf
        for values_tried in product(_SPREADS, _DRIFTS, _IMPACTS):
            cost = _cost(distances(*values_tried)[taken], groups[taken], regions)
            if cost < least - 1e-9:  # of equals the narrowest
                least, best = cost, values_tried
        return best

    every = np.arange(len(found))
    apart = distances(*search(every, 1))
    limit = max(_FAR, float(np.quantile(apart, 1.0 - _MOST_FAR)))
    best = search(every[apart <= limit], 2)
    spread, drift, impact = (float(value) for value in best)
    return (spread, drift, impact), parts_held(distances(*best), horizons)


def parts_held(distances: Array, horizons: Array) -> dict[str, list[float]]:
    """Number, and parts of outcomes in the regions, by horizon."""
    held = {}
    for horizon in HORIZONS:
        own = distances[horizons == horizon]
        if len(own):
            parts = [float((own <= bound).mean()) for bound in _BOUNDS]
            held[f'{horizon:g}'] = [len(own), *parts]
    return held


def _cost(distances: Array, groups: Array, regions: int) -> float:
    cost = 0.0
    for group in np.unique(groups):
        own = distances[groups == group]
        weight = len(own) / (len(own) + _FEW)
        for region, bound in zip(REGIONS[:regions], _BOUNDS, strict=False):
            held = np.count_nonzero(own <= bound) / len(own)
            cost += weight * (held - region) ** 2
    return float(cost)
