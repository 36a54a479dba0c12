# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise of the tracker and drift of the laws, by the likelihood of the residuals.

The starts are integrated out (Laplace's approximation), or a drift would be taken for a start:

    -2 log L = sum over stretches of loss + log det S + log det (H + prior)

with S of the innovations and H of the start. Stretches that hold what the laws do not know at all
are left out: one of them would make a drift of all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .joint_fit import Fitted, JointFit
from ..scenes.state import Array
from ..tracking.ball_slopes import normal_equations

# least and largest values of s [m], q [m^2/s^3], kappa
LOW, HIGH = np.array([1e-5, 1e-8, 1e-4]), np.array([0.05, 10.0, 0.1])
# what kappa is beforehand, and how widely its logarithm spreads
_KICK, _KICK_WIDTH = 0.02, 0.5
# most evaluations of the search
_EVALUATIONS = 50
# a stretch holds something unknown with this many times the loss that this part of all are below:
# of a juggler's balls most are in hands
_UNKNOWN, _SURELY_KNOWN = 4.0, 0.3


def known_stretches(fitted: Fitted) -> NDArray[np.bool_]:
    """Mask of stretches whose loss is not far above that of the best of their kind.

    Those with impacts are one kind, those without another: what is lost at an impact is more.
    """
    known = np.zeros(len(fitted.losses), dtype=bool)
    for kind in (fitted.impacts > 0, fitted.impacts == 0):
        if kind.any():
            losses = fitted.losses[kind]
            known[kind] = losses <= _UNKNOWN * float(np.quantile(losses, _SURELY_KNOWN))
    return known


def fit_noise(fit: JointFit, fitted: Fitted, done: Callable[[], object] = lambda: None) -> Array:
    """Most likely s, q, kappa, see `model_error.NOISE`, with the parameters as fitted.

    Args:
        fit: Stretches and their priors.
        fitted: Parameters and starts.
        done: Called after each evaluation.
    """
    from scipy.optimize import minimize

    chosen = np.flatnonzero(known_stretches(fitted))
    part = fit.part(chosen)
    first = np.log(np.clip(fit.noise, LOW, HIGH))

    def cost(point: Array) -> float:
        done()
        outside = np.maximum(0.0, np.log(LOW) - point) + np.maximum(0.0, point - np.log(HIGH))
        part.noise = np.exp(np.clip(point, np.log(LOW), np.log(HIGH)))
        own = float(((point[2] - np.log(_KICK)) / _KICK_WIDTH) ** 2)
        likelihood = _likelihood(part, fitted.values, fitted.starts[chosen])
        return likelihood + own + 1e3 * float(outside.sum())

    simplex = first + np.array([[0, 0, 0], [-0.3, 0, 0], [0, -1.0, 0], [0, 0, 0.7]])
    options = {'initial_simplex': simplex, 'maxfev': _EVALUATIONS, 'xatol': 0.05, 'fatol': 1.0}
    found = minimize(cost, first, method='Nelder-Mead', options=options).x
    likely: Array = np.clip(np.exp(found), LOW, HIGH)
    return likely


def _likelihood(fit: JointFit, values: dict[str, float], starts: Array) -> float:
    """-2 log L but for a constant."""
    starts, losses = fit.solve(values, starts)
    total = float(losses.sum())
    for k, one in enumerate(fit.found):
        model = fit.model_of(one, fit.laws.models_at(values))
        matrix, vector, none = np.zeros((9, 9)), np.zeros(9), np.zeros((0, 1, 16))
        _, log = normal_equations(
            starts[k],
            fit.varied,
            one.times[0],
            one.times,
            one.positions,
            model.ball,
            model.planes,
            model.laws,
            one.on,
            fit.noise,
            fit.weights[k],
            none,
            np.zeros((0, *model.planes.shape)),
            np.zeros((0, *model.laws.shape)),
            np.zeros(0),
            matrix,
            vector,
        )
        total += log + float(np.linalg.slogdet(matrix + fit.precisions[k])[1])
    return total
