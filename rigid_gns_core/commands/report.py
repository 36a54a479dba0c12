# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns report`: writes one HTML file of a rollout or a bag, to view offline."""

from __future__ import annotations

import argparse
from pathlib import Path

from .comparison_arguments import add_source, read_comparison
from ..errors import UserError
from ..show.report.page import MAX_FRAMES, write_report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns report`."""
    add_source(parser)
    parser.add_argument('--out', required=True, type=Path, metavar='HTML', help='file to write')
    parser.add_argument(
        '--floor',
        type=Path,
        nargs='+',
        default=[],
        metavar='RECORD',
        help="other simulations of the reference's start, such as Bullet at other substeps, for "
        'the floor of chaos',
    )
    parser.add_argument(
        '--velocities',
        choices=('given', 'poses'),
        default='given',
        help='velocities of two records as given (default), or by differences of poses',
    )
    parser.add_argument(
        '--max-frames',
        type=int,
        default=MAX_FRAMES,
        metavar='N',
        help=f'frames in the replay; curves and numbers keep all (default {MAX_FRAMES})',
    )
    parser.epilog = (
        'examples:\n'
        '  rigid-gns report rollout.h5 --reference bullet.h5 --out report.html\n'
        '  rigid-gns report bags/first --out first.html\n\n'
        'What it shows: docs/report.md.'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns report`, which prints the path of the report; the exit code."""
    out: Path = arguments.out
    if out.suffix.lower() not in ('.html', '.htm'):
        raise UserError(f'--out is {out}, expected a name that ends with .html')
    if arguments.max_frames < 2:
        raise UserError(f'--max-frames is {arguments.max_frames}, expected at least 2')
    comparison = read_comparison(
        arguments, floors=arguments.floor, velocities=arguments.velocities
    )
    write_report(out, comparison, max_frames=arguments.max_frames)
    print(f'{comparison.title}\nreport: {out} ({out.stat().st_size / 1e6:.1f} MB)')
    return 0
