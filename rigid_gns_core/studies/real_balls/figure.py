# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of the recordings: a track and its forecasts, errors by horizon, and coverage."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from .bullet import BulletSimulator
from .judged import BULLET, FIRST, FITTED, HORIZONS, rivals_of
from ..axes import clean_axes, GRID, INK
from ...data.tracks import Track, TrackSet
from ...forecasts.forecaster import scene_of
from ...rollout.simulator import Simulator
from ...scenes.scene import Scene
from ...scenes.state import Array
from ...tracking.state_estimate import estimate_state

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {BULLET: '#8c6bb1', 'vacuum': '#b3541e', 'drag': '#d9a441', FITTED: '#1f5fa8'}
TEXTS = {
    BULLET: 'Bullet, same start, no air',
    'vacuum': 'laws without air',
    'drag': 'with drag',
    FITTED: 'fitted',
}
_WINDOW = 0.2
# heights of an overhead camera do not change by this [m]: the view is from above
_LEVEL = 1e-3
_POINTS = 120
# texts beside the ends of lines are so far apart [largest mean]
_APART = 0.07


def draw_set(
    report: Mapping[str, Any],
    outside: TrackSet,
    scenes: Mapping[str, Scene],
    simulator: Simulator,
    path: Path,
) -> None:
    """Draw the usual track with its forecasts, and the mean error by horizon.

    Args:
        report: Of `judge_set`.
        outside: The tracks that were judged.
        scenes: Fitted scene of each rival but Bullet.
        simulator: The laws.
        path: PNG or SVG file to write.
    """
    figure = _figure(10.0, 3.6)
    axes = figure.subplots(1, 2, width_ratios=(2, 1))
    track = next(one for one in outside.tracks if one.name == report['shown'])
    ids = tuple(outside.labels.index(label) for label in track.spheres)
    _draw_track(
        axes[0], track, {k: scene_of(s, ids) for k, s in scenes.items()}, simulator, report
    )
    _draw_errors(axes[1], report)
    figure.savefig(path, dpi=130)


def draw_coverage(reports: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Draw what the regions of the fitted laws hold, by set and horizon."""
    figure = _figure(6.4, 3.4)
    axes = figure.subplots()
    for region in (50, 90):
        axes.axhspan(region - 5, region + 5, color='0.92', lw=0)
        axes.axhline(region, color='0.7', lw=0.8)
    for number, (name, report) in enumerate(reports.items()):
        found = report['rivals'][FITTED]['every']
        horizons = [float(horizon) for horizon in found]
        for region, style in ((50, 'o'), (90, 's')):
            shares = [100 * own[f'coverage_{region}'] for own in found.values()]
            label = name if region == 50 else None
            axes.plot(horizons, shares, f'{style}-', color=f'C{number}', ms=4, lw=1.2, label=label)
    axes.set(xlabel='predicted ahead [s]', ylabel='of positions in the region [%]', ylim=(0, 102))
    axes.legend(frameon=False, fontsize=8, loc='lower right', ncols=2)
    clean_axes(axes)
    figure.savefig(path, dpi=130)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout='constrained')
    FigureCanvasAgg(figure)
    return figure


def _draw_track(
    axes: Axes,
    track: Track,
    scenes: Mapping[str, Scene],
    simulator: Simulator,
    report: Mapping[str, Any],
) -> None:
    inside = np.flatnonzero(track.times <= _WINDOW + 1e-6)
    start = float(track.times[inside[-1]])
    end = min(float(track.times[-1]), start + HORIZONS[-1])
    seen = track.seen[inside].any(axis=0)
    view, names = _view(track)
    used = track.times <= end
    places = track.positions[:, seen]
    axes.plot(*view(places[used]), '.', color='0.65', ms=4)
    axes.plot(*view(places[inside]), '.', color='0.1', ms=4)
    axes.plot([], [], '.', color='0.1', label=f'tracked, first {_WINDOW:g} s')
    axes.plot([], [], '.', color='0.65', label='tracked afterwards')
    leads = np.linspace(0.004, end - start, _POINTS)
    columns = tuple(np.flatnonzero(seen).tolist())
    for name in rivals_of(report):
        scene = scene_of(scenes[FITTED if name == BULLET else name], columns)
        model = BulletSimulator() if name == BULLET else simulator
        estimate = estimate_state(scene, track.times[inside], places[inside])
        found = model.forecast(scene, estimate, leads, samples=0).positions
        for k, line in enumerate(np.moveaxis(found, 1, 0)):
            label = TEXTS[name] if k == 0 else None
            axes.plot(*view(line[:, None]), color=COLOURS[name], lw=1.6, label=label)
    axes.set(xlabel=names[0], ylabel=names[1])
    axes.set_aspect('equal', adjustable='datalim')
    axes.legend(frameon=False, fontsize=8)
    axes.grid(color=GRID, lw=0.5)
    clean_axes(axes)


def _view(track: Track) -> tuple[Any, tuple[str, str]]:
    """Function from positions to what is drawn, and names of both axes."""
    places = track.positions[np.isfinite(track.positions).all(axis=-1)]
    if np.ptp(places[:, 2]) < _LEVEL:
        return lambda p: (p[..., 0].ravel(), p[..., 1].ravel()), ('x [m]', 'y [m]')
    level = places[:, :2] - places[:, :2].mean(axis=0)
    along = np.linalg.svd(level, full_matrices=False)[2][0]

    def side(points: Array) -> tuple[Array, Array]:
        return (points[..., :2] @ along).ravel(), points[..., 2].ravel()

    return side, ('along the throw [m]', 'height [m]')


def _draw_errors(axes: Axes, report: Mapping[str, Any]) -> None:
    ends = {}
    for name in rivals_of(report):
        found = report['rivals'][name][FIRST]
        horizons = [float(horizon) for horizon in found]
        means = [100 * own['mean_m'] for own in found.values()]
        axes.plot(horizons, means, 'o-', color=COLOURS[name], ms=4, lw=1.6)
        ends[name] = (horizons[-1], means[-1])
    lowest = -np.inf
    for name, (horizon, mean) in sorted(ends.items(), key=lambda item: item[1][1]):
        lowest = max(mean, lowest + _APART * max(end for _, end in ends.values()))
        axes.annotate(
            number_of(mean), (horizon, lowest), xytext=(5, -3), textcoords='offset points',
            color=COLOURS[name], fontsize=9,
        )  # fmt: skip
    axes.set(xlabel='predicted ahead [s]', ylabel='mean error [cm]', ylim=(0, None))
    axes.margins(x=0.15)
    axes.grid(color=GRID, lw=0.5)
    axes.tick_params(colors=INK)
    clean_axes(axes)


def number_of(centimetres: float) -> str:
    """Text of an error beside its point."""
    return f'{centimetres:.0f} cm' if centimetres >= 10 else f'{centimetres:.1f} cm'
