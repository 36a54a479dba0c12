# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A report of the scores of a prediction against a reference, and summaries of reports."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from . import divergence, error_metrics, horizon_metrics, HORIZONS, law_metrics
from .error import check_comparable
from .penetration import TOLERANCE
from ..errors import UserError
from ..scenes.scene import Scene
from ..scenes.state import Trajectory

Velocities = Literal['given', 'poses']


def evaluate(
    predicted: Trajectory,
    reference: Trajectory,
    scene: Scene,
    *,
    horizons: Iterable[int] = HORIZONS,
    velocities: Velocities = 'given',
) -> dict[str, Any]:
    """Score a prediction: laws of physics for both trajectories, and errors.

    Where one trajectory is longer, the end of it is left out.

    Args:
        predicted: The rollout to score.
        reference: The truth, with the same time step and spheres.
        scene: Surfaces and sphere properties of both.
        horizons: Steps at which errors are reported; those after the end are left out.
        velocities: 'poses': replace those of both by backward differences of the poses (thesis
            section 3.3) first, so that energies of a recording and of an engine compare.

    Returns:
        `laws` with `predicted` and `reference` (see `law_metrics`), `errors` (see
        `error_metrics`), `horizons` by step (see `horizon_metrics`), `diverged_at` with the step
        or None of each side, and `steps`, `dt` [s], `spheres`, `velocities`, `tolerance`.

    Raises:
        UserError: The two differ in time step or spheres, or have no spheres.
    """
    if velocities not in ('given', 'poses'):
        raise UserError(f"velocities is {velocities!r}, expected 'given' or 'poses'")
    frames = min(len(predicted), len(reference))
    predicted, reference = predicted.window(0, frames), reference.window(0, frames)
    check_comparable(predicted, reference)
    if velocities == 'poses':
        predicted, reference = _from_poses(predicted), _from_poses(reference)
    sides = {'predicted': predicted, 'reference': reference}
    steps = horizon_metrics(predicted, reference, scene, horizons)
    return {
        'steps': frames - 1,
        'dt': reference.dt,
        'spheres': reference.count,
        'velocities': velocities,
        'tolerance': TOLERANCE,
        'diverged_at': {side: divergence(t, scene) for side, t in sides.items()},
        'laws': {side: law_metrics(t, scene) for side, t in sides.items()},
        'errors': error_metrics(predicted, reference, scene),
        'horizons': {str(step): values for step, values in steps.items()},
    }


def summarise(reports: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Mean and standard deviation over reports of `evaluate`, in the same nesting.

    A number becomes `mean`, `std` (of the population), `count`, and `infinite`, how many were.
    Where some were, mean and std are infinite too, and `finite_mean`, `finite_std` are of the
    rest. A number that not all reports have is summarised over those that have it.

    Raises:
        UserError: There are no reports.
    """
    if not reports:
        raise UserError('there are no reports to summarise; evaluate at least one trajectory')
    sides = ('predicted', 'reference')
    summary: dict[str, Any] = {
        'reports': len(reports),
        'diverged_at': {
            side: {
                'diverged': sum(r['diverged_at'][side] is not None for r in reports),
                'count': len(reports),
            }
            for side in sides
        },
        'laws': {side: _summarise([r['laws'][side] for r in reports]) for side in sides},
        'errors': _summarise([r['errors'] for r in reports]),
    }
    horizons = {step: None for report in reports for step in report['horizons']}
    summary['horizons'] = {}
    for step in sorted(horizons, key=int):
        having = [r['horizons'][step] for r in reports if step in r['horizons']]
        values = _summarise(having)
        summary['horizons'][step] = values | {'time': values['time']['mean']}
    return summary


def _from_poses(trajectory: Trajectory) -> Trajectory:
    with np.errstate(invalid='ignore', over='ignore'):
        return Trajectory.from_poses(trajectory.positions, trajectory.quaternions, trajectory.dt)


def _summarise(mappings: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    keys = {key: None for mapping in mappings for key in mapping}
    summary = {}
    for key in keys:
        values = np.array([mapping[key] for mapping in mappings if key in mapping], dtype=float)
        finite = values[np.isfinite(values)]
        entry: dict[str, float] = {
            'mean': float('inf'),
            'std': float('inf'),
            'count': len(values),
            'infinite': len(values) - len(finite),
        }
        prefixes = ('', 'finite_') if len(finite) == len(values) else ('finite_',)
        for prefix in prefixes if len(finite) else ():
            entry[f'{prefix}mean'] = float(finite.mean())
            entry[f'{prefix}std'] = float(finite.std())
        summary[key] = entry
    return summary
