# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forecasts of tracks from their windows, and how far off they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .parameters import Laws
from .stretches import FEWEST, Stretch
from ..scenes.state import Array
from ..tracking.ball_contact import FREE
from ..tracking.ball_estimate import (
    BallEstimate,
    estimate_ball,
    forecast_ball,
    sampled_covariances,
)
from ..tracking.ball_model import BallModel
from ..tracking.start_correction import StartCorrection
from ..tracking.start_prior import StartPrior

HORIZONS = (0.2, 0.4, 0.6, 1.0)  # [s]
# a frame is compared with a horizon no farther off than this [s], [median intervals]
_APART, _FRAMES = 0.01, 0.6
# windows of a piece: the time before the first ends [s], from one to the next [s], and most of
# them; and where many are needed, short ones, too
USUAL = (0.2, 0.2, 10)
CLOSE = (0.1, 0.1, 30)


@dataclass(frozen=True)
class Forecast:
    """One forecast and what came.

    Args:
        track: Number of the track.
        first: Whether it starts from the first window of its stretch.
        horizon: Time ahead [s], as asked for.
        lead: To the frame compared [s].
        off: Forecast less position [m], shape (3,).
        contacts: Number of impacts that the forecast has on the way.
        covariance: Of the forecast by that of the estimate [m^2], shape (3, 3).
        kicks: Sum over impacts of (approach speed times time since)^2 [m^2].
    """

    track: int
    first: bool
    horizon: float
    lead: float
    off: Array
    contacts: int
    covariance: Array
    kicks: float = 0.0


def windows(
    one: Stretch, memory: float, begin: float, every: float, most: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], bool]]:
    """Frames of the windows of a piece, the frames to compare with by horizon, and if it is first.

    A window has all frames of the last `memory` seconds. The first ends `begin` seconds after the
    piece begins, and the others follow `every` so many; of a long piece so far apart that it has
    `most` of them.
    """
    times = one.times
    every = max(every, (times[-1] - times[0]) / most)
    apart = max(_APART, _FRAMES * float(np.median(np.diff(times))))
    end, first = times[0] + begin, True
    while end < times[-1]:
        inside = np.flatnonzero((times <= end + 1e-6) & (times >= end - memory - 1e-6))
        last = times[inside[-1]]
        nearest = np.array([np.abs(times - last - h).argmin() for h in HORIZONS])
        nearest[np.abs(times[nearest] - last - HORIZONS) > apart] = -1
        if len(inside) >= FEWEST and (nearest >= 0).any():
            yield inside, nearest, first
        end, first = end + every, False


@dataclass(frozen=True)
class Part:
    """A fit to some tracks, and pieces of others.

    Args:
        values: Of the parameters.
        prior: Of the spin.
        outside: The pieces.
    """

    values: dict[str, float]
    prior: StartPrior | None
    outside: Sequence[Stretch]


@dataclass(frozen=True)
class Start:
    """A window of a piece, and the estimate at its end.

    Args:
        piece: The piece.
        model: Laws of its ball.
        estimate: The estimate.
        time: That of the last frame of the window [s].
        frames: Those to compare with, by horizon, shape (h,).
        horizons: Times ahead that have one [s], shape (h,).
        first: Whether it is the first window of the piece.
    """

    piece: Stretch
    model: BallModel
    estimate: BallEstimate
    time: float
    frames: NDArray[np.int64]
    horizons: Array
    first: bool


def starts(
    laws: Laws, part: Part, noise: Array, memory: float, spacing: tuple[float, float, int]
) -> Iterator[Start]:
    """Estimates from all windows of left-out pieces, each of `memory` seconds [s] at most."""
    models = laws.models_at(part.values)
    for one in part.outside:
        model = models[min(one.sphere, len(models) - 1)]
        for inside, nearest, first in windows(one, memory, *spacing):
            seen = one.times[inside], one.positions[inside]
            estimate = estimate_ball(model, noise, part.prior, *seen)
            reached = nearest >= 0
            time, horizons = float(one.times[inside[-1]]), np.array(HORIZONS)[reached]
            yield Start(one, model, estimate, time, nearest[reached], horizons, first)


def forecasts(
    laws: Laws,
    part: Part,
    noise: Array,
    memory: float,
    *,
    samples: int = 0,
    correction: Callable[[int], StartCorrection] | None = None,
    spacing: tuple[float, float, int] = USUAL,
) -> list[Forecast]:
    """Forecasts from all windows of left-out pieces, see `starts`.

    Their covariances are by slopes, or by as many paths from drawn states as `samples` says. Their
    starts are corrected as `correction` says for the number of a track.
    """
    corrected_by = None if correction is None else cache(correction)
    result: list[Forecast] = []
    for start in starts(laws, part, noise, memory, spacing):
        one, model, estimate = start.piece, start.model, start.estimate
        if corrected_by is not None and estimate.on == FREE:
            state, spread = estimate.state[None], estimate.covariance[None]
            own = corrected_by(one.track)
            moved = own.corrected(state, spread, np.array([model.radius]))
            estimate = replace(estimate, state=moved[0])
        stamps = one.times[start.frames]
        ahead = forecast_ball(model, estimate, start.time, stamps)
        spreads = ahead.covariances[:, :3, :3]
        if samples:
            spreads = sampled_covariances(
                model, estimate, start.time, stamps, samples, len(result)
            )
        off = ahead.states[:, :3] - one.positions[start.frames]
        for k, horizon in enumerate(start.horizons):
            past = ahead.impacts[ahead.impacts[:, 0] < stamps[k]]
            result.append(
                Forecast(
                    track=one.track,
                    first=start.first,
                    horizon=float(horizon),
                    lead=float(stamps[k]) - start.time,
                    off=off[k],
                    contacts=len(past),
                    covariance=spreads[k],
                    kicks=float(((past[:, 2] * (stamps[k] - past[:, 0])) ** 2).sum()),
                )
            )
    return result


def scores(found: Sequence[Forecast], noise: float) -> dict[int, float]:
    """Mean logarithm of the error of each track: no forecast that fails alone decides."""
    logs: dict[int, list[float]] = {}
    for one in found:
        error = float(np.sqrt(one.off @ one.off + noise**2))
        logs.setdefault(one.track, []).append(np.log(error))
    return {track: float(np.mean(own)) for track, own in logs.items()}


def table_row(found: Sequence[Forecast], first: bool) -> dict[str, list[float]]:
    """Number, mean and median error [m] by horizon, of first windows or of all."""
    row = {}
    for horizon in HORIZONS:
        errors = [
            float(np.linalg.norm(one.off))
            for one in found
            if one.horizon == horizon and (one.first or not first)
        ]
        if errors:
            row[f'{horizon:g}'] = [len(errors), float(np.mean(errors)), float(np.median(errors))]
    return row
