# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least squares over short rollouts as a function of materials, with a robust loss."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .windows import residuals, Window
from ..rollout.simulator import Simulator
from ..running.progress import Progress
from ..scenes.state import Array


class Bounds(NamedTuple):
    """Range of a material, scanned values, step of differences, and error that counts as known."""

    low: float
    high: float
    tried: tuple[float, ...]
    step: float
    known: float


_RESTITUTION = Bounds(0.0, 1.0, (0.2, 0.4, 0.55, 0.7, 0.85, 0.95), 0.01, 0.1)
_FRICTION = Bounds(0.0, 1.5, (0.05, 0.2, 0.4, 0.6, 0.9), 0.02, 0.15)
MATERIALS = {
    'restitution': _RESTITUTION,
    'friction': _FRICTION,
    'rolling_friction': Bounds(0.0, 0.3, (0.0, 0.02, 0.05, 0.1), 0.004, 0.02),
    'surface_restitution': _RESTITUTION,
    'surface_friction': _FRICTION,
}
# scales of the Cauchy loss [standard deviations]: wide at first, so that all errors count
SCALES = (30.0, 3.0)
# windows on which starting values are scanned
_SCANNED = 20
# largest number of steps of a least-squares fit at one scale
_MOST = 12
# slopes by finite differences are rough: a direction with less than this part of the largest
# curvature may be flat, and a material with more than this component along it is not identified
_BLURRED, _TURNED = 1e-3, 0.1
# number of groups of windows that are fitted separately, and least number of windows in a group
_GROUPS, _LEAST = 8, 5


def most_evaluations(names: Sequence[str]) -> int:
    """Upper bound of the number of times that all windows are rolled out."""
    scan = 1 + sum(len(MATERIALS[name].tried) for name in names)
    fits = (len(SCALES) + _GROUPS) * _MOST
    # errors and slopes, once for each step of a fit and twice more; again where a material drops
    # out
    return scan + sum((fits + 2) * (1 + 2 * count) for count in range(1, 1 + len(names)))


class MaterialFit:
    """Errors of all windows as a function of scanned materials, with the others fixed.

    Args:
        simulator: Model that takes materials.
        windows: Windows to fit.
        values: Values of all materials; those that are not fitted keep them.
        progress: Updated after each evaluation of all windows.
    """

    def __init__(
        self,
        simulator: Simulator,
        windows: Sequence[Window],
        values: dict[str, float],
        progress: Progress,
    ) -> None:
        self.simulator, self.windows, self.fixed = simulator, windows, values
        self.progress = progress

    def all_residuals(self, values: dict[str, float]) -> list[Array]:
        """Residuals of each window, see `residuals`."""
        materials = self.fixed | values
        self.progress.update(1, **{name: float(value) for name, value in materials.items()})
        return [residuals(self.simulator, window, materials) for window in self.windows]

    def scan(self) -> dict[str, float]:
        """Best of the scanned values, one material at a time, on scanned of the windows."""
        if len(self.windows) > _SCANNED:
            every = len(self.windows) // _SCANNED
            scanned = self.windows[::every][:_SCANNED]
            return MaterialFit(self.simulator, scanned, self.fixed, self.progress).scan()
        best = dict(self.fixed)
        cost = self._cost(best)
        for name in best:
            for value in MATERIALS[name].tried:
                tried = self._cost(best | {name: value})
                if tried < cost:
                    cost, best = tried, best | {name: value}
        return best

    def identifiable(self, values: dict[str, float]) -> list[str]:
        """Materials on which the errors depend at all."""
        slopes = np.concatenate(self._slopes(values))
        size = np.linalg.norm(slopes, axis=0)
        return [n for n, s in zip(values, size, strict=True) if s * MATERIALS[n].known > 1.0]

    def solve(self, start: dict[str, float], scales: Sequence[float] = SCALES) -> dict[str, float]:
        """Least-squares values from a start, under the Cauchy loss of each scale in turn."""
        from scipy.optimize import least_squares

        if not start:
            return {}
        names = list(start)
        low = np.array([MATERIALS[name].low for name in names])
        high = np.array([MATERIALS[name].high for name in names])
        point = np.array([start[name] for name in names])

        def named(x: Array) -> dict[str, float]:
            return dict(zip(names, x.tolist(), strict=True))

        for scale in scales:
            point = least_squares(
                lambda x: np.concatenate(self.all_residuals(named(x))),
                np.clip(point, low + 1e-6, high - 1e-6),  # a start must lie inside the bounds
                jac=lambda x: np.concatenate(self._slopes(named(x))),
                bounds=(low, high),
                x_scale=[MATERIALS[name].known for name in names],
                loss='cauchy',
                f_scale=scale,
                xtol=1e-3,
                ftol=1e-5,
                max_nfev=_MOST,
            ).x
        return named(point)

    def errors(self, values: dict[str, float]) -> dict[str, float]:
        """Standard errors: the larger of two estimates that both allow for unequal errors.

        One is the sandwich estimate with windows as clusters. The other is the spread of separate
        fits to groups of windows, which also shows the roughness of the cost.
        """
        if not values:
            return {}
        slopes = self._by_slopes(values)
        groups = self._by_groups(values)
        return {name: max(slopes[name], groups[name]) for name in values}

    def _by_slopes(self, values: dict[str, float]) -> dict[str, float]:
        gradients, hessian = [], np.zeros((len(values), len(values)))
        for errors, slopes in zip(self.all_residuals(values), self._slopes(values), strict=True):
            weight = 1.0 / (1.0 + (errors / SCALES[-1]) ** 2)
            gradients.append(slopes.T @ (weight * errors))
            hessian += (slopes * weight[:, None]).T @ slopes
        # in units of the error that counts as known; directions that change no residual are
        # unidentified
        known = np.array([MATERIALS[name].known for name in values])
        curvatures, directions = np.linalg.eigh(hessian * np.outer(known, known))
        flat = curvatures < max(1.0, _BLURRED * curvatures[-1])
        inverse = (directions / np.where(flat, np.inf, curvatures)) @ directions.T
        spread = np.stack(gradients) * known
        covariance = inverse @ (spread.T @ spread) @ inverse
        covariance *= len(gradients) / max(len(gradients) - len(values), 1)
        errors = known * np.sqrt(np.diag(covariance))
        errors[np.abs(directions[:, flat]).max(axis=1, initial=0.0) > _TURNED] = np.inf
        return dict(zip(values, errors.tolist(), strict=True))

    def _by_groups(self, values: dict[str, float]) -> dict[str, float]:
        groups = min(_GROUPS, len(self.windows) // _LEAST)
        if groups < 2:
            return dict.fromkeys(values, 0.0)
        # interleaved, so that each group has windows of all records
        parts = [
            MaterialFit(self.simulator, self.windows[index::groups], self.fixed, self.progress)
            for index in range(groups)
        ]
        group_values = [list(part.solve(values, SCALES[-1:]).values()) for part in parts]
        spread = np.std(group_values, axis=0, ddof=1) / np.sqrt(groups)
        return dict(zip(values, spread.tolist(), strict=True))

    def _cost(self, values: dict[str, float]) -> float:
        scale = SCALES[-1]
        return sum(float(np.log1p((e / scale) ** 2).sum()) for e in self.all_residuals(values))

    def _slopes(self, values: dict[str, float]) -> list[Array]:
        """Derivatives of the residuals of each window, shape (residuals, materials)."""
        columns = []
        for name, value in values.items():
            low, high, _, step, _ = MATERIALS[name]
            under, over = max(value - step, low), min(value + step, high)
            ends = [self.all_residuals(values | {name: end}) for end in (under, over)]
            columns.append([(b - a) / (over - under) for a, b in zip(*ends, strict=True)])
        return [np.stack(parts, axis=1) for parts in zip(*columns, strict=True)]
