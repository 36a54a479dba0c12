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
from scipy.stats import chi2

from .left_out import Forecast, HORIZONS
from ..scenes.state import Array

REGIONS = (0.5, 0.9)
# factors that are tried, of the covariance and of q, and values of kappa
_SPREADS = np.geomspace(0.25, 32.0, 15)
_DRIFTS = np.concatenate([[0.0], np.geomspace(1e-2, 1e2, 13)])
_IMPACTS = (0.0, 0.01, 0.015, 0.02, 0.03, 0.04, 0.06, 0.09, 0.13)
_BOUNDS = tuple(float(chi2.ppf(region, 3)) for region in REGIONS)


def fit_coverage(
    found: Sequence[Forecast], noise: Array
) -> tuple[tuple[float, float, float], dict[str, list[float]]]:
    """Spread, q and kappa of forecasts, and the parts held by horizon.

    Args:
        found: Forecasts of left-out tracks.
        noise: s, q, kappa of the fit.

    Returns:
        `spread`, q, kappa; and for each horizon number of forecasts and the parts that the regions
        hold.
    """
    values, axes = np.linalg.eigh(np.array([one.covariance for one in found]))
    values = np.maximum(values, 0.0)
    squares = np.einsum('nab,na->nb', axes, np.array([one.off for one in found])) ** 2
    leads = np.array([one.lead for one in found])
    kicks = np.array([one.kicks for one in found])
    horizons = np.array([one.horizon for one in found])
    best, least = (1.0, float(noise[1]), 0.0), np.inf
    for spread, factor, impact in product(_SPREADS, _DRIFTS, _IMPACTS):
        drift = factor * noise[1]
        more = drift * leads**3 / 3.0 + impact**2 * kicks + noise[0] ** 2
        distances = (squares / (spread * values + more[:, None])).sum(axis=1)
        cost = _cost(distances, horizons)
        if cost < least - 1e-9:  # of equals the narrowest
            least, best = cost, (float(spread), float(drift), impact)
    more = best[1] * leads**3 / 3.0 + best[2] ** 2 * kicks + noise[0] ** 2
    distances = (squares / (best[0] * values + more[:, None])).sum(axis=1)
    return best, parts_held(distances, horizons)


def parts_held(distances: Array, horizons: Array) -> dict[str, list[float]]:
    """Number, and parts of outcomes in the regions, by horizon."""
    held = {}
    for horizon in HORIZONS:
        own = distances[horizons == horizon]
        if len(own):
            parts = [float((own <= bound).mean()) for bound in _BOUNDS]
            held[f'{horizon:g}'] = [len(own), *parts]
    return held


def _cost(distances: Array, horizons: Array) -> float:
    cost = 0.0
    for horizon in HORIZONS:
        own = distances[horizons == horizon]
        for region, bound in zip(REGIONS, _BOUNDS, strict=True):
            held = np.count_nonzero(own <= bound) / len(own) if len(own) else region
            # within what so many forecasts can tell, little is lost
            apart = max(abs(held - region) - 0.5 * np.sqrt(0.25 / max(len(own), 1)), 0.0)
            cost += apart**2 + 0.1 * (held - region) ** 2
    return float(cost)
