# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maximum a posteriori fit of shared parameters and of a start per stretch.

The loss is the sum over stretches of Huber's loss of the whitened residuals and of the prior of
the start, and a weak prior of each parameter. Gauss-Newton steps of the parameters come from the
normal equations with the starts eliminated (`elimination`); after each, every start is fitted
anew, so that a stretch at the verge of a contact does not hold up the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .elimination import eliminated, standard_errors
from .parameters import Parameter
from .problem import Problem
from ..scenes.state import Array
from ..tracking.ball_estimate import first_guess
from ..tracking.ball_fit import fit_start
from ..tracking.ball_model import BallModel
from ..tracking.ball_path import path
from ..tracking.ball_window import MOST_CONTACTS
from ..tracking.start_guess import first_frames

_MOST_DAMPING = 1e4
# a step that lowers the loss, -2 log L, by less is the last one
_CONVERGED = 0.1
# parts of a friction that are tried first
_SCANNED = (0.35, 0.5, 0.7, 1.4)
# a stretch that is met has this loss per coordinate at most; factor of growth of a first fit
_MET, _GROWTH = 3.0, 1.4
# loss per coordinate of a start whose path cannot be fitted
_LOST = 1e6


@dataclass
class Fitted:
    """A joint fit.

    Args:
        values: Value of each parameter.
        starts: Start of each stretch, shape (stretches, 9).
        losses: Loss per coordinate of each stretch, shape (stretches,).
        impacts: Number of impacts in each stretch, shape (stretches,).
        spin_covariances: Of the starts' spins, shape (stretches, 3, 3).
        errors: Standard errors, from the scores of tracks (sandwich).
        formal: Standard errors as if the noise were all.
    """

    values: dict[str, float]
    starts: Array
    losses: Array
    impacts: NDArray[np.int64]
    spin_covariances: Array
    errors: dict[str, float] = field(default_factory=dict)
    formal: dict[str, float] = field(default_factory=dict)


class JointFit(Problem):
    """Fit of shared parameters and starts, see the module."""

    def fit(
        self,
        parameters: Sequence[Parameter],
        values: Mapping[str, float],
        starts: Array | None = None,
        rounds: int = 24,
        scan: bool = True,
    ) -> Fitted:
        """Fit parameters from values, others stay; with `scan` from several frictions."""
        free = list(parameters)
        now = {**{p.name: p.start for p in free}, **values}
        # also anew: what was best under other laws may be at a wrong bounce under these
        found, losses = self.solve(now, None)
        if starts is not None:
            others, after = self.solve(now, starts)
            better = after < losses
            found[better], losses[better] = others[better], after[better]
        starts = found
        for p in free:
            if scan and p.name.endswith('.friction'):
                now, starts, losses = self._scanned(p, now, starts, losses)
        total = losses.sum() + _prior(free, now)
        damping = 1e-3
        for _ in range(rounds if free else 0):
            normal = eliminated(self, free, now, starts)
            accepted = False
            while damping < _MOST_DAMPING:
                damped = normal.matrix + damping * np.diag(np.diag(normal.matrix))
                step = np.linalg.solve(damped, normal.vector)
                tried = {
                    **now,
                    **{
                        p.name: float(np.clip(now[p.name] + d, p.low, p.high))
                        for p, d in zip(free, step, strict=True)
                    },
                }
                moved = starts + np.stack(
                    [inverse @ (g - cross @ step) for inverse, g, cross in normal.blocks]
                )
                ends, after = self.solve(tried, moved, starts)
                loss = after.sum() + _prior(free, tried)
                if loss < total:
                    accepted = True
                    break
                damping *= 10.0
            if not accepted:
                break
            gain, total = total - loss, loss
            now, starts, losses = tried, ends, after
            damping = max(damping / 10.0, 1e-6)
            if gain < _CONVERGED:
                break
        normal = eliminated(self, free, now, starts)
        counts = np.array([3 * len(one.times) for one in self.found])
        fitted = Fitted(
            now,
            starts,
            losses / counts,
            self._impacts(now, starts),
            np.stack([inverse[6:, 6:] for inverse, _, _ in normal.blocks]),
        )
        if free:
            fitted.errors, fitted.formal = standard_errors(free, normal)
        return fitted

    def fit_known(
        self, parameters: Sequence[Parameter], fitted: Fitted, known: NDArray[np.int64], scan: bool
    ) -> Fitted:
        """Fit parameters to some stretches, from an earlier fit; starts of all with them."""
        part = self.part(known).fit(parameters, fitted.values, fitted.starts[known], scan=scan)
        whole = self.fit((), part.values, fitted.starts)
        whole.errors, whole.formal = part.errors, part.formal
        return whole

    def _scanned(
        self, p: Parameter, values: dict[str, float], starts: Array, losses: Array
    ) -> tuple[dict[str, float], Array, Array]:
        """Values with the best of some of a parameter; starts and losses of these.

        Contacts that grip have no slope over friction, so that a fit from too high would stay, and
        one that grips and one that slides may both be a minimum.
        """
        best = (values, starts, losses)
        for factor in _SCANNED:
            tried = {**values, p.name: float(np.clip(factor * values[p.name], p.low, p.high))}
            found, after = self.solve(tried, starts)
            if after.sum() < best[2].sum():
                best = (tried, found, after)
        return best

    def _impacts(self, values: Mapping[str, float], starts: Array) -> NDArray[np.int64]:
        """Number of impacts in each stretch."""
        models = self.laws.models_at(values)
        counts = np.zeros(len(self.found), dtype=np.int64)
        for k, one in enumerate(self.found):
            model = self.model_of(one, models)
            laws = (model.ball, model.planes, model.laws)
            states, impacts = np.zeros((len(one.times), 9)), np.zeros((MOST_CONTACTS, 3))
            counts[k], _ = path(starts[k], one.times[0], one.times, *laws, one.on, states, impacts)
        return counts

    def solve(
        self, values: Mapping[str, float], starts: Array | None, others: Array | None = None
    ) -> tuple[Array, Array]:
        """Starts and losses of all stretches; the better from two sets of starts."""
        models = self.laws.models_at(values)
        found, losses = np.empty((len(self.found), 9)), np.empty(len(self.found))
        for k in range(len(self.found)):
            tries = [None] if starts is None else [starts[k]]
            if others is not None:
                tries.append(others[k])
            best = np.inf
            for start in tries:
                one, loss = self._start(k, models, start)
                if loss < best:
                    best, found[k], losses[k] = loss, one, loss
                if others is not None and loss < 3 * len(self.found[k].times):
                    break  # well met: no need of the other start
        return found, losses

    def _start(
        self, k: int, models: Sequence[BallModel], start: Array | None
    ) -> tuple[Array, float]:
        one = self.found[k]
        if start is None:
            met = self._fit_one(k, models, self.guesses[k], first_frames(one.times))
            if met[1] > _MET * 3 * len(one.times):  # an impact may be in the first frames
                again = self.guesses[k].copy()
                model = self.model_of(one, models)
                again[:6] = first_guess(model, one.times, one.positions, one.on, 4)
                other = self._fit_one(k, models, again, 4)
                met = other if other[1] < met[1] else met
            return met
        return self._fit_one(k, models, start, len(one.times))

    def _fit_one(
        self, k: int, models: Sequence[BallModel], start: Array, first: int
    ) -> tuple[Array, float]:
        one = self.found[k]
        model = self.model_of(one, models)
        point = start.copy()
        information, end, covariance = np.zeros((9, 9)), np.zeros(9), np.zeros((9, 9))
        m = len(one.times)
        try:
            loss, _, _ = fit_start(
                point,
                self.means[k],
                self.precisions[k],
                self.varied,
                one.times[0],
                one.times,
                one.positions,
                model.ball,
                model.planes,
                model.laws,
                one.on,
                self.noise,
                first,
                _GROWTH,
                15 if first < m else 6,
                np.inf,
                self.weights[k],
                information,
                end,
                covariance,
                np.zeros((MOST_CONTACTS, 3)),
            )
        except np.linalg.LinAlgError:  # slopes through hundreds of slow impacts overflow
            return start.copy(), _LOST * 3 * m
        apart = point - self.means[k]
        return point, loss * 3 * m + float(apart @ self.precisions[k] @ apart)


def _prior(free: Sequence[Parameter], values: Mapping[str, float]) -> float:
    return sum(((values[p.name] - p.start) / p.width) ** 2 for p in free)
