# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns import FILE...`: writes the tracked poses of bags and CSV files as a data set."""

from __future__ import annotations

import argparse
from dataclasses import fields
from pathlib import Path
from typing import Any

from .arguments import completes, configs, shipped_models
from ..data.tracks import load_tracks, TRACKS_NAME
from ..recordings.importing.import_bags import import_bags
from ..recordings.importing.options import ImportOptions
from ..recordings.importing.units_and_axes import AXES


def format_report(report: dict[str, Any]) -> str:
    """Lines on the import of one file."""
    return _of_bag(report) if 'bag' in report else _of_csv(report)


def _of_bag(report: dict[str, Any]) -> str:
    records = ', '.join(f'{steps} steps of {count}' for count, steps in report['records'])
    turning = report['noise_rad']
    period = f'{1e3 * report["interval_s"]:.4g} ms'
    lines = [
        f'{report["bag"]}: {report["frames"]} frames of {report["topic"]} every {period}',
        f'  steps: {1e3 * report["dt_s"]:.4g} ms',
        f'  records: {records} spheres',
        f'  noise: {1e3 * report["noise_m"]:.3g} mm in each coordinate, '
        + ('rotations are not tracked' if turning is None else f'{turning:.2g} rad in rotations'),
    ]
    lines.append(_shares(report['poses']))
    if report['matched']:
        lines.append(f'  spheres: matched from frame to frame, {report["matched"]}')
    if report['matched'] or report['filled']:
        lines.append(f'  filled: {report["filled"]} poses put in where one was not seen')
    for key in ('refused', 'cuts'):
        if report[key]:
            lines.append(f'  {key}: ' + ', '.join(f'{n} {why}' for why, n in report[key].items()))
    if report['damaged'] or report['too_short']:
        lines.append(
            f'  left out: {report["damaged"]} damaged frames, {report["too_short"]} stretches '
            'too short'
        )
    return '\n'.join(lines + [f'  {warning}' for warning in report['warnings']])


def _of_csv(report: dict[str, Any]) -> str:
    count = len(report['spheres'])
    spheres = f'{count} sphere{"s" if count > 1 else ""}, {report["samples"]} samples'
    interval = f'{1e3 * report["interval_s"]:.4g} ms'
    lines = [
        f'{report["file"]}: {report["tracks"]} tracks of {spheres}, frames {interval} apart',
        f'  noise: {1e3 * report["noise_m"]:.3g} mm in each coordinate',
    ]
    if report['clock']:
        lines.append(f'  {report["clock"]}')
    lines += [f'  left out: {problem}' for problem in report['left_out']]
    if report['records']:
        steps = sum(steps for _, steps in report['records'])
        dt = 1e3 * report['dt_s']
        lines.append(f'  records: {len(report["records"])}, {steps} steps of {dt:.4g} ms')
        lines.append(_shares(report['poses']))
    else:
        lines.append(f'  records: none, the tracks alone: {report["no_records"]}')
    return '\n'.join(lines)


def _shares(poses: dict[str, int]) -> str:
    """Where the poses of the records come from."""
    total = sum(poses.values())
    shares = ', '.join(f'{name} {100 * n / total:.3g} %' for name, n in poses.items() if n)
    return f'  poses: {shares}'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns import`."""
    parser.add_argument(
        'files',
        type=Path,
        nargs='+',
        metavar='FILE',
        help='bag (folder or .mcap file), or .csv: track,sphere,time,x,y,z[,qx,qy,qz,qw]',
    )
    parser.add_argument('--out', required=True, type=Path, help='folder of the data set to write')
    parser.add_argument(
        '--topic',
        help='topic of the tracked poses (default: the one that a simulator recorded, else the '
        'only .../tracked_poses)',
    )
    scene = parser.add_argument(
        '--scene', metavar='NAME|FILE', help='scene; of a bag: instead of the recorded one'
    )
    parser.add_argument('--radius', type=float, help="radius instead of the scene's [m]")
    model = parser.add_argument('--model', default='', help='model whose time step the data get')
    completes(scene, configs('scenes'))
    completes(model, shipped_models)
    parser.add_argument('--dt', type=float, help="time step instead of the model's [s]")
    parser.add_argument('--max-gap', type=float, help='longest time between joined frames [s]')
    parser.add_argument(
        '--min-steps', type=int, default=10, help='shorter stretches are left out (default 10)'
    )
    parser.add_argument(
        '--match',
        action='store_true',
        help='associate poses with tracks: they come in any order or are missing (default: only '
        'where the simulator that recorded the bag did so)',
    )
    parser.add_argument(
        '--scale',
        type=float,
        default=1.0,
        help='metres in a unit of x, y and z: 0.001 for millimetres (default 1)',
    )
    parser.add_argument(
        '--up', choices=tuple(AXES), default='z', help='axis that points up (default z)'
    )
    parser.add_argument(
        '--frame',
        metavar='NAME',
        help="coordinate frame of the scene: poses in others are moved by the bag's tf",
    )
    table = parser.add_argument_group('options for CSV files')
    table.add_argument(
        '--skip-bad', action='store_true', help='leave bad tracks out instead of refusing the file'
    )
    parser.epilog = (
        'examples:\n  rigid-gns import bags/first bags/second --out data/lab\n'
        '  rigid-gns import shots.csv --scene table_tennis --scale 0.001 --up y --out data/shots\n'
        '  rigid-gns calibrate --data data/lab --out lab.yaml'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns import`; the exit code."""
    names = [field.name for field in fields(ImportOptions)]
    options = ImportOptions(**{name: getattr(arguments, name) for name in names})
    reports = import_bags(arguments.files, arguments.out, options)
    print('\n'.join(format_report(report) for report in reports))
    records = sum(len(report['records']) for report in reports)
    tracks = arguments.out / TRACKS_NAME
    print(f'{len(load_tracks(tracks))} tracks in {tracks}\n{records} records in {arguments.out}')
    return 0
