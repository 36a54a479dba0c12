# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node in real time: lateness, what is recorded, time of a future, memory.

    python benchmarks/node/node_benchmark.py --json docs/model/node_benchmark.json    # 52 minutes
    python benchmarks/node/node_benchmark.py rate horizon --seconds 10 --only '50 spheres'
    python benchmarks/node/node_benchmark.py soak --only '8 balls' --minutes 30 --again

Tracker, simulator and listener are three processes that talk by DDS. The tracker plays a rollout
of the laws of spheres that fall into a box, with noise of 0.5 % of the radius, forward and
backward, each frame when the clock reaches its stamp. Parts:

rate     Predictions at the model's own rate, recorded, without and with another process that keeps
         one core busy. Lateness is the arrival at the listener (`heard`) or the time of recording
         (`bag`) less the stamp, which is the time a prediction is due. `missed` are stamps that
         were left out, `lost` what was published and is not in the bag.
horizon  From the arrival of a tracked frame to the publication of its future of 1 s (`bag`), and
         from just before it is published to the arrival of its future at the listener (`heard`):
         also both ways through DDS, and the wake-up of two Python processes. Recorded too. A frame
         overtaken by the next one has no future.
crossing From a tracked frame to the crossing of a plane that is forecast from it, of one ball at
         240 Hz; as `horizon`.
learn    One ball at 240 Hz that is thrown again and again, with pauses, in air of which the scene
         does not know: without learning and with it, whose fits run in a process of their own.
         Steps missed while it flies, lateness, futures, and learned scenes that were taken.
kills    What is left of a bag after a SIGKILL: made by benchmarks/bags/bag_kills.py, shown here.
soak     100 Hz, recorded in files of 50 MB (1.2 GB in 30 minutes, into a temporary folder): memory
         of the simulator, which must not grow after the first minute, and errors in its log.

A case that is in the JSON already is kept unless --again. Exit code 1: a bound is not met.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
from pathlib import Path
import sys
import tempfile
from typing import Any

from parts import (
    CASES,
    measure_crossing,
    measure_horizon,
    measure_learn,
    measure_rate,
    measure_soak,
)
from rigid_gns_core.files.strict_json import read_json, write_json
from rigid_gns_core.running.machine import describe_machine
from rigid_gns_ros.demo import DemoError
from run import Case, run
from table import BOUNDS, broken_bounds, format_kills, format_part

PARTS = ('rate', 'horizon', 'crossing', 'learn', 'kills', 'soak')
MEASURES = {
    'rate': measure_rate,
    'horizon': measure_horizon,
    'crossing': measure_crossing,
    'learn': measure_learn,
    'soak': measure_soak,
}
KILLS = Path(__file__).parents[2] / 'docs' / 'model' / 'bag_kills.json'
TOLD = 30.0  # period of the lines of a soak [s]


def measure(part: str, case: Case, seconds: float) -> dict[str, Any]:
    """Run a case and measure it."""
    with tempfile.TemporaryDirectory(prefix='node_benchmark_') as scratch:
        outcome = run(case, seconds, Path(scratch), _teller() if part == 'soak' else None)
    return {
        **case.description,
        'seconds': seconds,
        'tracker_hz': round(1 / outcome.tracked_dt, 3),
        'predictions_hz': round(1 / outcome.period, 3),
        **MEASURES[part](outcome),
        'processor_share': round(outcome.processor_share, 4),
        'counts': outcome.counts,
        'errors': len(outcome.errors),
        'first_errors': [line.replace(scratch, 'FOLDER') for line in outcome.errors[:5]],
        'warnings': outcome.warnings,
        'load_average': outcome.load,
    }


def _teller() -> Callable[[float, int], None]:
    """Print a line every 30 s."""
    due = 0.0

    def tell(passed: float, resident: int) -> None:
        nonlocal due
        if passed >= due:
            print(f'  {passed:6.0f} s  {resident / 1e6:7.2f} MB', flush=True)
            due += TOLD

    return tell


def load_report(path: Path | None) -> dict[str, Any]:
    """Report of an earlier run to continue, or a new one.

    Raises:
        ValueError: It is of another machine, or of other versions.
    """
    machine = json.loads(json.dumps(describe_machine()))
    report = {
        'command': 'python benchmarks/node/node_benchmark.py',
        'machine': machine,
        'bounds': BOUNDS,
        'parts': {},
    }
    if path is None or not path.is_file():
        return report
    before = read_json(path)
    if before['machine'] != machine:
        raise ValueError(
            f'{path} was measured on another machine, or with other versions; '
            'give another --json, or remove it'
        )
    return {**report, 'parts': before['parts']}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('parts', nargs='*', metavar='PART', help=f'of {", ".join(PARTS)} (all)')
    parser.add_argument('--seconds', type=float, default=60.0, help='of a case of rate or horizon')
    parser.add_argument('--minutes', type=float, default=30.0, help='of the soak')
    parser.add_argument('--only', default='', help='only cases whose name holds this text')
    parser.add_argument('--again', action='store_true', help='measure again what is in the JSON')
    parser.add_argument('--json', type=Path, help='where all numbers go, and where they are kept')
    arguments = parser.parse_args()
    if unknown := sorted(set(arguments.parts) - set(PARTS)):
        parser.error(f'no part {unknown[0]!r}, expected {", ".join(PARTS)}')
    if not (arguments.seconds > 0 and arguments.minutes > 0):
        parser.error('--seconds and --minutes must be more than 0')
    parts = [part for part in PARTS if part in (arguments.parts or PARTS)]
    names = [case.name for part in parts for case in CASES.get(part, ())]
    if names and not any(arguments.only in name for name in names):
        parser.error(f'no case holds {arguments.only!r}; cases: {"; ".join(names)}')
    try:
        report = load_report(arguments.json)
    except ValueError as error:
        parser.error(str(error))
    try:
        for part in parts:
            measure_part(part, report, arguments)
    except DemoError as error:
        print(f'node_benchmark: error: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print('node_benchmark: stopped; what was measured is kept', file=sys.stderr)
        return 130
    broken = []
    for part in parts:
        print('\n' + (format_kills(KILLS) if part == 'kills' else format_part(part, report)))
        broken += broken_bounds(part, report)
    print(
        '\n' + ('\n'.join(f'NOT MET: {text}' for text in broken) or 'all bounds are met by these')
    )
    return 1 if broken else 0


def measure_part(part: str, report: dict[str, Any], arguments: argparse.Namespace) -> None:
    """Measure the cases of a part that the report does not hold, and write it after each."""
    done = report['parts'].setdefault(part, {})
    if part == 'kills':
        done.update(made_by='benchmarks/bags/bag_kills.py', file='bag_kills.json')
    seconds = 60 * arguments.minutes if part == 'soak' else arguments.seconds
    for case in CASES.get(part, ()):
        if arguments.only not in case.name or (case.name in done and not arguments.again):
            continue
        print(f'{part}: {case.name}, {seconds:g} s', flush=True)
        done[case.name] = measure(part, case, seconds)
        if arguments.json:
            write_json(arguments.json, report)
    if arguments.json:
        write_json(arguments.json, report)


if __name__ == '__main__':
    sys.exit(main())
