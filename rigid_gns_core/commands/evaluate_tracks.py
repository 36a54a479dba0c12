# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns evaluate --window`: forecasts from windows of tracks, scored by what comes after."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ..files.strict_json import write_json
from ..files.tables import format_rows, number

WINDOW, HORIZONS, SAMPLES = 0.2, (0.2, 0.4, 0.6, 1.0), 32


def add_track_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of forecasts from windows of tracks."""
    tracks = parser.add_argument_group(
        'options for tracks', 'of --data that `import` made; --scene and --model as below'
    )
    tracks.add_argument(
        '--window',
        type=float,
        metavar='S',
        help=f'start from this much of a track [s] (default {WINDOW:g})',
    )
    tracks.add_argument(
        '--horizons',
        type=float,
        nargs='+',
        metavar='S',
        help='score so long after a start [s] (default '
        + ' '.join(f'{h:g}' for h in HORIZONS)
        + ')',
    )
    tracks.add_argument(
        '--every', type=float, metavar='S', help='a start every so often [s] (default: the first)'
    )
    tracks.add_argument(
        '--samples',
        type=int,
        metavar='N',
        help=f'states drawn for the 50 and 90 %% regions, 0: none (default {SAMPLES})',
    )


def run_tracks(data: Path, arguments: argparse.Namespace) -> int:
    """Score forecasts from windows of tracks; the exit code."""
    from ..data.tracks import read_tracks
    from ..prediction.load import load_simulator
    from ..recordings.scoring.track_errors import report_of, track_outcomes, Windows
    from ..running.progress import Progress
    from ..scenes.scene_file import load_scene

    windows = Windows(
        window=WINDOW if arguments.window is None else arguments.window,
        horizons=tuple(sorted(set(arguments.horizons or HORIZONS))),
        every=arguments.every,
        samples=SAMPLES if arguments.samples is None else arguments.samples,
    )
    found = read_tracks(data)
    scene = found.scene if arguments.scene is None else load_scene(arguments.scene)
    simulator = load_simulator(arguments.model)
    simulator.warm_up()
    with Progress(len(found.tracks), 'evaluate', unit='track') as progress:
        outcomes = track_outcomes(simulator, found, scene, windows, progress.update)
    horizons = report_of(outcomes, windows.horizons)
    starts = len({(one.track, one.start) for one in outcomes})
    report = {
        'model': simulator.name,
        'data': str(data),
        'data_sha256': found.origin.get('sha256'),
        'scene': scene.to_mapping(),
        'noise_m': found.noise,
        'window_s': windows.window,
        'every_s': windows.every,
        'samples': windows.samples,
        'starts': starts,
        'horizons': horizons,
        'outcomes': [vars(one) for one in outcomes],
    }
    if arguments.json is not None:  # before it is printed, as the reader of the output may leave
        write_json(arguments.json, report)
    print(f'model {simulator.name} on {data}: {len(found.tracks)} tracks, {starts} starts\n')
    print(format_horizons(horizons))
    if arguments.json is not None:
        print(f'numbers: {arguments.json}')
    return 0


def format_horizons(horizons: dict[str, Any]) -> str:
    """Table of the errors by horizon and by contacts in between."""
    rows = []
    for horizon, values in horizons.items():
        rows.append([f'after {horizon} s', 'all', *_cells(values)])
        if len(values['contacts']) > 1 or '0' not in values['contacts']:
            rows += [['', name, *_cells(own)] for name, own in values['contacts'].items()]
    head = ['position error [cm]', 'contacts', 'n', 'mean', 'median', '90 %']
    return format_rows([*head, 'in 50 %', 'in 90 %', 'CRPS'], rows)


def _cells(values: dict[str, Any]) -> list[str]:
    errors = [number(100 * values[key]) for key in ('mean_m', 'median_m', 'p90_m')]
    inside = [values[key] for key in ('coverage_50', 'coverage_90')]
    shares = ['' if one is None else f'{100 * one:.0f} %' for one in inside]
    score = '' if values['crps_m'] is None else number(100 * values['crps_m'])
    return [str(values['n']), *errors, *shares, score]
