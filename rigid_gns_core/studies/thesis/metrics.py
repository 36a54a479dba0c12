# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Metrics of a rollout, and of the teacher against itself; names as in docs/metrics.md."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..chaos_floor import least_floor, worst
from ..hard_cases.case import Case
from ..hard_cases.checks import measure_laws
from ...data.records import Record
from ...errors import UserError
from ...scenes.state import Trajectory
from ...scoring import LAW_KEYS
from ...scoring.evaluate import evaluate, Velocities

HORIZONS = (10, 30, 50, 100)
_ERRORS = ('mse', 'chamfer', 'position_error', 'predictability_time', 'predictable_to_end')
_ERRORS += ('resting_drift', 'velocity_error', 'spin_error')
_HORIZON_ERRORS = ('position_error', 'mse')
METRICS = {
    'train': (
        *LAW_KEYS,
        *_ERRORS,
        *(f'{key}_{step}' for key in _HORIZON_ERRORS for step in HORIZONS),
        'escaped',
    ),
    'teacher': (*LAW_KEYS, 'escaped'),
    'speed': ('frames_per_second', 'seconds_per_frame', 'edges', 'surface_edges'),
}
"""Metrics of the cells, by kind of experiment."""

Values = dict[str, float | None]
Columns = dict[str, list[float | None]]


def measure(
    predicted: Trajectory, record: Record, steps: int, velocities: Velocities = 'poses'
) -> Values:
    """Laws and errors over the first `steps` of a rollout, by name; infinite where it diverged.

    `diverged_at` is the step or None, `escaped` the share of spheres outside the box [%].
    """
    predicted = predicted.window(0, steps + 1)
    reference = record.trajectory.window(0, steps + 1)
    report = evaluate(predicted, reference, record.scene, horizons=HORIZONS, velocities=velocities)
    values: Values = dict(report['laws']['predicted'])
    values |= {key: report['errors'].get(key) for key in _ERRORS}
    for step, horizon in report['horizons'].items():
        values |= {f'{key}_{step}': horizon[key] for key in _HORIZON_ERRORS}
    case = Case(record.name, '', record.scene, reference[0], steps)
    escaped = measure_laws(case, predicted, velocities=velocities)['escaped']
    values['escaped'] = 100.0 * escaped / reference.count
    values['diverged_at'] = report['diverged_at']['predicted']
    return values


def floor_of(record: Record, others: Sequence[Record], steps: int) -> Values:
    """Floor over the first `steps`: the worst errors of the teacher at other substeps.

    Raises:
        UserError: The records have another start.
    """
    start = record.trajectory.positions[0]
    for other in others:
        there = other.trajectory.positions[0]
        if there.shape != start.shape or np.abs(there - start).max() > 1e-6:
            raise UserError(f'{record.name} {record.index}: its floor has another start')
    found = worst([measure(other.trajectory, record, steps) for other in others])
    names = (*_ERRORS, *(f'{key}_{h}' for key in _HORIZON_ERRORS for h in HORIZONS))
    return {name: found.get(name) for name in names}


def least_floors(names: Iterable[str], record: Record) -> Values:
    """Least floors by `least_` and the name of the error, see `chaos_floor.least_floor`."""
    radius = record.scene.per_sphere('radius', record.trajectory.count)
    bounds = {f'least_{name}': least_floor(name, radius) for name in names}
    return {name: bound for name, bound in bounds.items() if bound is not None}


def columns(rows: Sequence[Mapping[str, float | None]]) -> Columns:
    """Values of several rollouts by name, None where a rollout has no such value."""
    names = {name: None for row in rows for name in row}
    return {name: [row.get(name) for row in rows] for name in names}


def describe(records: Sequence[Record]) -> dict[str, Any]:
    """Names of the records, and their numbers of spheres, for the columns."""
    return {
        'records': [record.name for record in records],
        'spheres': [record.trajectory.count for record in records],
    }
