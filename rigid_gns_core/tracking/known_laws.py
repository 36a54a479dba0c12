# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of balls by the laws of the scene, air and spins: each from its own last frames."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .ball_contact import FREE
from .ball_estimate import BallEstimate, estimate_ball, FEWEST, forecast_ball
from .ball_model import BallModel
from .kinks import kinks
from .start_prior import StartPrior
from ..scenes.scene import Scene
from ..scenes.state import Array
from ..scenes.tracker import Tracker

# of a scene without a learned tracker, whose laws are taken as they stand: drift [m^2/s^3] and
# kicks for what is not linear; with 0 regions of 90 % held 85 to 90 %
_DRIFT, _IMPACT = 3e-5, 1e-3
# two balls nearer than this many sums of radii may have touched
_NEAR = 1.04


def states_by_laws(
    scene: Scene, times: Array, positions: Array, seen: NDArray[np.bool_], noise: float | None
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """State of each ball at the last of some frames.

    Frames of the tracker's memory count, after the last that may hold what the laws do not know:
    another ball near by, or a jump that no surface explains.

    Args:
        scene: Surfaces, balls, air, tracker.
        times: Rising times of the frames [s], shape (m,).
        positions: Centres [m], shape (m, n, 3).
        seen: Whether a ball was seen, shape (m, n).
        noise: Standard deviation of a coordinate where the scene has no tracker [m].

    Returns:
        States, shape (n, 9), their covariances, shape (n, 9, 9), and which were found: of a ball
        with fewer than four frames there is no estimate here.
    """
    count = positions.shape[1]
    models, prior, tracker = _laws_of(scene, count)
    if scene.tracker is None and noise is not None:
        tracker = Tracker(noise=max(noise, 1e-6), drift=_DRIFT, impact=_IMPACT)
    states, covariances = np.zeros((count, 9)), np.zeros((count, 9, 9))
    found = np.zeros(count, dtype=bool)
    drift = np.array([tracker.noise, tracker.drift, tracker.impact])
    recent = times >= times[-1] - tracker.memory - 1e-9
    radii = np.array([model.radius for model in models])
    for ball, model in enumerate(models):
        own = np.flatnonzero(recent & seen[:, ball])
        if count > 1:
            own = own[own >= _last_near(positions, seen, radii, ball)]
        if len(own) >= FEWEST:
            hits = kinks(model, times[own], positions[own, ball], tracker.noise)
            own = own[int(hits[-1]) :] if len(hits) else own
        if len(own) < FEWEST:
            continue
        estimate = estimate_ball(model, drift, prior, times[own], positions[own, ball])
        if times[own[-1]] < times[-1]:
            estimate = _coasted(model, estimate, tracker, float(times[own[-1]]), float(times[-1]))
        states[ball], covariances[ball] = estimate.state, tracker.spread * estimate.covariance
        found[ball] = True
    return states, covariances, found


@lru_cache(maxsize=8)
def _laws_of(scene: Scene, count: int) -> tuple[tuple[BallModel, ...], StartPrior, Tracker]:
    models = tuple(BallModel.of(scene, ball, count) for ball in range(count))
    tracker = scene.tracker or Tracker(noise=1e-3, drift=_DRIFT, impact=_IMPACT)
    if tracker.spins is None:
        prior = StartPrior.of_any_spin(float(np.mean([model.radius for model in models])))
    else:
        prior = StartPrior.of(tracker.spins)
    return models, prior, tracker


def _last_near(positions: Array, seen: NDArray[np.bool_], radii: Array, ball: int) -> int:
    """First frame after the last in which another ball was near, where each was seen last."""
    places = np.where(seen[..., None], positions, np.nan)
    for frame in range(1, len(places)):  # a ball that is not seen is where it was
        places[frame] = np.where(seen[frame][:, None], places[frame], places[frame - 1])
    apart = np.linalg.norm(places - places[:, ball : ball + 1], axis=2)
    near = apart < _NEAR * (radii + radii[ball])
    near[:, ball] = False
    frames = np.flatnonzero(near.any(axis=1))
    return int(frames[-1]) + 1 if len(frames) else 0


def _coasted(
    model: BallModel, estimate: BallEstimate, tracker: Tracker, begin: float, end: float
) -> BallEstimate:
    """Estimate at a later time, with the drift that comes to it."""
    ahead = forecast_ball(model, estimate, begin, np.array([end]))
    h, q = end - begin, tracker.drift
    covariance = ahead.covariances[0].copy()
    for axis in range(3):
        covariance[axis, axis] += q * h**3 / 3.0
        covariance[axis, axis + 3] += q * h**2 / 2.0
        covariance[axis + 3, axis] += q * h**2 / 2.0
        covariance[axis + 3, axis + 3] += q * h
    return BallEstimate(
        ahead.states[0], covariance, FREE, estimate.loss, estimate.begin, len(ahead.impacts)
    )
