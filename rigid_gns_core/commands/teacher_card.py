# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The teacher card: how far Bullet, as the teacher runs it, is from closed-form mechanics."""

from __future__ import annotations

import argparse
from dataclasses import asdict
import json
from pathlib import Path
from typing import Any

from ..closed_form import Check, GROUPS, run_checks
from ..files.tables import format_rows, number
from ..running.progress import Progress


def table(checks: list[Check]) -> str:
    """One line per check name: its worst case."""
    worst: dict[str, Check] = {}
    for check in checks:
        known = worst.get(check.name)
        if known is None or not abs(check.error) <= abs(known.error):
            worst[check.name] = check
    rows = [
        [
            check.name,
            number(check.measured, 4),
            number(check.expected, 4),
            f'{check.error:+.1e}',
            number(check.bound, 1),
            'pass' if check.passed else 'FAIL',
            check.case,
        ]
        for check in worst.values()
    ]
    head = ['check (worst case)', 'measured', 'expected', 'error', 'bound', '', '']
    return format_rows(head, rows, left=(0, -2, -1))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns teacher-card`."""
    parser.add_argument('--json', type=Path, metavar='FILE', help='also write all checks to FILE')
    parser.add_argument('--substeps', type=int, help='steps of Bullet per 0.1 s (default: 240)')
    parser.add_argument('--quick', action='store_true', help='fewer cases, a few seconds')
    parser.epilog = 'example:\n  rigid-gns teacher-card --json card.json'


def run(arguments: argparse.Namespace) -> int:
    """Print the card; 1 where a check is out of bounds."""
    from ..teacher.bullet import load_pybullet
    from ..teacher.bullet import simulate as bullet
    from ..teacher.settings import TeacherSettings

    load_pybullet()
    settings = TeacherSettings()
    if arguments.substeps is not None:
        settings = TeacherSettings(substeps=arguments.substeps)
    checks: list[Check] = []
    with Progress(len(GROUPS), 'teacher card', unit='group') as progress:
        for name in GROUPS:
            checks += run_checks(
                lambda scene, start, steps, dt: bullet(scene, start, steps, dt, settings),
                arguments.quick,
                (name,),
            )
            progress.update(group=name)
    failed = sum(not check.passed for check in checks)
    print(table(checks))
    print(f'{len(checks) - failed} of {len(checks)} checks passed, {settings}')
    if arguments.json:
        content: dict[str, Any] = {
            'settings': asdict(settings),
            'checks': [{**asdict(check), 'passed': check.passed} for check in checks],
        }
        arguments.json.write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')
    return int(failed > 0)
