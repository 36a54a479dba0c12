# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns closed-forms`: checks of the teacher, or a model, against closed-form mechanics."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from .arguments import completes, length, shipped_models
from ..closed_form import GROUPS, run_checks
from ..closed_form.bounces import Simulate
from ..closed_form.engines import scaled, simulator_engine
from ..errors import UserError
from ..files.strict_json import write_json
from ..files.tables import format_rows, number
from ..prediction.load import load_simulator
from ..running.progress import Progress

TEACHER = 'teacher'
OWN_RADII = 'bounce'
"""Group of checks with radii of 1 m and 20 mm of its own."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns closed-forms`."""
    model = parser.add_argument(
        '--model',
        nargs='+',
        default=[TEACHER],
        metavar='NAME',
        help=f'shipped names, paths, or {TEACHER} (default), which is Bullet',
    )
    completes(model, lambda: [*shipped_models(), TEACHER])
    parser.add_argument(
        '--radius', nargs='+', type=length, default=[1.0], help='radii of spheres [m] (default: 1)'
    )
    parser.add_argument(
        '--groups',
        nargs='+',
        choices=tuple(GROUPS),
        default=list(GROUPS),
        metavar='GROUP',
        help=f'only these of {", ".join(GROUPS)}',
    )
    parser.add_argument('--substeps', type=int, help="teacher's substeps per 0.1 s (default: 240)")
    parser.add_argument('--quick', action='store_true', help='fewer cases, a few seconds')
    parser.add_argument('--json', type=Path, metavar='FILE', help='write all checks to this file')
    parser.epilog = (
        'exit code: 1 where a check is out of bounds; what a model refuses is no failure\n'
        'examples:\n'
        '  rigid-gns closed-forms --groups bounce incline level oblique collision pile\n'
        '  rigid-gns closed-forms --model gns --radius 1 0.02'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns closed-forms`, which prints a table of each model; the exit code."""
    engines = {name: _engine(name, arguments.substeps) for name in arguments.model}
    work = [
        (radius, group)
        for radius in arguments.radius
        for group in arguments.groups
        if radius == 1.0 or group != OWN_RADII
    ]
    models: dict[str, dict[str, Any]] = {}
    with Progress(len(engines) * len(work), 'closed forms', unit='group') as progress:
        for name, (described, simulate) in engines.items():
            checks: list[dict[str, Any]] = []
            refused: dict[str, str] = {}
            models[name] = {**described, 'checks': checks, 'refused': refused}
            for radius, group in work:
                engine = simulate if radius == 1.0 else scaled(simulate, radius)
                try:
                    made = run_checks(engine, arguments.quick, (group,))
                except UserError as error:  # as where all masses have to be equal
                    refused[group], made = str(error), []
                for check in made:
                    of = {'group': group, 'radius': radius, 'passed': check.passed}
                    if not np.isfinite(check.error):  # it diverged
                        of |= {'measured': np.inf, 'error': np.inf}
                    checks.append(asdict(check) | of)
                progress.update(model=name, group=group)
    if arguments.json:  # before it is printed, as the reader of the output may leave
        write_json(arguments.json, {'quick': arguments.quick, 'models': models})
    failed = 0
    for name, model in models.items():
        lost = sum(not check['passed'] for check in model['checks'])
        failed += lost
        print(f'{name}\n\n{format_checks(model["checks"])}\n')
        print(f'{len(model["checks"]) - lost} of {len(model["checks"])} checks passed\n')
        for group, reason in model['refused'].items():
            print(f'refused: {group}: {reason}\n')
    return int(failed > 0)


def format_checks(checks: Sequence[dict[str, Any]]) -> str:
    """Table with a line for each check and radius: its worst case."""
    worst: dict[tuple[str, float], dict[str, Any]] = {}
    for check in checks:
        known = worst.setdefault((check['name'], check['radius']), check)
        if not abs(check['error']) <= abs(known['error']):
            worst[check['name'], check['radius']] = check
    head = ['check (worst case)', 'radius', 'measured', 'expected', 'error', 'bound', '', '']
    rows = [
        [
            check['name'],
            f'{check["radius"]:g} m',
            number(check['measured'], 4),
            number(check['expected'], 4),
            f'{check["error"]:+.1e}',
            f'{check["bound"]:.0e}',
            'pass' if check['passed'] else 'FAIL',
            check['case'],
        ]
        for check in worst.values()
    ]
    return format_rows(head, rows, left=(0, -2, -1))


def _engine(name: str, substeps: int | None) -> tuple[dict[str, Any], Simulate]:
    """Description of an engine for the JSON file, and the engine."""
    if name != TEACHER:
        simulator = load_simulator(name)
        simulator.warm_up()
        return {'card': simulator.card}, simulator_engine(simulator)
    from ..teacher.bullet import load_pybullet, simulate
    from ..teacher.settings import TeacherSettings

    load_pybullet()
    settings = TeacherSettings() if substeps is None else TeacherSettings(substeps=substeps)
    return (
        {'settings': asdict(settings)},
        lambda scene, start, steps, dt: simulate(scene, start, steps, dt, settings),
    )
