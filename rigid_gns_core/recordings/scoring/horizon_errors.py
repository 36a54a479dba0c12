# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Position errors at fixed times after a start, over many starts and all their spheres."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping

import numpy as np

from .regions import crps, region_probability, REGIONS
from ..recorded_forecasts import RecordedForecast
from ...files.tables import format_rows, number
from ...forecasts.interpolation import interpolate
from ...messages.poses import PoseArrayFrame
from ...scenes.state import Array
from ...tracking.usable_frames import covered

HORIZONS = (0.1, 0.3, 1.0, 3.0)
"""Times after a start for which errors are reported [s]."""

# largest distance of a prediction from its horizon, as a part of the horizon
TOLERANCE = 0.1


class HorizonErrors:
    """Distances of predicted from tracked centres, collected by horizon."""

    def __init__(self) -> None:
        self._distances: dict[float, list[Array]] = {horizon: [] for horizon in HORIZONS}
        self._times: dict[float, list[float]] = {horizon: [] for horizon in HORIZONS}
        self._inside: dict[float, list[float]] = {horizon: [] for horizon in HORIZONS}
        self._scores: dict[float, list[float]] = {horizon: [] for horizon in HORIZONS}

    def add(
        self,
        horizon: float,
        time: float,
        predicted: Array,
        tracked: Array,
        covariances: Array | None = None,
        noise: float = 0.0,
    ) -> None:
        """Add predicted and tracked centres [m], shape (n, 3), at `time` [s] after a start.

        With `covariances` of the predicted ones [m^2], shape (n, 3, 3), and the tracker's noise
        [m], it also counts what their regions hold.
        """
        known = np.zeros((0, 3, 3)) if covariances is None else covariances
        for off, covariance in zip((predicted - tracked)[: len(known)], known, strict=True):
            inside = region_probability(off, covariance, noise)
            score = crps(off, covariance, noise)
            if inside is not None and score is not None:
                self._inside[horizon].append(inside)
                self._scores[horizon].append(score)
        distances = np.linalg.norm(predicted - tracked, axis=1)
        self._distances[horizon].append(np.where(np.isfinite(distances), distances, np.inf))
        self._times[horizon].append(time)

    def report(self) -> dict[str, dict[str, float]]:
        """Mean time, number of starts and errors by horizon [s].

        Returns:
            For each horizon: `time_s`, `starts`, `mean_m`, `median_m`, `p90_m`, `max_m`; where
            covariances were published, also `coverage_50`, `coverage_90` and `crps_m`.
        """
        found = {}
        for horizon, parts in self._distances.items():
            if parts:
                values = np.concatenate(parts)
                found[f'{horizon:g}'] = {
                    'time_s': float(np.mean(self._times[horizon])),
                    'starts': len(parts),
                    'mean_m': float(values.mean()),
                    'median_m': float(np.median(values)),
                    'p90_m': float(np.quantile(values, 0.9, method='higher')),
                    'max_m': float(values.max()),
                }
                if self._inside[horizon]:
                    inside = np.array(self._inside[horizon])
                    for region in REGIONS:
                        share = float((inside <= region).mean())
                        found[f'{horizon:g}'][f'coverage_{100 * region:.0f}'] = share
                    found[f'{horizon:g}']['crps_m'] = float(np.mean(self._scores[horizon]))
        return found


def add_forecast(
    errors: HorizonErrors,
    forecast: RecordedForecast,
    tracked: list[PoseArrayFrame],
    noise: float = 0.0,
) -> None:
    """Add the errors of the predictions of one forecast.

    For each horizon the nearest prediction is taken, if it is within 10 % of it, and compared at
    its own stamp with the tracked poses, which are interpolated but not across gaps.

    Args:
        errors: The errors are added to it.
        forecast: Predictions.
        tracked: Frames with the same spheres, of rising stamps.
        noise: Of the tracker [m], for regions.
    """
    since = (forecast.stamps - forecast.start_ns) * 1e-9
    for horizon in HORIZONS:
        near = int(np.abs(since - horizon).argmin())
        if abs(since[near] - horizon) > TOLERANCE * horizon:
            continue
        wanted = forecast.stamps[near : near + 1]
        last = bisect_left(tracked, int(wanted[0]), key=_stamp)
        # a few frames on either side give the usual interval
        around = tracked[max(last - 4, 0) : last + 4]
        stamps = np.array([frame.stamp_ns for frame in around], dtype=np.int64)
        if not len(stamps) or not covered(wanted, stamps)[0]:
            continue
        poses = np.stack([frame.poses for frame in around])
        reference = interpolate(stamps, poses, wanted)[0]
        predicted = forecast.frames[near].poses
        spread = None if forecast.covariances is None else forecast.covariances[near]
        errors.add(horizon, float(since[near]), predicted[:, :3], reference[:, :3], spread, noise)


def format_horizons(report: Mapping[str, Mapping[str, float]], title: str) -> str:
    """Table of `HorizonErrors.report`; empty for an empty report."""
    if not report:
        return ''
    rows = []
    spread = any('crps_m' in values for values in report.values())
    for horizon, values in report.items():
        name = f'after {horizon} s'
        if abs(values['time_s'] / float(horizon) - 1) > 1e-3:
            name += f' (at {number(values["time_s"])} s)'
        errors = (number(values[key]) for key in ('mean_m', 'median_m', 'p90_m'))
        regions = []
        if spread:
            shares = [values.get(key) for key in ('coverage_50', 'coverage_90')]
            regions = ['' if one is None else f'{100 * one:.0f} %' for one in shares]
            regions.append(number(values.get('crps_m')))
        rows.append([name, str(values['starts']), *errors, *regions])
    head = [title, 'starts', 'mean', 'median', '90 %']
    return format_rows([*head, *(['in 50 %', 'in 90 %', 'CRPS'] if spread else [])], rows) + '\n'


def _stamp(frame: PoseArrayFrame) -> int:
    return frame.stamp_ns
