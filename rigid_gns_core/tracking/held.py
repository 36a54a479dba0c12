# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames in which a ball is in a hand, or on what the scene has not: it neither flies nor rolls.

A parabola through the frames around shows its acceleration. Away from surfaces that is gravity,
but for air. Where it is something else for longer than a blow takes, something holds the ball.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .ball_model import BallModel
from ..scenes.state import Array

# half the time of a parabola [s], and its least number of frames
_HALF, _FEWEST = 0.05, 6
# an acceleration is not that of flight beyond this [g], what air can do, and so many deviations
_OFF, _DEVIATIONS = 0.5, 3.0
# drag and lift together reach this coefficient, in air of this density [kg/m^3]
_COEFFICIENT, _DENSITY = 1.0, 1.2
# a ball nearer to a surface than this may touch it [radii]
_NEAR = 0.5
# a blow shows for the time of a parabola, a hand for this many times as long
_LASTS = 1.5


def held(
    model: BallModel, mass: float, times: Array, positions: Array, noise: float
) -> NDArray[np.bool_]:
    """Whether a ball is held, shape (m,).

    Args:
        model: Surfaces, radius and gravity.
        mass: Mass of the ball [kg].
        times: Rising times [s], shape (m,).
        positions: Centres [m], shape (m, 3).
        noise: Standard deviation of a coordinate [m].
    """
    m = len(times)
    flagged = np.zeros(m, dtype=bool)
    pull = float(np.linalg.norm(model.gravity))
    if m < _FEWEST or pull == 0.0:
        return flagged
    near = _near_surfaces(model, positions)
    light = 0.5 * _DENSITY * _COEFFICIENT * np.pi * model.radius**2 / mass
    step = max(1, int(0.25 * _HALF / max(float(np.median(np.diff(times))), 1e-6)))
    for i in range(0, m, step):
        begin, end = np.searchsorted(times, (times[i] - _HALF, times[i] + _HALF + 1e-9))
        begin = max(min(begin, m - _FEWEST), 0)  # at the ends it is beside its frame
        end = max(end, begin + _FEWEST)
        if times[end - 1] - times[begin] > 4.0 * _HALF or near[begin:end].any():
            continue
        t = times[begin:end] - times[i]
        basis = np.stack([np.ones_like(t), t, 0.5 * t**2], axis=1)
        inverse = np.linalg.pinv(basis.T @ basis)
        _, velocity, acceleration = inverse @ basis.T @ positions[begin:end]
        off = float(np.linalg.norm(acceleration - model.gravity))
        bound = _OFF * pull + light * float(velocity @ velocity)
        if off > bound + _DEVIATIONS * noise * np.sqrt(inverse[2, 2]):
            flagged[max(i - step // 2, 0) : i + (step + 1) // 2] = True
    return _lasting(flagged, times)


def _lasting(flagged: NDArray[np.bool_], times: Array) -> NDArray[np.bool_]:
    """Stretches of flagged frames that last, without what their parabolas reach beyond them."""
    found = np.zeros_like(flagged)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flagged.astype(int), [0]]))).tolist()
    runs: list[tuple[int, int]] = []
    for begin, end in pairwise(edges):
        if not flagged[begin]:
            continue
        # noise hides a hand for a frame or two; a flight between two is longer than a parabola
        if runs and times[begin] - times[runs[-1][1] - 1] < 2.0 * _HALF:
            begin = runs.pop()[0]
        runs.append((begin, end))
    for begin, end in runs:
        first, last = times[begin], times[end - 1]
        if last - first > _LASTS * 2.0 * _HALF:
            margin = 0.5 * _HALF
            found |= (times >= first + margin * (begin > 0)) & (
                times <= last - margin * (end < len(times))
            )
    return found


def _near_surfaces(model: BallModel, positions: Array) -> NDArray[np.bool_]:
    near = np.zeros(len(positions), dtype=bool)
    heights = model.heights(positions)[model.surfaces :]
    for plane in model.planes[: model.surfaces]:
        local = (positions - plane[:3]) @ plane[3:12].reshape(3, 3).T
        inside = (np.abs(local[:, :2]) <= plane[12:14] + model.radius).all(axis=1)
        near |= inside & (np.abs(local[:, 2]) < (1.0 + _NEAR) * model.radius)
    return near | (heights < _NEAR * model.radius).any(axis=0)
