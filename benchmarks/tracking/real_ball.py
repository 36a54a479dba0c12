# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Picture of a tracked ball: what was seen, and what is predicted without and with air.

python benchmarks/tracking/real_ball.py --data data/test --scene lab.yaml --track 7 \
    --out docs/images/real_ball.png

`--data` is imported from tracks that `--scene` was not fitted to, with the scene of the import as
the one without air.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
import matplotlib.pyplot as plt
import numpy as np
from rigid_gns_core import load_scene, load_simulator, Scene
from rigid_gns_core.data.tracks import read_tracks, Track, TrackSet
from rigid_gns_core.recordings.scoring.track_errors import track_outcomes, Windows
from rigid_gns_core.rollout.simulator import Simulator
from rigid_gns_core.tracking.state_estimate import estimate_state

WINDOW = 0.2
COLOURS = {'as given: a vacuum': '#b3541e', 'fitted to other shots': '#1f5fa8'}


def draw_track(axes: Axes, track: Track, scenes: dict[str, Scene], simulator: Simulator) -> None:
    """Side view along the shot: samples, and the forecasts from the first window."""
    times, places = track.times, track.positions[:, 0]
    inside = times - times[0] <= WINDOW
    along = places[-1, :2] - places[0, :2]
    along = along / np.linalg.norm(along)
    origin = places[0, :2]

    def side(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (points[:, :2] - origin) @ along, points[:, 2]

    axes.plot(*side(places[~inside]), '.', color='0.65', ms=5, label='tracked afterwards')
    axes.plot(*side(places[inside]), '.', color='0.1', ms=5, label=f'tracked, first {WINDOW:g} s')
    for name, scene in scenes.items():
        start = estimate_state(scene, times[inside], track.positions[inside])
        lead = np.linspace(0.004, times[-1] - times[inside][-1], 160)
        found = simulator.forecast(scene, start, lead, samples=0).positions[:, 0]
        axes.plot(*side(found), color=COLOURS[name], lw=1.8, label=f'predicted, {name}')
    axes.set_xlabel('along the shot [m]')
    axes.set_ylabel('height [m]')
    axes.set_aspect('equal', adjustable='datalim')
    axes.legend(frameon=False, fontsize=8, loc='lower left')


def draw_errors(
    axes: Axes, tracks: TrackSet, scenes: dict[str, Scene], simulator: Simulator, last: float
) -> None:
    """Mean error of the forecasts of all tracks over how far ahead they are."""
    horizons = tuple(np.round(np.arange(0.1, last + 1e-9, 0.1), 3).tolist())
    for name, scene in scenes.items():
        windows = Windows(window=WINDOW, horizons=horizons, samples=0)
        outcomes = track_outcomes(simulator, tracks, scene, windows)
        means = [
            100 * np.mean([each.error for each in outcomes if each.horizon == horizon] or [np.nan])
            for horizon in horizons
        ]
        print(name, dict(zip(horizons, np.round(means, 1).tolist(), strict=True)))
        axes.plot(horizons, means, 'o-', color=COLOURS[name], ms=4, lw=1.8)
        axes.annotate(
            f'{means[-1]:.0f} cm', (horizons[-1], means[-1]), xytext=(4, 4),
            textcoords='offset points', color=COLOURS[name], fontsize=9,
        )  # fmt: skip
    axes.set_xlabel('predicted ahead [s]')
    axes.set_ylabel('mean error [cm]')
    axes.set_ylim(bottom=0)
    axes.margins(x=0.12)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('--data', required=True, help='folder made by rigid-gns import')
    parser.add_argument('--scene', required=True, help='scene fitted to other tracks')
    parser.add_argument('--track', required=True, help='name of the track that is drawn')
    parser.add_argument('--last', type=float, default=0.6, help='last horizon [s]')
    parser.add_argument('--out', type=Path, required=True)
    args = parser.parse_args(arguments)
    tracks, simulator = read_tracks(args.data), load_simulator()
    scenes = dict(zip(COLOURS, (tracks.scene, load_scene(args.scene)), strict=True))
    shown = next(track for track in tracks.tracks if track.name == args.track)
    matplotlib.use('Agg')
    figure, axes = plt.subplots(
        1, 2, figsize=(9.6, 3.4), width_ratios=(2, 1), layout='constrained'
    )
    draw_track(axes[0], shown, scenes, simulator)
    draw_errors(axes[1], tracks, scenes, simulator, args.last)
    for each in axes:
        each.spines[['top', 'right']].set_visible(False)
        each.grid(alpha=0.25, lw=0.5)
    figure.savefig(args.out, dpi=130)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
