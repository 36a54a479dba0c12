# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figure of what tracks told: residuals, restitution, drag, and errors of left-out tracks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..files.atomic_file import whole_file
from ..identification.learn import Learned

_BINS = 24


def draw_learned(learned: Learned, path: Path) -> None:
    """Draw residuals by time, restitution by speed, drag by spin ratio, errors by horizon."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 7.0), layout='constrained')
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 2)
    _residuals(axes[0, 0], learned)
    _restitution(axes[0, 1], learned)
    _air(axes[1, 0], learned)
    _errors(axes[1, 1], learned)
    with whole_file(path) as partial:
        figure.savefig(partial, dpi=120, format=path.suffix[1:])


def _residuals(axes: Any, learned: Learned) -> None:
    found = learned.diagnostics
    edges = np.linspace(0.0, max(float(found.times.max()), 1e-9), _BINS + 1)
    place = np.clip(np.searchsorted(edges, found.times, side='right') - 1, 0, _BINS - 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    for part, label in ((0.5, 'median'), (0.9, '90 %')):
        sizes = [
            1e3 * np.quantile(found.residuals[place == k], part) if (place == k).any() else np.nan
            for k in range(_BINS)
        ]
        axes.plot(middles, sizes, label=label)
    axes.set(xlabel='time since the start of a stretch [s]', ylabel='distance from the path [mm]')
    axes.set_yscale('log')
    axes.legend()


def _restitution(axes: Any, learned: Learned) -> None:
    laws = {plane.contact: None for plane in learned.scene.surfaces if plane.contact is not None}
    top = 0.5
    for number, bounces in enumerate(learned.diagnostics.bounces):
        if len(bounces):
            axes.plot(*bounces.T, '.', alpha=0.4, label=f'bounces, contact {number}')
            top = max(top, float(bounces[:, 0].max()))
    speeds = np.linspace(0.0, top, 100)
    for law in laws:
        axes.plot(speeds, law.curve.at(speeds), label='fitted')
    axes.set(xlabel='approach speed [m/s]', ylabel='restitution', ylim=(0.0, 1.05))
    axes.legend()


def _air(axes: Any, learned: Learned) -> None:
    axes.set(xlabel='spin ratio S', ylabel='coefficient')
    air = learned.scene.air
    if air is None:
        axes.set_title('no air was told')
        return
    seen = learned.diagnostics.ratios
    ratios = np.linspace(0.0, max(float(np.quantile(seen, 0.99)), 0.1), 100)
    axes.plot(ratios, air.drag_coefficient + air.drag_slope * ratios, label='drag')
    lift = air.lift_coefficient * ratios / (ratios + air.lift_half_ratio)
    axes.plot(ratios, lift, label='lift')
    counts, edges = np.histogram(seen, bins=_BINS, range=(0.0, float(ratios[-1])))
    share = 0.3 * counts / max(int(counts.max()), 1)
    axes.stairs(share, edges, fill=True, alpha=0.2, label='seen')
    axes.legend()


def _errors(axes: Any, learned: Learned) -> None:
    kept = [line for line in learned.table if line.kept and not line.name.startswith('without')]
    for line in kept:
        horizons = [float(horizon) for horizon in line.every]
        means = [100 * values[1] for values in line.every.values()]
        axes.plot(horizons, means, '.-', label=line.name)
    axes.set(xlabel='horizon [s]', ylabel='mean error of left-out tracks [cm]')
    axes.set_yscale('log')
    axes.legend(fontsize='x-small')
