# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Means of the measures over records, and the tables of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from laws_test_measures import ERRORS, LAWS, SQUARED
import numpy as np
from rigid_gns_core.files.tables import format_rows
from rigid_gns_core.files.tables import summary as summary_cell


def mean_of(rows: Iterable[Mapping[str, float | None]]) -> dict[str, Any]:
    """Mean, standard deviation, count and number of infinite values of each measure.

    The mean is of the finite ones.
    """
    rows = list(rows)
    summary = {}
    for key in {key: None for row in rows for key in row}:
        values = np.array([row[key] for row in rows if row.get(key) is not None], dtype=float)
        finite = values[np.isfinite(values)]
        if not len(values):
            continue
        summary[key] = {
            'mean': float(finite.mean()) if len(finite) else float('inf'),
            'std': float(finite.std()) if len(finite) else 0.0,
            'count': len(values),
            'infinite': len(values) - len(finite),
        }
    return summary


def summarise(report: dict[str, Any]) -> dict[str, Any]:
    """Means over the records of each group: of each model, and of the floor."""
    groups: dict[str, list[str]] = {}
    for name in report['floors']:
        groups.setdefault(name.split('/')[0], []).append(name)

    def by_group(rows: Mapping[str, Any]) -> dict[str, Any]:
        return {
            group: mean_of(rows[name] for name in names if name in rows)
            for group, names in groups.items()
        }

    models = {name: by_group(entry['records']) for name, entry in report['models'].items()}
    return {'floor': by_group(report['floors']), 'models': models}


def format_table(summary: Mapping[str, Any], floor: Mapping[str, Any]) -> str:
    """Markdown: one line per measure, two columns per group: the model, and Bullet."""
    steps = [key.removeprefix('mse_') for key in next(iter(summary.values())) if key[4:].isdigit()]
    names = dict(ERRORS)
    for step in steps:
        names[f'position_error_{step}'] = f'position error at step {step} [m]'
        names[f'mse_{step}'] = f'MSE at step {step} [m²]'
    for key in [key for key in names if key.startswith((*SQUARED, 'position'))]:
        names[f'{key}_ratio'] = f'{names[key].rpartition(" [")[0]} / floor'
    names |= LAWS
    head = ['']
    for group in summary:
        head += [group, 'Bullet']
    lines = []
    for key, name in names.items():
        cells = [name]
        for group, values in summary.items():
            cells += [summary_cell(values.get(key)), summary_cell(floor[group].get(key))]
        if any(text != '-' for text in cells[1:]):
            lines.append(cells)
    return format_rows(head, lines, markdown=True) + '\n'
