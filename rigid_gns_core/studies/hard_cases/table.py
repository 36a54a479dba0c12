# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of hard cases, with a line for each case and model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .cases import DRIFT, ENERGY_RISE
from .checks import HORIZONS
from ...files.tables import format_rows, number

_LAWS = ('case', 'model', 'verdict', 'finite', 'inside', 'deepest', 'at end', 'energy rise')
_LAWS += ('drift', 'speed')
_ERRORS = ('error', 'floor', 'ratio')


def format_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Table of rows of `run_cases`; columns that no row fills are left out."""
    columns = [*_LAWS, *(_ERRORS if any(row['errors'] for row in rows) else ())]
    notes: dict[str, int] = {}
    cells = [[*(_cell(row, column) for column in columns), _remark(row, notes)] for row in rows]
    lines = [format_rows([*columns, ''], cells, left=(0, 1, 2, -1))]
    lines += ['', _legend(len(columns) > len(_LAWS))]
    lines += [f'({number}) {text}' for text, number in notes.items()]
    return '\n'.join(lines)


def format_summary(rows: Sequence[Mapping[str, Any]]) -> str:
    """A line for each model: numbers of cases passed, failed and refused, and which it failed."""
    lines = []
    for model in dict.fromkeys(row['model'] for row in rows):
        own = [row for row in rows if row['model'] == model]
        count = {v: sum(row['verdict'] == v for row in own) for v in ('ok', 'FAILED', 'refused')}
        failed = ', '.join(row['case'] for row in own if row['verdict'] == 'FAILED')
        text = ', '.join(f'{number} {verdict}' for verdict, number in count.items())
        lines.append(f'{model}: {text}' + (f' ({failed})' if failed else ''))
    return '\n'.join(lines)


def _legend(errors: bool) -> str:
    text = (
        f'! out of bounds: finite, inside, energy rise <= {ENERGY_RISE:g} (of m g r of all '
        f'spheres plus the kinetic energy at the start), drift <= {DRIFT:g} r where spheres '
        'should rest.\n'
        'deepest [diameters]: of the second half, judged in cases of heavy loads; speed [m/s]: '
        'the fastest at the end.'
    )
    if errors:
        steps = '/'.join(map(str, HORIZONS))
        text += (
            f'\nerror [m] against the teacher after {steps} steps; floor [m]: the teacher against '
            'itself at half and twice the substeps; ratio: error over floor, or half a radius '
            'where that is more.'
        )
    return text


def _cell(row: Mapping[str, Any], column: str) -> str:
    if column in ('case', 'model', 'verdict'):
        return str(row[column])
    laws = row['laws']
    if laws is None:
        return ''
    if column in _ERRORS:
        errors = row['errors'] or {}
        return '/'.join(number(values[column], 2) for values in errors.values()) or '-'
    if column == 'inside':
        return 'yes' if laws['inside'] else f'{laws["escaped"]} out!'
    if column == 'finite':
        return 'yes' if laws['finite'] else 'no!'
    names = {'at end': 'final_depth', 'energy rise': 'energy_rise', 'speed': 'final_speed'}
    name = names.get(column, column)
    return number(laws[name], 2) + ('!' if name in row['failed'] else '')


def _remark(row: Mapping[str, Any], notes: dict[str, int]) -> str:
    """Remark of a row; long texts go below the table, by their number in `notes`."""
    if row['refused'] is not None:
        return str(row['refused'])
    parts = []
    laws = row['laws'] or {}
    if 0 < laws.get('push_out', 0.0) < np.inf:
        parts.append(f'pushed out by {number(laws["push_out"], 2)}')
    if row['teacher'] is False:
        parts.append('teacher: no')
    for text in row['warnings']:
        parts.append(f'({notes.setdefault(text, len(notes) + 1)})')
    return ', '.join(parts)
