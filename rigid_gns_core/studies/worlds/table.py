# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Table and figure of a world: errors by time ahead, and frames a second, over its seeds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..axes import clean_axes, GRID, INK
from ...files.tables import format_rows

# Okabe-Ito colours, safe for colour-blind readers; the markers differ too
_STYLES = {
    'laws given': ('#e69f00', '^'),
    'laws fitted': ('#0072b2', 's'),
    'laws fitted + correction': ('#cc79a7', 'D'),
    'laws fitted + residual': ('#009e73', 'o'),
    'GNS': ('#d55e00', 'v'),
    'world moved by 1 mm': ('#8c8c8c', 'x'),
}
_FITTED = 'laws fitted'
# ratios beyond are not drawn; the other panel has them
_LARGEST = 2.4


def format_world(world: str, results: Sequence[dict[str, Any]]) -> str:
    """Table of a world: mean and standard deviation over its seeds.

    Args:
        world: Name of the world.
        results: Of `run_world`, one a seed, or a protocol's of `run_recorded`.
    """
    horizons = _horizons(results)
    timed = 'frames_per_second' in results[0]
    rows = []
    for name in results[0]['errors']:
        cells = []
        for horizon in horizons:
            values = _centimetres(results, name, horizon)
            told = np.isfinite(values).all()
            cells.append(f'{values.mean():.2f} ± {values.std():.2f}' if told else 'diverged')
        if timed:
            speed = np.mean([one['frames_per_second'][name] for one in results])
            cells.append(f'{speed:.0f}')
        rows.append([name, *cells])
    head = ['mean position error [cm]', *(f'{horizon} s' for horizon in horizons)]
    head += ['frames/s'] if timed else []
    seeds = ', '.join(str(one['seed']) for one in results)
    return f'world {world}, seeds {seeds}\n{format_rows(head, rows)}'


def draw_world(world: str, results: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw errors, and those over the errors of the fitted laws, by time ahead.

    Thick lines are means over the seeds, thin ones the seeds.

    Args:
        world: Name of the world.
        results: Of `run_world`, one a seed.
        path: PNG or SVG file to write.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout='constrained', facecolor='white')
    FigureCanvasAgg(figure)
    errors, ratios = figure.subplots(1, 2)
    horizons = _horizons(results)
    times = [float(horizon) for horizon in horizons]
    fitted = np.array([_centimetres(results, _FITTED, horizon) for horizon in horizons])
    for name in results[0]['errors']:
        colour, marker = _STYLES[name]
        values = np.array([_centimetres(results, name, horizon) for horizon in horizons])
        for axes, shown in ((errors, values), (ratios, values / fitted)):
            axes.plot(times, shown, color=colour, lw=0.6, alpha=0.6)
            axes.plot(
                times, shown.mean(axis=1), color=colour, marker=marker, ms=5, lw=1.6, label=name
            )
    errors.set(ylabel='mean position error [cm]', title=f'world {world}', yscale='log')
    errors.yaxis.set_major_formatter('{x:g}')
    ratios.set(ylabel='over the error of the fitted laws', ylim=(0.0, _LARGEST))
    for axes in (errors, ratios):
        axes.set(xlabel='predicted ahead [s]', xscale='log')
        axes.set_xticks(times, horizons)
        axes.minorticks_off()
        axes.grid(color=GRID, lw=0.5)
        axes.tick_params(colors=INK)
        clean_axes(axes)
    errors.legend(frameon=False, fontsize=8)
    figure.savefig(path, dpi=130)


def _horizons(results: Sequence[dict[str, Any]]) -> list[str]:
    """Times ahead that all seeds have."""
    first, *others = (one['errors'][_FITTED] for one in results)
    return [time for time in first if all(time in other for other in others)]


def _centimetres(
    results: Sequence[dict[str, Any]], name: str, horizon: str
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Errors of the seeds [cm]; NaN: a rollout diverged."""
    values = [one['errors'][name][horizon] for one in results]
    return np.array([np.nan if value is None else 100.0 * value for value in values])
