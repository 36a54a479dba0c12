# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns benchmark recordings`: laws fitted to half of real tracks, judged on the others."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from .arguments import seed_number
from .evaluate_tracks import format_horizons
from ..errors import UserError
from ..files.strict_json import write_json
from ..prediction.load import load_simulator
from ..running.machine import describe_machine, load_average
from ..studies.real_balls.recorded_sets import find_sets
from ..studies.real_balls.run import draw_sets, run_sets
from ..studies.real_balls.tables import format_set, format_times

OUT = Path('recordings')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns benchmark recordings`."""
    parser.add_argument(
        'folder',
        type=Path,
        metavar='FOLDER',
        help='NAME.csv with NAME.yaml (a scene) or NAME.json (a description), or data sets that '
        '`rigid-gns import` made',
    )
    parser.add_argument('--sets', nargs='+', metavar='NAME', help='only these sets (default: all)')
    parser.add_argument(
        '--seed',
        type=seed_number,
        default=0,
        metavar='N',
        help='seed of the halves and of the draws (default 0)',
    )
    parser.add_argument(
        '--out',
        type=Path,
        default=OUT,
        metavar='DIR',
        help='tracks, fitted scenes and report of each set; what is done there is not done again '
        f'(default: {OUT})',
    )
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all numbers to this file')
    parser.add_argument(
        '--figures', type=Path, metavar='DIR', help='draw tracks, errors and coverage (PNG) here'
    )
    parser.epilog = (
        'example:\n  rigid-gns benchmark recordings balls --out runs/balls --figures runs/balls\n'
        'What is measured and how: docs/real_balls.md.'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns benchmark recordings`, which prints tables; the exit code."""
    if arguments.json is not None and arguments.json.is_dir():
        raise UserError(f'--json is {arguments.json}, a folder; give a file')
    sets = find_sets(arguments.folder, arguments.sets)
    simulator = load_simulator()
    simulator.warm_up()
    load = load_average()
    reports = run_sets(
        sets, arguments.out, simulator, arguments.seed, lambda text: print(text, file=sys.stderr)
    )
    if arguments.json is not None:
        head = {'machine': describe_machine(), 'load_average': load, 'seed': arguments.seed}
        write_json(arguments.json, head | {'sets': reports})
    for name, report in reports.items():
        print(f'{format_set(name, report)}\n')
        for protocol, text in report['protocols'].items():
            print(f'fitted, {text}\n')
            print(f'{format_horizons(report["rivals"]["fitted"][protocol])}\n')
    print('\n'.join(format_times(name, report) for name, report in reports.items()))
    if arguments.figures is not None:
        for path in draw_sets(reports, sets, arguments.out, arguments.figures, simulator):
            print(f'picture: {path}')
    if arguments.json is not None:
        print(f'numbers: {arguments.json}')
    return 0
