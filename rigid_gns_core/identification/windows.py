# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Short rollouts from tracked poses, and how far they end from what was tracked."""

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

# what the best materials leave of an error, in radii and radians: the model is not the world
_MODEL_ERROR = 5e-3


@dataclass(frozen=True)
class Window:
    """A start from tracked poses, and the poses tracked after it.

    Args:
        scene: Of the record, with the materials it was recorded with.
        start: Tracked poses, velocities from the frames before and after.
        positions: Tracked after the start [m], shape (steps, n, 3).
        quaternions: The same, shape (steps, n, 4).
        place_weights: One over the standard deviation of an error of position [1/m], shape (steps,
            n); 0 where a start is not to be trusted.
        turn_weights: One over that of a rotation [1/rad], shape (steps, n); 0 also where rotations
            are not tracked, or too fast to be.
    """

    scene: Scene
    start: State
    positions: Array
    quaternions: Array
    place_weights: Array
    turn_weights: Array


def windows_of(records: Sequence[Record], steps: int) -> list[Window]:
    """Windows of all records, none of which share a tracked frame after their starts.

    Left out are those in which no sphere's start can be trusted.

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
            places, turns = _weights(record, starts.trusted[frame], quaternions, noise)
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
                    places,
                    turns,
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
    """Noise of the poses of all records."""
    return estimate_noise(
        [(r.trajectory.times, r.trajectory.positions, r.trajectory.quaternions) for r in records]
    )


def with_materials(scene: Scene, values: dict[str, float]) -> Scene:
    """Return the scene with other materials, the same for all spheres.

    Args:
        scene: A surface without a value of its own has that of the spheres.
        values: By name; `surface_restitution` and `surface_friction` are those of all surfaces.
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

    A rollout that diverged is a million off.
    """
    steps = len(window.positions)
    start = window.start
    with warnings.catch_warnings():
        # materials tried on the way may be beyond the trained ones
        warnings.simplefilter('ignore')
        predicted = simulator.rollout(
            with_materials(window.scene, values),
            start.positions,
            start.velocities,
            start.angular_velocities,
            steps,
            quaternions=start.quaternions,
        )
    places = predicted.positions[1:] - window.positions
    turns = rotation_between(window.quaternions, predicted.quaternions[1:])
    return tuple(np.nan_to_num(errors, nan=1e6) for errors in (places, turns))


def residuals(simulator: Simulator, window: Window, values: dict[str, float]) -> Array:
    """Errors in standard deviations, shape (steps * n * 6,), 0 where they do not count."""
    places, turns = deviations(simulator, window, values)
    weighted = [places * window.place_weights[..., None], turns * window.turn_weights[..., None]]
    return np.concatenate([errors.ravel() for errors in weighted])


def _weights(
    record: Record, trusted: Array, quaternions: Array, noise: PoseNoise
) -> tuple[Array, Array]:
    """Weights of positions and rotations, each of shape (steps, n)."""
    steps = len(quaternions) - 1
    passed = np.arange(1, steps + 1)[:, None]
    # noise of the pose, of the start, and of the start's velocity over the steps since
    growth = np.sqrt(2.0 + 0.5 * passed**2)
    radius = record.scene.per_sphere('radius', record.trajectory.count)
    place = np.hypot(noise.position * growth, _MODEL_ERROR * radius * passed)
    if noise.rotation is None or not rotates(record.trajectory.quaternions):
        return trusted / place, np.zeros_like(trusted / place)
    turn = np.hypot(noise.rotation * growth, _MODEL_ERROR * passed)
    turned = np.linalg.norm(rotation_between(quaternions[:-1], quaternions[1:]), axis=-1)
    slow = np.cumprod(turned < HALF_TURN, axis=0)
    return trusted / place, trusted * slow / turn
