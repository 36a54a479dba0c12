# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How wide the regions of forecasts must be to hold what left-out tracks did.

The covariance of a forecast is

    S = spread C + (b^2 t^4 / 4 + q t^3 / 3 + kappa^2 sum (u t_i)^2 + s^2) 1

with C of the estimate, t the time ahead, u the approach speeds of impacts and t_i the times since.
A law that is slightly wrong is wrong in the same way all along a path, so its error grows as that
of an acceleration b, and what changes on the way as a drift of density q. Errors have heavy tails:
`spread`, b, kappa and q are the most probable ones where errors are of a Student distribution with
`_FREEDOM` degrees,

    -2 log L = sum log |S| + (_FREEDOM + 3) log(1 + e^T S^-1 e / _FREEDOM),

each with a weak prior. Regions are told as of a normal distribution, so S is then scaled to where
those of 50 and 90 % come nearest to holding these parts, each horizon counting alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.stats import chi2, f

from .left_out import Forecast, HORIZONS
from ..scenes.state import Array

REGIONS = (0.5, 0.9)
_BOUNDS = chi2.ppf(REGIONS, 3)
# degrees of freedom of the errors; a group of forecasts counts as much as it could with so many
# more
_FREEDOM, _FEW = 4.0, 10
# priors: deviations of the logarithms of spread, b, kappa and q, and least kappa at their middle
_WIDTHS, _LEAST_KICK = np.array([1.0, 0.75, 1.0, 1.5]), 5e-3
# factors that are tried on the scale of a Student distribution, and what the square of their
# logarithm costs, over the number of forecasts
_FACTORS, _COST = np.exp(np.linspace(-1.5, 1.5, 121)), 2.0


def fit_coverage(
    found: Sequence[Forecast], noise: Array
) -> tuple[tuple[float, float, float, float], dict[str, list[float]]]:
    """Spread, b [m/s^2], kappa and q [m^2/s^3] of forecasts, and the parts held by horizon.

    Args:
        found: Forecasts of left-out tracks.
        noise: s, q, kappa of the fit.

    Returns:
        `spread`, b, kappa, q; and for each horizon number of forecasts and the parts that the
        regions hold.
    """
    values, axes = np.linalg.eigh(np.array([one.covariance for one in found]))
    values = np.maximum(values, 0.0)
    squares = np.einsum('nab,na->nb', axes, np.array([one.off for one in found])) ** 2
    leads = np.array([one.lead for one in found])
    kicks = np.array([one.kicks for one in found])
    horizons = np.array([one.horizon for one in found])
    weights = _weights(horizons, np.array([one.contacts > 0 for one in found]))

    def variances(spread: float, off: float, impact: float, drift: float) -> Array:
        """Of each forecast along the axes of its covariance [m^2], shape (n, 3)."""
        more = off**2 * leads**4 / 4.0 + impact**2 * kicks + noise[0] ** 2
        more += drift * leads**3 / 3.0
        total: Array = spread * values + more[:, None]
        return total

    # a drift of density q has the variance of b^2 = 2 q after a second or so; less beside b
    drift = max(noise[1], 1e-4)
    middle = np.log([1.0, np.sqrt(2.0 * drift), max(noise[2], _LEAST_KICK), drift / 4.0])

    def cost(point: Array) -> float:
        own = variances(*np.exp(point))
        far = np.log1p((squares / own).sum(axis=1) / _FREEDOM)
        total = weights @ (np.log(own).sum(axis=1) + (_FREEDOM + 3.0) * far)
        return float(total + (((point - middle) / _WIDTHS) ** 2).sum())

    # by itself the search takes a step of next to nothing from a logarithm of 0
    simplex = middle + np.concatenate([np.zeros((1, 4)), np.diag(_WIDTHS)])
    options = {'maxiter': 4000, 'xatol': 1e-3, 'fatol': 1e-3, 'initial_simplex': simplex}
    best = np.exp(minimize(cost, middle, method='Nelder-Mead', options=options).x)
    alike = _weights(horizons, np.zeros(len(found), dtype=bool))
    scale = _as_normal((squares / variances(*best)).sum(axis=1), alike)
    spread, off, impact, drift = (best * scale ** np.array([1.0, 0.5, 0.5, 1.0])).tolist()
    apart = (squares / variances(spread, off, impact, drift)).sum(axis=1)
    return (spread, off, impact, drift), parts_held(apart, horizons)


def parts_held(distances: Array, horizons: Array) -> dict[str, list[float]]:
    """Number, and parts of outcomes in the regions, by horizon."""
    held = {}
    for horizon in HORIZONS:
        own = distances[horizons == horizon]
        if len(own):
            parts = [float((own <= bound).mean()) for bound in _BOUNDS]
            held[f'{horizon:g}'] = [len(own), *parts]
    return held


def _weights(horizons: Array, struck: Array) -> Array:
    """Weight of each forecast: groups by horizon and contact count more alike, shape (n,)."""
    groups = 2 * np.searchsorted(HORIZONS, horizons) + struck
    _, index, counts = np.unique(groups, return_inverse=True, return_counts=True)
    weights = 1.0 / (counts[index] + _FEW)
    return np.asarray(weights * len(horizons) / weights.sum())


def _as_normal(distances: Array, weights: Array) -> float:
    """Factor of S with which normal regions hold nearest their parts.

    Near that of a Student distribution, since few forecasts are counted.
    """

    def off(factor: float) -> float:
        held = f.cdf(_BOUNDS * factor / 3.0, 3, _FREEDOM)
        return float(((held - REGIONS) ** 2).sum())

    usual = float(minimize_scalar(off, bounds=(0.5, 4.0), method='bounded').x)
    inside = distances[:, None, None] <= _BOUNDS * usual * _FACTORS[:, None]
    held = np.average(inside, axis=0, weights=weights)
    costs = ((held - REGIONS) ** 2).sum(axis=1)
    costs += _COST / len(distances) * np.log(_FACTORS) ** 2
    return usual * float(_FACTORS[costs.argmin()])
