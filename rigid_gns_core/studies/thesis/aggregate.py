# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Aggregation of cells: mean and standard deviation over seeds, and diverged rollouts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .budget import Budget
from .cell import Cell, cells_of, Store, teacher_cells
from .experiments import Experiment, SETS, Variant
from ..chaos_floor import over_floor

Result = Mapping[str, Any]
Statistic = dict[str, float | int | None]
MEDIANS = ('energy_gain', 'mse', 'mse_ratio', 'chamfer', 'chamfer_ratio', 'predictability_time')
"""Metrics also given as a median: a single rollout can dominate their mean."""


def make_table(
    experiment: Experiment, budget: Budget, seeds: Sequence[int], store: Store
) -> dict[str, Any]:
    """Aggregate the finished cells of an experiment.

    Metrics of a whole rollout (laws, `mse`, `chamfer`) are infinite where it diverged. Those up to
    a step (`position_error_10`) are infinite only if it diverged before; `predictability_time` and
    `escaped` stay finite. Means are over finite values, and so leave diverged rollouts out of the
    first kind only. Medians (`MEDIANS`) include infinite values.

    Returns:
        `rows`, one for each variant, with `missing` seeds and, by set and steps, `diverged` of
        `rollouts`, and `metrics` with `mean` and `std` over seeds (n - 1) of the mean over
        rollouts, or of the median in `mse_median` and so on; and `floor`, the teacher at other
        substeps.
    """
    table: dict[str, Any] = {
        'experiment': experiment.name,
        'title': experiment.title,
        'source': experiment.source,
        'claim': experiment.claim,
        'kind': experiment.kind,
        'axis': experiment.axis,
        'metrics': list(experiment.metrics),
        'steps': {
            'test': budget.long_steps if experiment.long else budget.steps,
            'ood': budget.long_steps,
        },
        'budget': {'name': budget.name, 'words': budget.words},
        'seeds': list(seeds),
    }
    if experiment.kind == 'speed':
        return table | {'rows': _speed_rows(experiment, budget, store)}
    teachers = {cell.name: store.read(cell) for cell in teacher_cells(budget)}
    if experiment.kind == 'teacher':
        rows = [_teacher_row(v, teachers.get(v.name)) for v in experiment.variants]
        return table | {'rows': rows}
    floors = {name: None if t is None else t['floor'] for name, t in teachers.items()}
    rows = [_row(v, cells, floors, store) for v, cells in _by_variant(experiment, budget, seeds)]
    floor = {name: _floor_row(value) for name, value in floors.items() if value is not None}
    return table | {'rows': rows, 'floor': floor}


def _by_variant(
    experiment: Experiment, budget: Budget, seeds: Sequence[int]
) -> list[tuple[Variant, list[Cell]]]:
    return [
        (v, [c for c in cells_of(experiment, budget, [v], seeds) if c.kind == 'train'])
        for v in experiment.variants
    ]


def _row(
    variant: Variant, cells: Sequence[Cell], floors: Mapping[str, Any], store: Store
) -> dict[str, Any]:
    results = {cell.seed: store.read(cell) for cell in cells}
    done = {seed: result for seed, result in results.items() if result is not None}
    trained = [r for r in done.values() if r['training']['failed'] is None]
    sets: dict[str, Any] = {}
    for which in SETS:
        if which not in floors:
            continue
        for steps in sorted({str(s) for cell in cells for s in cell.steps(which)}, key=int):
            measured = [r['measures'][which][steps] for r in trained if which in r['measures']]
            if measured:
                floor = floors[which][steps] if floors[which] is not None else None
                sets.setdefault(which, {})[steps] = _score(measured, floor)
    return {
        'variant': variant.name,
        'label': variant.label,
        'x': variant.x,
        'seeds': sorted(done),
        'missing': sorted(set(results) - set(done)),
        'untrainable': len(done) - len(trained),
        'keys': [cell.key for cell in cells],
        'minutes': [m for r in done.values() if (m := _minutes(r)) is not None],
        'sets': sets,
        'thesis': variant.thesis,
    }


def _score(measured: Sequence[Result], floor: Result | None) -> dict[str, Any]:
    """Statistics over seeds of the metrics of rollouts, and of their ratios to the floor."""
    lost = [step for columns in measured for step in columns['diverged_at']]
    names = [name for name in measured[0] if name != 'diverged_at']
    seeds = {name: [columns[name] for columns in measured] for name in names}
    for name in names:
        if floor is not None and f'least_{name}' in floor:
            bounds = floor[name], floor[f'least_{name}']
            seeds[f'{name}_ratio'] = [
                [over_floor(*one) for one in zip(values, *bounds, strict=True)]
                for values in seeds[name]
            ]
    metrics = {name: _statistic(values) for name, values in seeds.items()}
    metrics |= {f'{k}_median': _median(values) for k, values in seeds.items() if k in MEDIANS}
    known = {name: value for name, value in metrics.items() if value is not None}
    return {
        'diverged': sum(step is not None for step in lost),
        'rollouts': len(lost),
        'metrics': known,
    }


def _statistic(seeds: Sequence[Sequence[float | None]]) -> Statistic | None:
    """Statistic over seeds of the means of finite values; None: there are no values."""
    known = [[v for v in values if v is not None] for values in seeds]
    finite = [[v for v in values if np.isfinite(v)] for values in known]
    if not any(known):
        return None
    means = [float(np.mean(values)) for values in finite if values]
    return {
        'mean': float(np.mean(means)) if means else None,
        'std': float(np.std(means, ddof=1)) if len(means) > 1 else None,
        'seeds': len(means),
        'infinite': sum(len(k) - len(f) for k, f in zip(known, finite, strict=True)),
    }


def _median(seeds: Sequence[Sequence[float | None]]) -> Statistic | None:
    """Statistic over seeds of the medians over rollouts, infinite where one of them is."""
    known = [[v for v in values if v is not None] for values in seeds]
    medians = [float(np.median(values)) for values in known if values]
    if not medians:
        return None
    finite = bool(np.all(np.isfinite(medians)))
    return {
        'mean': float(np.mean(medians)),
        'std': float(np.std(medians, ddof=1)) if finite and len(medians) > 1 else None,
        'seeds': len(medians),
    }


def _floor_row(floor: Result) -> dict[str, Any]:
    """Mean of the floor over rollouts by steps, with the median for `MEDIANS`."""
    rows = {}
    for steps, columns in floor.items():
        if steps.isdecimal():
            found = {k: _statistic([v]) for k, v in columns.items()}
            medians = [k for k in columns if k.removeprefix('least_') in MEDIANS]
            found |= {f'{k}_median': _median([columns[k]]) for k in medians}
            rows[steps] = {k: v['mean'] for k, v in found.items() if v is not None}
    return rows


def _minutes(result: Result) -> float | None:
    """Wall-clock time of a cell [min]; None where that of its first steps is unknown."""
    seconds = result['seconds']
    # some were added up over several processes, from a step that they tell
    begin = seconds.get('counted_from_step', seconds.get('resumed_at_step', 0))
    return seconds['all'] / 60 if begin == 0 else None


def _teacher_row(variant: Variant, result: Result | None) -> dict[str, Any]:
    """Laws of a set: mean and standard deviation over trajectories, by kind of velocities."""
    row: dict[str, Any] = {
        'variant': variant.name,
        'label': variant.label,
        'missing': [0] if result is None else [],
        'thesis': variant.thesis,
        'laws': {},
    }
    if result is not None:
        for velocities, measured in result['laws'].items():
            steps = max((key for key in measured if key.isdecimal()), key=int)
            columns = measured[steps]
            row['steps'] = int(steps)
            row['laws'][velocities] = {
                name: _over_rollouts(values)
                for name, values in columns.items()
                if name != 'diverged_at' and any(v is not None for v in values)
            }
        row['spheres'] = result['laws']['poses']['spheres']
    return row


def _speed_rows(experiment: Experiment, budget: Budget, store: Store) -> list[dict[str, Any]]:
    rows = []
    for variant in experiment.variants:
        (cell,) = cells_of(experiment, budget, [variant], [0])
        result = store.read(cell)
        row = {
            'variant': variant.name,
            'label': variant.label,
            'x': variant.x,
            'missing': [0] if result is None else [],
            'thesis': variant.thesis,
        }
        if result is not None:
            values = {k: _over_rollouts(v) for k, v in result['values'].items()}
            # of all frames together: in a mean of rates, records of few spheres would dominate
            rate = 1.0 / float(np.mean(result['values']['seconds_per_frame']))
            values['frames_per_second'] = {'mean': rate, 'std': None, 'count': 1}
            row |= {
                'width': budget.speed_width,
                'spheres': float(np.mean(result['spheres'])),
                'cpu': result['cpu'],
                'values': values,
            }
        rows.append(row)
    return rows


def _over_rollouts(values: Sequence[float | None]) -> Statistic:
    finite = [v for v in values if v is not None and np.isfinite(v)]
    return {
        'mean': float(np.mean(finite)) if finite else None,
        'std': float(np.std(finite, ddof=1)) if len(finite) > 1 else None,
        'count': len(finite),
    }
