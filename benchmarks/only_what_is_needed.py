# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cost and gain of each feature that a scene may need: docs/only_what_is_needed.md.

    python benchmarks/only_what_is_needed.py --data data/test

Each row compares the model as it is with one change. Both run in turns from the same state, so
that what else the machine does meets both alike; times are medians over the repeats. Without
--quick the page and docs/model/only_what_is_needed.json are written; with it only what is named.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import islice
import os
from pathlib import Path
import platform
import sys
from typing import Any
import warnings

from ablation_measures import Bench, HORIZON
from ablation_page import format_table, page
from ablation_starts import make_starts
from ablations import ROWS
import numba
from rigid_gns_core.data.records import Dataset
from rigid_gns_core.files.strict_json import write_json
from rigid_gns_core.running.machine import cpu_name
from rigid_gns_core.running.progress import Progress

DOCS = Path(__file__).resolve().parents[1] / 'docs'


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--data', type=Path, metavar='FOLDER', help="Bullet's, for errors")
    parser.add_argument(
        '--rows', nargs='+', metavar='WORD', help='only rows that begin with these'
    )
    parser.add_argument('--repeats', type=int, help='turns of each side (default: 15)')
    parser.add_argument('--block', type=int, help='steps of a turn (default: 10)')
    parser.add_argument('--quick', action='store_true', help='few spheres, turns and records')
    parser.add_argument('--json', type=Path, metavar='FILE')
    parser.add_argument('--page', type=Path, metavar='FILE')
    arguments = parser.parse_args()
    quick = arguments.quick
    words = tuple(arguments.rows or ('',))
    rows = {name: row for name, row in ROWS.items() if name.startswith(words)}
    if not rows:
        raise SystemExit(f'no such rows; there are: {", ".join(ROWS)}')
    repeats = arguments.repeats or (2 if quick else 15)
    block = arguments.block or (3 if quick else 10)
    records = []
    if arguments.data is not None:
        records = [
            replace(record, trajectory=record.trajectory.window(0, HORIZON + 1))
            for record in islice(Dataset(arguments.data), 1 if quick else None)
        ]
    starts = make_starts(quick)
    bench = Bench(starts, records, repeats, block)
    report: dict[str, Any] = {
        'command': ' '.join(['python', 'benchmarks/only_what_is_needed.py', *sys.argv[1:]]),
        'card': bench.load().card,
        'data': None if arguments.data is None else arguments.data.name,
        'records': len(records),
        'quick': quick,
        'repeats': repeats,
        'block': block,
        'machine': {
            'cpu': cpu_name(),
            'cores': os.cpu_count(),
            'load': round(os.getloadavg()[0], 1),
            'python': platform.python_version(),
            'numba': numba.__version__,
        },
        'starts': {name: start.text for name, start in starts.items()},
        'rows': {},
    }
    with Progress(len(rows), 'only what is needed', unit='row') as progress:
        for name, row in rows.items():
            with warnings.catch_warnings():
                warnings.simplefilter('ignore', UserWarning)  # leaving things out is meant
                report['rows'][name] = bench.measure(*row)
            progress.update(ratio=report['rows'][name]['ratio'])
    print(format_table(report), end='')
    whole = not quick and not arguments.rows
    json = arguments.json or (DOCS / 'model' / 'only_what_is_needed.json' if whole else None)
    file = arguments.page or (DOCS / 'only_what_is_needed.md' if whole else None)
    if json is not None:
        write_json(json, report)
    if file is not None:
        file.write_text(page(report), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
