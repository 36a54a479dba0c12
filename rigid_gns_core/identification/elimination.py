# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Normal equations of the shared parameters, with the starts of the stretches eliminated.

With H, B, C the blocks of J^T W J of a start, of start and parameters, and of the parameters, and
g, b those of J^T W r, each with its prior:

    (sum C - B^T H^-1 B) step = sum b - B^T H^-1 g

(Schur complement). A term of the right side's sum is the score of a stretch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .parameters import Parameter
from .problem import Problem
from ..scenes.state import Array
from ..tracking.ball_slopes import normal_equations

# step of slopes over a parameter [widths of its prior]
_STEP = 1e-3
# of an information beyond this [1/m^2] the differences of sums have no digits: a thousand frames
# of a noise of 1e-5 m make 1e13
_OVERFLOW = 1e18


@dataclass(frozen=True)
class Eliminated:
    """Equations of the parameters.

    Args:
        matrix: Left side, shape (parameters, parameters).
        vector: Right side, shape (parameters,).
        blocks: H^-1, g, B of each stretch.
        scores: Sum of the scores of the stretches of each track.
    """

    matrix: Array
    vector: Array
    blocks: list[tuple[Array, Array, Array]]
    scores: dict[int, Array]


def eliminated(
    fit: Problem, free: Sequence[Parameter], values: Mapping[str, float], starts: Array
) -> Eliminated:
    """Equations at some values and starts."""
    count = len(free)
    models = fit.laws.models_at(values)
    steps = np.array([_STEP * p.width for p in free])
    moved = [
        fit.laws.models_at({**values, p.name: values[p.name] + step})
        for p, step in zip(free, steps, strict=True)
    ]
    matrix: Array = np.diag([p.width**-2 for p in free]) if count else np.zeros((0, 0))
    vector: Array = np.array([(p.start - values[p.name]) / p.width**2 for p in free])
    blocks, scores = [], dict[int, Array]()
    for k, one in enumerate(fit.found):
        s = min(one.sphere, len(models) - 1)
        model = models[s]
        whole, side = np.zeros((9 + count, 9 + count)), np.zeros(9 + count)
        normal_equations(
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
            np.array([m[s].ball for m in moved]).reshape(count, *model.ball.shape),
            np.array([m[s].planes for m in moved]).reshape(count, *model.planes.shape),
            np.array([m[s].laws for m in moved]).reshape(count, *model.laws.shape),
            steps,
            whole,
            side,
        )
        inverse = _inverse(whole[:9, :9] + fit.precisions[k])
        g: Array = side[:9] - fit.precisions[k] @ (starts[k] - fit.means[k])
        if inverse is None:  # it tells nothing: its start stays, as well known as beforehand
            inverse, g = np.asarray(np.linalg.inv(fit.precisions[k]), np.float64), np.zeros(9)
            whole, side = np.zeros_like(whole), np.zeros_like(side)
        cross = whole[:9, 9:]
        matrix += whole[9:, 9:] - cross.T @ inverse @ cross
        score: Array = side[9:] - cross.T @ (inverse @ g)
        vector += score
        blocks.append((inverse, g, cross))
        scores[one.track] = scores.get(one.track, np.zeros(count)) + score
    return Eliminated(matrix, vector, blocks, scores)


def _inverse(matrix: Array) -> Array | None:
    """Inverse of the block of a start; None where rounding leaves it none.

    Slopes through many impacts, or of a ball that comes to rest as its stretch begins, are of any
    size: where it stands is then all that its frames tell.
    """
    if not matrix.diagonal().max() < _OVERFLOW:
        return None
    try:
        inverse = np.asarray(np.linalg.inv(matrix), np.float64)
    except np.linalg.LinAlgError:
        return None
    return inverse if (np.diag(inverse) > 0.0).all() else None


def standard_errors(
    free: Sequence[Parameter], normal: Eliminated
) -> tuple[dict[str, float], dict[str, float]]:
    """Standard errors by the scores of the tracks (sandwich), and as if the noise were all.

    Residuals of a track are not independent beyond what the drift says, but tracks are.
    """
    inverse = np.linalg.inv(normal.matrix)
    spread = np.stack(list(normal.scores.values()))
    spread = spread - spread.mean(axis=0)
    sandwich = inverse @ (spread.T @ spread) @ inverse
    sandwich *= len(spread) / max(len(spread) - len(free), 1)
    formal = {p.name: float(np.sqrt(inverse[k, k])) for k, p in enumerate(free)}
    errors = {
        p.name: max(float(np.sqrt(sandwich[k, k])), formal[p.name]) for k, p in enumerate(free)
    }
    return errors, formal
