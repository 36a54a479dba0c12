# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Windows of tracked poses, and the residuals of short rollouts from their starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any
import warnings

import numpy as np

from ..data.records import Record
from ..errors import UserError
from ..rollout.simulator import Simulator
from ..scenes.scene import Scene
from ..scenes.state import Array, rotation_between, State
from ..tracking.pose_noise import estimate_noise, HALF_TURN, PoseNoise, rotates, tracked_starts

# process noise: error per step of the model with the best materials [radii, rad]
_MODEL_ERROR = 5e-3


@dataclass(frozen=True)
class Window:
    """A tracked start state, and the poses tracked after it.

    Args:
        scene: Scene of the record, with its materials.
        start: Tracked poses, with velocities by central differences.
        positions: Centres after the start [m], shape (steps, n, 3).
        quaternions: Rotations (x, y, z, w) after the start, shape (steps, n, 4).
        position_weights: Inverse standard deviation of a position error [1/m], shape (steps, n); 0
            where the start is not trusted.
        rotation_weights: Inverse standard deviation of a rotation error [1/rad], shape (steps, n);
            0 also where rotations are not tracked or too fast.
    """

    scene: Scene
    start: State
    positions: Array
    quaternions: Array
    position_weights: Array
    rotation_weights: Array


def windows_of(records: Sequence[Record], steps: int) -> list[Window]:
    """Windows of all records, which share no frames after their starts.

    Windows in which no sphere has a trusted start are left out.

    Raises:
        UserError: There are none.
    """
    noise = noise_of(records)
    found = []
    for record in records:
        trajectory = record.trajectory
        gravity = np.asarray(record.scene.gravity, dtype=np.float64)
        starts = tracked_starts(
            trajectory.positions, trajectory.quaternions, trajectory.dt, gravity, noise
        )
        for frame in range(1, trajectory.steps - steps + 1, steps):
            if not starts.trusted[frame].any():
                continue
            after = slice(frame + 1, frame + 1 + steps)
            quaternions = trajectory.quaternions[frame : frame + 1 + steps]
            position_weights, rotation_weights = _weights(
                record, starts.trusted[frame], quaternions, noise
            )
            start = State(
                positions=trajectory.positions[frame],
                quaternions=trajectory.quaternions[frame],
                velocities=starts.velocities[frame],
                angular_velocities=starts.angular_velocities[frame],
            )
            found.append(
                Window(
                    record.scene,
                    start,
                    trajectory.positions[after],
                    trajectory.quaternions[after],
                    position_weights,
                    rotation_weights,
                )
            )
    if not found:
        longest = max((record.trajectory.steps for record in records), default=0)
        raise UserError(
            f'no window of {steps} steps can be made: the longest of {len(records)} records has '
            f'{longest} steps, and a window needs {steps + 1} and a start without contact; '
            'record for longer, or take shorter windows'
        )
    return found


def noise_of(records: Sequence[Record]) -> PoseNoise:
    """Measurement noise of the poses of all records."""
    return estimate_noise(
        [(r.trajectory.times, r.trajectory.positions, r.trajectory.quaternions) for r in records]
    )


def with_materials(scene: Scene, values: dict[str, float]) -> Scene:
    """The scene with other materials, the same for all spheres.

    Args:
        scene: Scene; a surface without a value of its own takes that of the spheres.
        values: Materials by name; `surface_restitution` and `surface_friction` are of all
            surfaces.
    """
    surfaces = scene.surfaces
    for name in ('restitution', 'friction'):
        if f'surface_{name}' in values:
            own: dict[str, Any] = {name: values[f'surface_{name}']}
            surfaces = tuple(replace(plane, **own) for plane in surfaces)
    spheres: dict[str, Any] = {
        name: value for name, value in values.items() if not name.startswith('surface_')
    }
    return replace(scene, surfaces=surfaces, **spheres)


def deviations(
    simulator: Simulator, window: Window, values: dict[str, float]
) -> tuple[Array, ...]:
    """Errors of position [m] and rotation [rad] of a rollout, each of shape (steps, n, 3).

    Where the rollout diverged they are 1e6.
    """
    steps = len(window.positions)
    with warnings.catch_warnings():
        # materials on the way may lie outside the trained range
        warnings.simplefilter('ignore')
        predicted = simulator.rollout(
            with_materials(window.scene, values), steps=steps, **vars(window.start)
        )
    position_errors = predicted.positions[1:] - window.positions
    rotation_errors = rotation_between(window.quaternions, predicted.quaternions[1:])
    return tuple(np.nan_to_num(errors, nan=1e6) for errors in (position_errors, rotation_errors))


def residuals(simulator: Simulator, window: Window, values: dict[str, float]) -> Array:
    """Weighted errors [standard deviations], shape (steps * n * 6,), 0 where they do not count."""
    position_errors, rotation_errors = deviations(simulator, window, values)
    weighted = [
        position_errors * window.position_weights[..., None],
        rotation_errors * window.rotation_weights[..., None],
    ]
    return np.concatenate([errors.ravel() for errors in weighted])


def _weights(
    record: Record, trusted: Array, quaternions: Array, noise: PoseNoise
) -> tuple[Array, Array]:
    """Weights of positions [1/m] and rotations [1/rad], each of shape (steps, n)."""
    steps = len(quaternions) - 1
    steps_since = np.arange(1, steps + 1)[:, None]
    # noise of the pose, of the start, and of the start's velocity over the steps since
    growth = np.sqrt(2.0 + 0.5 * steps_since**2)
    radius = record.scene.per_sphere('radius', record.trajectory.count)
    position_std = np.hypot(noise.position * growth, _MODEL_ERROR * radius * steps_since)
    if noise.rotation is None or not rotates(record.trajectory.quaternions):
        return trusted / position_std, np.zeros_like(trusted / position_std)
    rotation_std = np.hypot(noise.rotation * growth, _MODEL_ERROR * steps_since)
    turned = np.linalg.norm(rotation_between(quaternions[:-1], quaternions[1:]), axis=-1)
    slow = np.cumprod(turned < HALF_TURN, axis=0)
    return trusted / position_std, trusted * slow / rotation_std
