# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A chart for each scene: speed against error, with a line for each family of peers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from .scenes import FRAME
from ..axes import clean_axes, GRID, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST = 1e-6
"""Errors below this [m] are drawn here."""

# Okabe-Ito colours, safe for colour-blind readers; the markers differ too
STYLES = {
    'laws': ('#0072b2', '^'),
    'Bullet': ('#e69f00', 'o'),
    'MuJoCo': ('#009e73', 's'),
    'Rapier': ('#d55e00', 'v'),
    'Jolt': ('#6a3d9a', '<'),
    'LAMMPS': ('#56b4e9', 'P'),
    'GNS': ('#cc79a7', 'D'),
}
LEGEND = {
    'Bullet': 'Bullet, by substeps',
    'MuJoCo': 'MuJoCo, by substeps',
    'Rapier': 'Rapier, by substeps',
    'Jolt': 'Jolt, by substeps',
    'LAMMPS': 'LAMMPS granular',
    'GNS': "thesis' network",
    'laws': 'laws, by substeps',
}


def write_charts(folder: str | Path, scene: Mapping[str, Any], reference: str) -> list[Path]:
    """Draw a scene of the benchmark's report into `benchmark_SCENE.png` and `.svg`.

    Left is the error after the first horizon, right after the last. Peers on the dashed line, the
    reference against itself, are as far off as chaos alone makes them. No display is needed.

    Args:
        folder: Folder to write to; created if absent.
        scene: Scene of the report, with `peers`, their timing and errors.
        reference: Name of the reference.

    Returns:
        The files; none where no peer has an error.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = _horizons(scene)
    if not names:
        return []
    figure = Figure(figsize=(5.6 * len(names) + 0.6, 5.2), layout='constrained', facecolor='white')
    FigureCanvasAgg(figure)
    panels: list[Axes] = list(np.atleast_1d(figure.subplots(1, len(names))))
    for axes, name in zip(panels, names, strict=True):
        _draw(axes, scene, name)
    # a peer may be unstable in one panel only; each label is listed once
    known = dict(pair for axes in panels for pair in zip(*_legend(axes), strict=True))
    texts = sorted(known, key='unstable'.__eq__)
    handles = [known[text] for text in texts]
    figure.legend(
        handles,
        texts,
        loc='outside lower center',
        ncols=3 if len(names) > 1 else 2,
        frameon=False,
        fontsize=10,
    )
    figure.suptitle(
        f'{scene["name"]}: {scene["text"]}\nerror against {reference}; one thread each',
        fontsize=12,
        color=INK,
        x=0.01,
        ha='left',
    )
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f'benchmark_{scene["name"]}.{suffix}' for suffix in ('png', 'svg')]
    # the same numbers give the same file
    with rc_context({'svg.hashsalt': 'rigid_gns', 'svg.fonttype': 'none'}):
        for path in paths:
            figure.savefig(path, dpi=130, metadata=_no_date(path))
    return paths


def _no_date(path: Path) -> dict[str, Any]:
    return {'Date': None} if path.suffix == '.svg' else {'Software': None}


def _horizons(scene: Mapping[str, Any]) -> list[str]:
    """Names of the first and the last of the position errors."""
    measured = [p['errors'] for p in scene['peers'] if p['errors'] and p['timing']]
    names = [name for name in (measured[0] if measured else ()) if name.startswith('position')]
    return list(dict.fromkeys([names[0], names[-1]])) if names else []


def _draw(axes: Axes, scene: Mapping[str, Any], name: str) -> None:
    axes.set_xscale('log')
    axes.set_yscale('log')
    values = [
        max(LEAST, peer['errors'][name])
        for peer in scene['peers']
        if peer['errors'] and np.isfinite(peer['errors'][name])
    ]
    floor = None if scene['floor'] is None else scene['floor'][name]
    if floor is not None:
        values.append(max(LEAST, floor))
    low, top = _limits(values)
    for family, (colour, marker) in STYLES.items():
        own = [p for p in scene['peers'] if p['family'] == family and p['timing'] and p['errors']]
        if own:
            _draw_family(axes, own, name, family, colour, marker, top)
    if floor is not None:
        style: dict[str, Any] = {'color': INK, 'linewidth': 1.0, 'linestyle': (0, (4, 3))}
        axes.axhline(max(LEAST, floor), label='reference against itself', zorder=1, **style)
    axes.set_ylim(low, top)
    axes.margins(x=0.12)
    _number(axes)
    frame = int(name.rsplit('_', 1)[1])
    axes.set_title(
        f'after {frame} frames, {frame * FRAME:g} s', loc='left', fontsize=11, color=INK
    )
    axes.set_xlabel('frames of 0.1 s per second of wall clock (faster: right)', color=INK)
    axes.set_ylabel('mean position error [m] (better: down)', color=INK)
    axes.grid(color=GRID, linewidth=0.8)
    axes.set_axisbelow(True)
    clean_axes(axes)


def _draw_family(
    axes: Axes,
    peers: Sequence[Mapping[str, Any]],
    name: str,
    family: str,
    colour: str,
    marker: str,
    top: float,
) -> None:
    from matplotlib.patheffects import withStroke

    speed = np.array([peer['timing']['frames_per_second'] for peer in peers])
    spread = [peer['timing']['seconds_per_frame'] for peer in peers]
    around = [
        [v - 1.0 / s['p90'] for v, s in zip(speed, spread, strict=True)],
        [1.0 / s['p10'] - v for v, s in zip(speed, spread, strict=True)],
    ]
    # errors that are not finite are drawn on the upper edge
    error = np.array([min(max(LEAST, peer['errors'][name]), 0.9 * top) for peer in peers])
    axes.plot(
        speed,
        error,
        color=colour,
        linewidth=1.6,
        marker=marker,
        markersize=6.5,
        markeredgecolor='white',
        markeredgewidth=0.7,
        label=LEGEND[family],
        zorder=4 if family == 'laws' else 3,
    )
    axes.errorbar(speed, error, xerr=np.maximum(around, 0.0), fmt='none', ecolor=colour, zorder=2)
    for peer, x, y in zip(peers, speed, error, strict=True):
        if peer['status'] == 'unstable':
            cross: dict[str, Any] = {'marker': 'x', 'markersize': 10, 'linestyle': 'none'}
            axes.plot(x, y, color=INK, zorder=5, label='unstable', **cross)
        if peer['label']:
            axes.annotate(
                peer['label'],
                (x, y),
                (0, 9 if family == 'MuJoCo' else -9),  # whose line is near Bullet's
                textcoords='offset points',
                ha='center',
                va='center',
                fontsize=8.5,
                color=colour,
                path_effects=[withStroke(linewidth=2.0, foreground='white')],
                zorder=6,
            )


def _limits(values: Sequence[float]) -> tuple[float, float]:
    """Limits of the error axis: at least two decades, so that small differences look small."""
    if not values:
        return LEAST, 1.0
    low, high = 0.5 * min(values), 2.0 * max(values)
    wider = max(1.0, float(np.sqrt(100.0 * low / high)))
    return low / wider, high * wider


def _number(axes: Axes) -> None:
    """Tick labels as plain numbers, with 2 and 5 between powers of ten on short axes."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        few = high / low < 2e3
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
        axis.set_minor_formatter(NullFormatter())


def _legend(axes: Axes) -> tuple[list[str], list[Any]]:
    handles, texts = axes.get_legend_handles_labels()
    return texts, handles
