# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns hard-cases`: runs models, and the teacher, on the hard cases."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .arguments import completes, seed_number, shipped_models
from ..files.strict_json import write_json
from ..installation.versions import PACKAGE, version_of
from ..running.progress import Progress
from ..studies.chaos_floor import LEAST_FLOOR, References
from ..studies.hard_cases.case import Case
from ..studies.hard_cases.cases import DRIFT, ENERGY_RISE, hard_cases
from ..studies.hard_cases.checks import TEACHER_ENERGY_RISE
from ..studies.hard_cases.engines import load_engine, run_cases, TEACHER
from ..studies.hard_cases.table import format_summary, format_table
from ..teacher.bullet import load_pybullet
from ..teacher.settings import TeacherSettings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns hard-cases`."""
    model = parser.add_argument(
        '--model',
        nargs='+',
        metavar='NAME',
        help=f'shipped names, paths, or {TEACHER} (default: the shipped default)',
    )
    completes(model, lambda: [*shipped_models(), TEACHER])
    only = parser.add_argument(
        '--cases', nargs='+', metavar='NAME', help='only these cases (default: all)'
    )
    completes(only, [case.name for case in hard_cases()])
    parser.add_argument('--quick', action='store_true', help='fewer steps in long cases')
    parser.add_argument(
        '--seed', type=seed_number, default=0, help='seed of random starts (default: 0)'
    )
    parser.add_argument(
        '--teacher',
        action=argparse.BooleanOptionalAction,
        help='errors against Bullet (default: if pybullet is installed); takes minutes',
    )
    parser.add_argument(
        '--substeps', type=int, default=96, help="teacher's substeps per time step (default: 96)"
    )
    parser.add_argument(
        '--cache', type=Path, metavar='DIR', help="cache the teacher's trajectories in this folder"
    )
    parser.add_argument(
        '--velocities',
        choices=('given', 'poses'),
        help="velocities for the energy: the model's, or differences of its poses (default: "
        'poses, unless those of the model are instantaneous)',
    )
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all numbers to this file')
    parser.epilog = '\n'.join(
        [
            'exit code: 1 if the default model fails a case',
            'example:',
            '  rigid-gns hard-cases --quick --cache runs/hard_cases',
            'cases:',
            *(f'  {case.name:14} {case.text}' for case in hard_cases()),
            'What each number means: docs/hard_cases.md.',
        ]
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns hard-cases`; the exit code, 1 where the default model fails a case."""
    from ..files.checkpoint import DEFAULT_MODEL

    cases = hard_cases(arguments.cases, quick=arguments.quick, seed=arguments.seed)
    settings = TeacherSettings(substeps=arguments.substeps)
    names = list(dict.fromkeys(arguments.model or [DEFAULT_MODEL]))
    if arguments.teacher is not False:
        try:
            load_pybullet()
        except ModuleNotFoundError:
            if arguments.teacher:
                raise
            print('pybullet is not installed: no errors against the teacher\n')
            arguments.teacher = False
    references = None if arguments.teacher is False else References(settings, arguments.cache)
    engines = [load_engine(name, arguments.velocities, settings) for name in names]
    rows = []
    with Progress(len(cases) * len(engines), 'hard cases', unit='row') as progress:
        for row in run_cases(engines, cases, references):
            rows.append(row)
            progress.update(case=row['case'], model=row['model'])
    if arguments.json is not None:  # before it is printed, as the reader of the output may leave
        write_json(arguments.json, _report(arguments, cases, references, settings, rows))
    print(f'{format_table(rows)}\n\n{format_summary(rows)}')
    if arguments.json is not None:
        print(f'numbers: {arguments.json}')
    return int(any(r['model'] == DEFAULT_MODEL and r['verdict'] == 'FAILED' for r in rows))


def _report(
    arguments: argparse.Namespace,
    cases: Sequence[Case],
    references: References | None,
    settings: TeacherSettings,
    rows: list[dict[str, Any]],
) -> dict[str, Any]:
    return {
        'version': version_of(PACKAGE) or 'unknown',  # a source tree that is not installed
        'quick': arguments.quick,
        'thresholds': {
            'energy_rise': ENERGY_RISE,
            'drift': DRIFT,
            'least_floor': LEAST_FLOOR,
            'teacher_energy_rise': TEACHER_ENERGY_RISE,
        },
        'teacher': None if references is None else asdict(settings),
        'cases': {
            case.name: {
                'text': case.text,
                'spheres': len(case.start),
                'steps': case.steps,
                'seed': case.seed,
            }
            for case in cases
        },
        'rows': rows,
    }
