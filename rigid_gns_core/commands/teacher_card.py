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
from ..running.progress import Progress


def table(checks: list[Check]) -> str:
    """One line per check name: its worst case."""
    worst: dict[str, Check] = {}
    for check in checks:
        known = worst.get(check.name)
        if known is None or not abs(check.error) <= abs(known.error):
            worst[check.name] = check
    head = ('measured', 'expected', 'error', 'bound')
    lines = [f'{"check (worst case)":44} {head[0]:>10} {head[1]:>9} {head[2]:>9} {head[3]:>7}']
    for check in worst.values():
        verdict = 'pass' if check.passed else 'FAIL'
        lines.append(
            f'{check.name:44} {check.measured:10.4g} {check.expected:9.4g} {check.error:+9.1e}'
            f' {check.bound:7.0e} {verdict}  {check.case}'
        )
    return '\n'.join(lines)


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
