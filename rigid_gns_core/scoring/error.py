# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of a predicted trajectory against a reference."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.spatial import cKDTree

from .motion import divergence
from ..errors import UserError
from ..scenes.scene import Scene
from ..scenes.state import Array, rotation_between, Trajectory

HORIZONS = (10, 30, 50, 100)
"""Steps at which short-horizon errors are reported."""


def error_metrics(
    predicted: Trajectory, reference: Trajectory, scene: Scene | None = None
) -> dict[str, float]:
    """Errors over the whole rollout, the mean over all its frames, 0 to K.

    Args:
        predicted: The rollout to score.
        reference: The truth, with the same time step, steps and spheres.
        scene: Radii, for the predictability time and resting spheres. None: radius 1 m.

    Returns:
        `mse` [m^2], `chamfer` [m^2], `position_error` [m], `velocity_error` [m/s], `spin_error`
        [rad/s], `rotation_error` [rad]: infinite where either trajectory diverged.
        `predictability_time` [s]: when the median sphere is first further than half a radius
        off; the length of the rollout where that never happens, and then `predictable_to_end` is
        1, else 0. `resting_spheres` [%]: those that the reference keeps within 0.01 radii of
        their start, and, where there are any, `resting_drift` [m]: how far the prediction takes
        them from their start, the farthest of all frames, mean over those spheres.

    Raises:
        UserError: The trajectories differ in time step, steps or spheres, or have no spheres.
    """
    check_comparable(predicted, reference)
    scene = Scene() if scene is None else scene
    radius = scene.per_sphere('radius', reference.count)
    lost = _first_divergence(predicted, reference, scene)
    with np.errstate(over='ignore', invalid='ignore'):
        distance = np.linalg.norm(predicted.positions - reference.positions, axis=2)
        wander = np.linalg.norm(predicted.positions - predicted.positions[0], axis=2).max(axis=0)
    if lost is not None:
        metrics = dict.fromkeys(
            ('mse', 'chamfer', 'position_error', 'velocity_error', 'spin_error', 'rotation_error'),
            float('inf'),
        )
    else:
        metrics = {
            'mse': position_mse(predicted.positions, reference.positions),
            'chamfer': chamfer(predicted.positions, reference.positions),
            'position_error': float(distance.mean()),
            **_rate_errors(predicted, reference),
        }
    # the part before a divergence is enough: from there on the error is over the bound
    far = np.median(distance[:lost] / radius, axis=1) > 0.5
    end = len(distance) if lost is None else lost
    first = int(np.argmax(far)) if far.any() else end
    metrics['predictability_time'] = min(first, reference.steps) * reference.dt
    metrics['predictable_to_end'] = float(first == len(distance))
    path = np.linalg.norm(reference.positions - reference.positions[0], axis=2)
    resting = (path <= 0.01 * radius).all(axis=0)
    metrics['resting_spheres'] = 100.0 * float(resting.mean())
    if resting.any():
        metrics['resting_drift'] = float(wander[resting].mean()) if lost is None else float('inf')
    return metrics


def horizon_metrics(
    predicted: Trajectory,
    reference: Trajectory,
    scene: Scene | None = None,
    horizons: Iterable[int] = HORIZONS,
) -> dict[int, dict[str, float]]:
    """Errors at single steps, mean over the spheres; steps after the end are left out.

    Returns:
        For each step: `time` [s], `position_error` [m], `mse` [m^2], `velocity_error` [m/s],
        `spin_error` [rad/s], `rotation_error` [rad]; errors infinite from a divergence on.
    """
    check_comparable(predicted, reference)
    lost = _first_divergence(predicted, reference, Scene() if scene is None else scene)
    result = {}
    for step in sorted(h for h in set(horizons) if 0 <= h <= reference.steps):
        ours, theirs = predicted.window(step, step + 1), reference.window(step, step + 1)
        if lost is not None and step >= lost:
            names = ('position_error', 'mse', 'velocity_error', 'spin_error', 'rotation_error')
            errors = dict.fromkeys(names, float('inf'))
        else:
            distance = np.linalg.norm(ours.positions - theirs.positions, axis=2)
            errors = {
                'position_error': float(distance.mean()),
                'mse': float(np.mean(distance**2)),
                **_rate_errors(ours, theirs),
            }
        result[step] = {'time': step * reference.dt, **errors}
    return result


def position_mse(predicted: Array, reference: Array) -> float:
    """MSE of the thesis: mean over frames and spheres of |p - p'|^2 [m^2].

    Args:
        predicted: Centres [m], shape (frames, n, 3).
        reference: Centres [m], shape (frames, n, 3).
    """
    difference = np.asarray(predicted) - np.asarray(reference)
    spheres = len(difference) * difference.shape[1]
    return float(np.einsum('knc,knc->', difference, difference) / spheres)


def chamfer(predicted: Array, reference: Array) -> float:
    """Symmetric Chamfer distance of the thesis, mean over frames [m^2].

    In each frame, the mean squared distance of each centre to the nearest centre of the other set,
    summed over both directions.

    Args:
        predicted: Centres [m], shape (frames, n, 3).
        reference: Centres [m], shape (frames, n', 3).
    """
    total = 0.0
    for ours, theirs in zip(predicted, reference, strict=True):
        there, _ = cKDTree(theirs).query(ours)
        back, _ = cKDTree(ours).query(theirs)
        total += float(np.mean(np.square(there)) + np.mean(np.square(back)))
    return total / len(predicted)


def check_comparable(predicted: Trajectory, reference: Trajectory) -> None:
    """Raise UserError where two trajectories cannot be compared frame by frame."""
    if reference.count == 0:
        raise UserError('the trajectories have no spheres, so there is nothing to compare')
    if predicted.positions.shape != reference.positions.shape:
        raise UserError(
            f'predicted has {predicted.steps} steps of {predicted.count} spheres, reference '
            f'{reference.steps} of {reference.count}; cut both to the same steps and spheres'
        )
    if abs(predicted.dt - reference.dt) > 1e-6 * reference.dt:
        raise UserError(
            f'predicted has dt {predicted.dt:g} s, reference {reference.dt:g} s; '
            'resample one of them to the time step of the other'
        )


def _rate_errors(predicted: Trajectory, reference: Trajectory) -> dict[str, float]:
    def mean_norm(difference: Array) -> float:
        return float(np.linalg.norm(difference, axis=-1).mean())

    return {
        'velocity_error': mean_norm(predicted.velocities - reference.velocities),
        'spin_error': mean_norm(predicted.angular_velocities - reference.angular_velocities),
        'rotation_error': mean_norm(
            rotation_between(reference.quaternions, predicted.quaternions)
        ),
    }


def _first_divergence(predicted: Trajectory, reference: Trajectory, scene: Scene) -> int | None:
    steps = (divergence(predicted, scene), divergence(reference, scene))
    return min((step for step in steps if step is not None), default=None)
