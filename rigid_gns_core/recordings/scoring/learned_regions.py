# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regions of a learned scene, by forecasts of tracks that were left out of its fits.

The forecasts are those that `track_errors` judges: by `estimate_state` and the simulator, through
contacts and other balls, wherever a ball is seen. So what a fit of clean pieces does not see is in
the regions. Covariances are scaled to where normal regions come nearest, and factors on the radii
(`scenes.regions`) are quantiles of the distances, horizon by horizon, pulled towards those of all
horizons, and these towards a normal distribution, the more the fewer tracks there are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .regions import REGIONS
from .track_errors import Outcome, outcomes_of_track, Windows
from ...identification.learn import Learned
from ...identification.left_out import HORIZONS
from ...rollout.simulator import Simulator
from ...scenes.regions import normal_radius, Regions
from ...scenes.state import Array
from ...scenes.tracker import Tracker

# time of a window, least time from one start to the next [s], and about so many starts
_WINDOW, _APART, _MOST = 0.1, 0.1, 400
_SAMPLES = 32
# tracks that count as much as what is known beforehand: a normal distribution, other horizons
_FEW, _FEW_AT = 4.0, 8.0
# least power of a normal region's radius by which those of 90 % are larger than those of 50 %
_LEAST_POWER = 0.25
_RADII = normal_radius(REGIONS)


def with_regions(
    learned: Learned,
    labels: Sequence[str],
    simulator: Simulator,
    done: Callable[[], object] = lambda: None,
) -> Learned:
    """The same with the regions that left-out tracks show.

    Args:
        learned: What tracks tell.
        labels: Labels of the scene's spheres.
        simulator: Model that predicts.
        done: Called after each track.

    Returns:
        With `coverage` of tracks that neither the fit nor the regions know. Where no left-out
        forecast is as long as the first horizon, what was given.
    """
    tracker = learned.scene.tracker
    parts = _outcomes(learned, 1.0, labels, simulator, done)
    if len(parts) < 2 or tracker is None:
        return learned
    scale = _scale([one for part in parts for one in part])
    # once more: paths that meet something or not part by more than their starts do
    parts = _outcomes(learned, scale, labels, simulator, done)
    probabilities: dict[float, list[float]] = {}
    for k, part in enumerate(parts):
        others = fit_regions([one for j, own in enumerate(parts) if j != k for one in own])
        for one in part:
            own = others.probability(one.distance or 0.0, one.lead)
            probabilities.setdefault(one.horizon, []).append(own)
    held = {
        f'{horizon:g}': [len(own), *(float(np.mean(np.array(own) <= p)) for p in REGIONS)]
        for horizon, own in sorted(probabilities.items())
    }
    regions = fit_regions([one for part in parts for one in part])
    tracker = replace(_scaled(tracker, scale), regions=regions)
    return replace(learned, scene=replace(learned.scene, tracker=tracker), coverage=held)


def fit_regions(outcomes: Sequence[Outcome]) -> Regions:
    """Factors on the radii of normal regions, by outcomes with a distance."""
    distances = np.array([one.distance for one in outcomes])
    horizons = np.array([one.horizon for one in outcomes])
    tracks = np.array([one.track for one in outcomes])
    _, index, counts = np.unique(horizons, return_inverse=True, return_counts=True)
    count = len(set(tracks.tolist()))
    logs = np.log(_quantiles(distances, 1.0 / counts[index]) / _RADII)
    common = logs * count / (count + _FEW)
    rows = []
    for horizon in np.unique(horizons):
        own = horizons == horizon
        count = len(set(tracks[own].tolist()))
        logs = np.log(_quantiles(distances[own], np.ones(int(own.sum()))) / _RADII)
        half, most = np.exp(common + (logs - common) * count / (count + _FEW_AT)).tolist()
        most = max(most, half * float(_RADII[1] / _RADII[0]) ** (_LEAST_POWER - 1.0))
        rows.append((float(horizon), _short(half), _short(most)))
    return Regions(tuple(rows))


def _outcomes(
    learned: Learned,
    scale: float,
    labels: Sequence[str],
    simulator: Simulator,
    done: Callable[[], object],
) -> list[list[Outcome]]:
    """Outcomes that nothing unknown held, of each part of the tracks that has some."""
    total = sum(float(track.times[-1]) for part in learned.left_out for track in part.tracks)
    windows = Windows(_WINDOW, HORIZONS, every=max(_APART, total / _MOST), samples=_SAMPLES)

    result = []
    for part in learned.left_out:
        tracker = part.scene.tracker
        assert tracker is not None
        scene, own = replace(part.scene, tracker=_scaled(tracker, scale)), []
        for track in part.tracks:
            own += outcomes_of_track(simulator, track, scene, labels, windows, tracker.noise)
            done()
        result.append([one for one in own if not one.held and one.distance is not None])
    return [own for own in result if own]


def _quantiles(distances: Array, weights: Array) -> Array:
    """Distances that hold the parts of `REGIONS`, weighted."""
    order = np.argsort(distances)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    found: Array = np.interp(REGIONS, below / weights.sum(), distances[order])
    return np.maximum(found, 1e-9)


def _scale(outcomes: Sequence[Outcome]) -> float:
    """Factor on deviations with which normal regions come nearest: the mean of both parts'."""
    rows = np.array(fit_regions(outcomes).rows)
    return float(np.exp(np.log(rows[:, 1:]).mean()))


def _scaled(tracker: Tracker, scale: float) -> Tracker:
    return replace(
        tracker,
        spread=_short(tracker.spread * scale**2),
        forecast_drift=_short(tracker.forecast_drift * scale**2),
        forecast_acceleration=_short(tracker.forecast_acceleration * scale),
        forecast_impact=_short(tracker.forecast_impact * scale),
    )


def _short(value: float) -> float:
    return float(f'{value:.4g}')
