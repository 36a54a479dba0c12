# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns import BAG...`: writes the tracked poses of bags as a data set."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from .arguments import completes, configs, shipped_models
from ..recordings.importing.import_bags import import_bags
from ..recordings.importing.tracks import ImportOptions


def format_report(report: dict[str, Any]) -> str:
    """Lines on the import of one bag."""
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
    poses = report['poses']
    total = sum(poses.values())
    shares = ', '.join(f'{name} {100 * n / total:.3g} %' for name, n in poses.items() if n)
    lines.append(f'  poses: {shares}')
    if report['matched']:
        lines.append(
            f'  spheres: matched from frame to frame, {report["matched"]}; '
            f'{report["filled"]} poses put in where one was not seen'
        )
    for key in ('refused', 'cuts'):
        if report[key]:
            lines.append(f'  {key}: ' + ', '.join(f'{n} {why}' for why, n in report[key].items()))
    if report['damaged'] or report['too_short']:
        lines.append(
            f'  left out: {report["damaged"]} damaged frames, {report["too_short"]} stretches '
            'too short'
        )
    return '\n'.join(lines + [f'  {warning}' for warning in report['warnings']])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns import`."""
    parser.add_argument('bags', type=Path, nargs='+', metavar='BAG', help='folder or .mcap file')
    parser.add_argument('--out', required=True, type=Path, help='folder of the data set to write')
    parser.add_argument(
        '--topic',
        help='topic of the tracked poses (default: the one that a simulator recorded, else the '
        'only .../tracked_poses)',
    )
    scene = parser.add_argument(
        '--scene', metavar='NAME|FILE', help='scene instead of the recorded one'
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
    parser.epilog = (
        'examples:\n  rigid-gns import bags/first bags/second --out data/lab\n'
        '  rigid-gns calibrate --data data/lab --out lab.yaml'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns import`; the exit code."""
    names = ('topic', 'scene', 'radius', 'model', 'dt', 'max_gap', 'min_steps', 'match')
    options = ImportOptions(**{name: getattr(arguments, name) for name in names})
    reports = import_bags(arguments.bags, arguments.out, options)
    print('\n'.join(format_report(report) for report in reports))
    print(f'{sum(len(report["records"]) for report in reports)} records in {arguments.out}')
    return 0
