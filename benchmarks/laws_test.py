# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models on the thesis' test set and its four unseen scenes, beside Bullet and its own floor.

    python benchmarks/laws_test.py --model laws gns \
        --data data/test --floor data/test_half data/test_twice --ood data/ood \
        --json docs/model/laws_test.json

The folders of `--floor` are of the same recipe and seed as `--data`, at half and at twice the
substeps; `--ood` holds ood_a.h5, ood_a_half.h5, ood_a_twice.h5 and so on to ood_d. The floor of an
error is the larger of the two that Bullet has to itself. A ratio to it takes no less than a
quarter of a squared radius, for distances half a radius. The columns named Bullet have the floor
of each error, and of each law what the reference has.

The JSON is written after every rollout, so the same command goes on where it was killed.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
import sys
from typing import Any

from laws_test_measures import floor_of, measure
from laws_test_table import format_table, summarise
from rigid_gns_core.data.records import Dataset, present_records, read_record, Record
from rigid_gns_core.errors import UserError
from rigid_gns_core.files.strict_json import read_json, write_json
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.rollout.simulator import Simulator
from rigid_gns_core.running.progress import Progress

QUICK = (2, 60)  # records and steps
OOD = ('ood_a', 'ood_b', 'ood_c', 'ood_d')


def find_references(
    data: Path | None, floor: Sequence[Path], ood: Path | None
) -> dict[str, list[Path]]:
    """Files of each reference and of the two for its floor, in the order of the tables."""
    found = {}
    if data is not None:
        folders = [present_records(Dataset(folder).folder) for folder in (data, *floor)]
        for index in sorted(folders[0]):
            if not all(index in folder for folder in folders):
                raise SystemExit(f'a folder of --floor lacks trajectory {index}')
            found[f'test/{index:04d}'] = [folder[index] for folder in folders]
    if ood is not None:
        for name in OOD:
            paths = [ood / f'{name}{ending}.h5' for ending in ('', '_half', '_twice')]
            if missing := [path for path in paths if not path.is_file()]:
                raise SystemExit(
                    f'{missing[0]}: no such file; make it with rigid-gns generate --scene'
                )
            found[name] = paths
    return found


def read(paths: Sequence[Path], limit: int | None) -> tuple[Record, list[Record]]:
    """A reference, cut to the length that all have, and the records for its floor."""
    record, *others = (read_record(path) for path in paths)
    steps = min(one.trajectory.steps for one in (record, *others))
    trajectory = record.trajectory.window(0, min(limit or steps, steps) + 1)
    return replace(record, trajectory=trajectory), others


def resume(
    path: Path | None, settings: dict[str, Any], simulators: Mapping[str, Simulator]
) -> dict[str, Any]:
    """Report of an earlier run, or a new one, with an entry for each model."""
    report: dict[str, Any] = {'settings': settings, 'floors': {}, 'models': {}}
    if path is not None and path.is_file():
        report = read_json(path)
        if (known := report.get('settings')) != settings:
            raise SystemExit(f'{path} is of other settings {known}; name another file')
    for name, simulator in simulators.items():
        entry = report['models'].setdefault(name, {'card': simulator.card, 'records': {}})
        if entry['card'] != simulator.card:
            raise SystemExit(f'{path}: holds another {name}; name another file')
    return report


def save(path: Path | None, report: dict[str, Any]) -> None:
    """Summarise the report and write it."""
    report['summary'] = summarise(report)
    if path is not None:
        write_json(path, report)


def run(
    report: dict[str, Any],
    references: Mapping[str, Sequence[Path]],
    simulators: Mapping[str, Simulator],
    limit: int | None,
    path: Path | None,
) -> None:
    """Make the rollouts that the report lacks."""
    records = {name: report['models'][name]['records'] for name in simulators}
    left = {key: [n for n in simulators if key not in records[n]] for key in references}
    total = len(references) * len(simulators)
    done = total - sum(map(len, left.values()))
    with Progress(total, 'laws test', unit='rollout', initial=done) as progress:
        for key, names in left.items():
            if not names:
                continue
            record, others = read(references[key], limit)
            if key not in report['floors']:
                report['floors'][key] = floor_of(record, others)
            for name in names:
                try:
                    values = measure(simulators[name], record, report['floors'][key])
                except UserError as refused:  # a GNS knows spheres of one kind
                    print(f'{name} refuses {key}: {refused}', file=sys.stderr)
                    values = {}
                records[name][key] = values
                save(path, report)
                progress.update(record=key, mse=values.get('mse'))
    save(path, report)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--model', nargs='+', default=['laws', 'gns'], help='names or paths')
    parser.add_argument('--data', type=Path, metavar='FOLDER', help="Bullet's trajectories")
    parser.add_argument('--floor', type=Path, nargs=2, default=(), metavar=('HALF', 'TWICE'))
    parser.add_argument('--ood', type=Path, metavar='FOLDER', help='ood_a.h5 to ood_d_twice.h5')
    parser.add_argument('--steps', type=int, help='default: as long as the data')
    parser.add_argument('--quick', action='store_true', help='few records and steps')
    parser.add_argument('--json', type=Path, metavar='FILE', help='numbers, and where to go on')
    arguments = parser.parse_args()
    references = find_references(arguments.data, arguments.floor, arguments.ood)
    limit = arguments.steps
    if arguments.quick:
        references, limit = dict(islice(references.items(), QUICK[0])), limit or QUICK[1]
    if not references:
        raise SystemExit('nothing to do: give --data, --ood or both')
    simulators = {name: load_simulator(name) for name in arguments.model}
    half, twice = arguments.floor or (None, None)
    sources = {'data': arguments.data, 'half': half, 'twice': twice, 'ood': arguments.ood}
    settings = {
        'steps': limit,
        'quick': arguments.quick,
        **{key: None if path is None else str(path) for key, path in sources.items()},
    }
    report = resume(arguments.json, settings, simulators)
    run(report, references, simulators, limit, arguments.json)
    summary = report['summary']
    for name in simulators:
        print(f'\n{name}: mean ± standard deviation over records\n')
        print(format_table(summary['models'][name], summary['floor']), end='')
    return 0


if __name__ == '__main__':
    sys.exit(main())
