# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figure of an experiment: our results, the thesis', the floor, and diverged rollouts."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from .panels import Panel, panels_of, Point, printed_numbers
from .tables import LONG, OVERLAPS, SET_NAMES, SHORT, THESIS_STEPS
from ..axes import clean_axes, GRID, INK
from ...scoring.table import LAWS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe-Ito colours, safe for colour-blind readers; the markers differ too
OURS, THESIS, LOST = '#0072b2', '#e69f00', '#d55e00'
NAMES = {key: f'{n} [{u}]' if u else n for key, (n, u) in LAWS.items()} | LONG | OVERLAPS | SHORT
NAMES |= {
    'energy_gain_median': 'median energy gain',
    'position_error_10': 'error after 10 steps [m]',
    'frames_per_second': 'frames per second',
    'final_speed': 'speed at the end [m/s]',
}
_EDGE = 0.985  # position of off-scale markers [axis lengths]
_ENTRY = 3.5  # width of a legend entry [inches]


def write_chart(path: Path, table: Mapping[str, Any]) -> Path | None:
    """Draw the table of an experiment; no display is needed. None: no cell has run.

    There is a panel for each metric and set. Numeric variants are along x, others down the side.
    Bars are standard deviations. Crosses at the edge are diverged rollouts, with their number and
    without a point where the median is infinite; triangles there are off-scale values of the
    thesis.
    """
    panels = panels_of(table)
    if not panels:
        return None
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    sets = list(dict.fromkeys(panel.which for panel in panels))
    columns = max(sum(panel.which == which for panel in panels) for which in sets)
    along = bool(table['axis'])
    count = max(len(panel.points) for panel in panels)
    height = 3.3 if along else 0.27 * count + 1.0
    width = 3.6 if along else 2.7
    whole = width * columns + (0.3 if along else 2.4)
    figure = Figure(
        figsize=(whole, height * len(sets) + 1.0), layout='constrained', facecolor='white'
    )
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(sets), columns, squeeze=False)
    bars = any(point.std for panel in panels for point in panel.points)
    train = table['kind'] == 'train'
    name = 'ours' + ', mean ± std' * bars + (' over seeds' if bars else ', one seed') * train
    known: dict[str, Any] = {}
    for row, which in zip(grid, sets, strict=True):
        own = [panel for panel in panels if panel.which == which]
        for column, axes in enumerate(row):
            if column >= len(own):
                axes.set_visible(False)
                continue
            _draw(axes, own[column], along, table['axis'], name, first=column == 0)
            handles, texts = axes.get_legend_handles_labels()
            known |= dict(zip(texts, handles, strict=True))
    # our values may be medians, and of fewer steps on the test set
    more = f': mean of {THESIS_STEPS} steps' if train else ''
    figure.legend(
        known.values(),
        [text + more * text.startswith('thesis') for text in known],
        loc='outside lower center',
        ncols=min(3, int(whole / _ENTRY)),
        frameon=False,
        fontsize=9,
    )
    title = f'{table["title"]} (thesis: {table["source"]})'
    if train:
        title += f'\n{table["budget"]["words"]}'
    figure.suptitle(title, fontsize=10, color=INK, x=0.01, ha='left', wrap=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110, metadata={'Software': None})
    return path


def _draw(axes: Axes, panel: Panel, along: bool, axis: str, name: str, *, first: bool) -> None:
    low, high = panel.limits
    value_axis = axes.yaxis if along else axes.xaxis
    if panel.logarithmic:
        (axes.set_yscale if along else axes.set_xscale)('log')
        _number(value_axis, low, high)
    (axes.set_ylim if along else axes.set_xlim)(low, high)
    for point in panel.points:
        place = point.place if along else -point.place
        if point.mean is not None and point.finite:
            style = {'color': OURS, 'marker': 'o', 'label': name, 'zorder': 3}
            _mark(axes, along, panel, place, max(point.mean, low), point.std, style)
        if point.lost or point.mean == np.inf:
            _cross(axes, along, place, point)
        if point.thesis is not None:
            _draw_thesis(axes, along, panel, place + (0.15 if along else -0.22), point)
    if panel.floor:
        dashes = (0, (1, 2) if panel.bounded else (4, 3))
        line: dict[str, Any] = {'color': INK, 'linewidth': 1.0, 'linestyle': dashes}
        draw = axes.axhline if along else axes.axvline
        label = 'Bullet against itself' + ', or half a radius if more' * panel.bounded
        draw(max(panel.floor, low), label=label, zorder=1, **line)
    _clean(axes, panel, along, axis, first)


def _mark(
    axes: Axes, along: bool, panel: Panel, place: float, value: float, std: float, style: Any
) -> None:
    """Draw a point with its standard deviation, clipped to the axis."""
    low, high = panel.limits
    bar = [[min(std, value - low)], [min(std, high - value)]] if std else None
    axes.errorbar(
        [place if along else value],
        [value if along else place],
        yerr=bar if along else None,
        xerr=None if along else bar,
        linestyle='none',
        markersize=5,
        capsize=2.5,
        linewidth=1.2,
        **style,
    )


def _cross(axes: Axes, along: bool, place: float, point: Point) -> None:
    where = (place, _EDGE) if along else (_EDGE, place)
    transform = axes.get_xaxis_transform() if along else axes.get_yaxis_transform()
    style: dict[str, Any] = {'color': LOST, 'linestyle': 'none', 'clip_on': False, 'zorder': 4}
    axes.plot(
        *where,
        marker='x',
        transform=transform,
        label='diverged, of all (no point: median infinite)',
        **style,
    )
    axes.annotate(
        f'{point.lost}/{point.rollouts}',
        where,
        (0, 5) if along else (6, 0),
        xycoords=transform,
        textcoords='offset points',
        ha='center' if along else 'left',
        va='bottom' if along else 'center',
        fontsize=7,
        color=LOST,
        annotation_clip=False,
    )


def _draw_thesis(axes: Axes, along: bool, panel: Panel, place: float, point: Point) -> None:
    low, high = panel.limits
    numbers = printed_numbers(point.thesis)
    style: dict[str, Any] = {'color': THESIS, 'zorder': 2}
    if numbers and low <= numbers[0] <= high:
        style |= {'marker': 'D', 'label': 'thesis'}
        _mark(axes, along, panel, place, numbers[0], [*numbers, 0.0][1], style)
        return
    above = not numbers or numbers[0] > high
    edge = _EDGE if above else 0.015
    where = (place, edge) if along else (edge, place)
    transform = axes.get_xaxis_transform() if along else axes.get_yaxis_transform()
    style |= {'linestyle': 'none', 'clip_on': False, 'label': 'thesis, off the scale'}
    marker = ('^' if above else 'v') if along else ('>' if above else '<')
    axes.plot(*where, marker=marker, transform=transform, markersize=5, **style)
    axes.annotate(
        f'{numbers[0]:.0e}' if numbers else str(point.thesis),
        where,
        (0, -5 if above else 5) if along else (-5 if above else 5, 0),
        xycoords=transform,
        textcoords='offset points',
        rotation=90 if along else 0,
        ha='center' if along else ('right' if above else 'left'),
        va=('top' if above else 'bottom') if along else 'center',
        fontsize=7,
        color=THESIS,
    )


def _number(axis: Any, low: float, high: float) -> None:
    """Tick labels as plain numbers or powers of ten, with 3 between powers on short axes."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    few, plain = high / low < 1e3, low > 1e-3 and high < 3e4
    axis.set_major_locator(LogLocator(subs=(1.0, 3.0) if few else (1.0,), numticks=5))
    axis.set_major_formatter(
        FuncFormatter(lambda value, _: f'{value:g}' if plain else _power(value))
    )
    axis.set_minor_formatter(NullFormatter())


def _power(value: float) -> str:
    mantissa, exponent = f'{value:.0e}'.split('e')
    factor = '' if mantissa == '1' else rf'{mantissa} \cdot '
    return f'${factor}10^{{{int(exponent)}}}$'


def _clean(axes: Axes, panel: Panel, along: bool, axis: str, first: bool) -> None:
    places = np.array([point.place for point in panel.points])
    if along:
        axes.set_xticks(places, [f'{place:g}' for place in places])
        axes.set_xlabel(axis, color=INK, fontsize=9)
        axes.set_xlim(places.min() - 0.5, places.max() + 0.5)
    else:
        axes.set_yticks(-places, [point.label for point in panel.points] if first else [])
        axes.set_ylim(-places.max() - 0.6, -places.min() + 0.6)
        axes.locator_params(axis='x', nbins=4) if not panel.logarithmic else None
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    clean_axes(axes, 8)
    length = f', {panel.steps} steps' if panel.steps else ''
    title = f'{SET_NAMES[panel.which]}{length}\n{NAMES.get(panel.metric, panel.metric)}'
    axes.set_title(title, loc='left', fontsize=9, color=INK, pad=16 if along else 6)
