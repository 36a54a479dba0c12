# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a node says of how sure a future is: deviations, branches, and crossings of planes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
import json
from typing import Any

import numpy as np

from ..messages.covariances import encode_pose_with_covariance, encode_twist_with_covariance
from ..messages.trajectories import TrajectoryCodec
from ..rollout.crossing import Branch, Crossing
from ..rollout.forecast import drawn_starts, Estimate, Forecast
from ..rollout.simulator import Simulator
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array, State

LIKELY = 0.5
"""Probability from which on a sphere is said to cross."""
_SEED = 0  # of the draws
# branches less likely than this are not told
_LEAST = 0.02


@dataclass(frozen=True)
class SpreadJob:
    """What the spread of a future is computed from.

    Args:
        simulator: Model.
        scene: Surfaces and spheres.
        estimate: State at the start, with its covariance.
        samples: Number of states drawn; 0: the state alone.
        planes: Planes of interest by name.
        ids: Id of each sphere.
        stamp_ns: Stamp of the start [ns].
        frame_id: Coordinate frame.
    """

    simulator: Simulator
    scene: Scene
    estimate: Estimate
    samples: int
    planes: Mapping[str, Plane]
    ids: tuple[int, ...]
    stamp_ns: int
    frame_id: str

    @property
    def start(self) -> State | Estimate:
        """The estimate, or its state alone where none are drawn."""
        return self.estimate if self.samples else self.estimate.state


@dataclass(frozen=True)
class Spread:
    """How sure a future is; messages as CDR bytes.

    Args:
        deviations: trajectory_msgs/MultiDOFJointTrajectory, see docs/node.md; None: no samples.
        crossings: geometry_msgs/PoseWithCovarianceStamped and TwistWithCovarianceStamped of each
            sphere that will cross a plane.
        told: Content of ~/crossings; None: no planes.
        branches: Content of ~/branches; None: no samples.
        covariance: Of the positions [m^2], shape (points, n, 3, 3); None: no samples.
        paths: Mean centres in the branches of each sphere [m], shape (points, 3) each, and their
            probabilities, of spheres that have several.
    """

    deviations: bytes | None
    crossings: tuple[tuple[bytes, bytes], ...]
    told: dict[str, Any] | None
    branches: dict[str, Any] | None
    covariance: Array | None
    paths: tuple[tuple[Array, float], ...]


def drawn_rollouts(job: SpreadJob, steps: int) -> State:
    """Rollouts of the estimate and of draws, fields of shape (1 + samples, steps + 1, n, k)."""
    starts = drawn_starts(job.start, job.samples, _SEED)
    return job.simulator.rollout_samples(job.scene, starts, steps)


def spread_of_future(job: SpreadJob, drawn: State, points: int, dt: float) -> Spread:
    """Spread of a future.

    Args:
        job: What it is of.
        drawn: See `drawn_rollouts`.
        points: So many of their states count; the first is the start.
        dt: Time between two [s].
    """
    times: Array = dt * np.arange(points, dtype=np.float64)
    states = State.unchecked(*(values[:, :points] for values in vars(drawn).values()))
    given = job.scene, job.start, times, job.samples, _SEED
    forecast = job.simulator.forecast_from(states, *given)
    crossings: list[tuple[bytes, bytes]] = []
    told: dict[str, Any] = {}
    for name, plane in job.planes.items():
        found = forecast.crossing(plane)
        shares = found.probability.tolist()
        told[name] = [_told(job, found, k) for k, share in enumerate(shares) if share > 0.0]
        likely = [k for k, share in enumerate(shares) if share >= LIKELY]
        crossings += [_messages(job, found, k) for k in likely]
    head = {'stamp_ns': job.stamp_ns, 'horizon': float(times[-1])}
    if not job.samples:
        planes = {**head, 'planes': told} if job.planes else None
        return Spread(None, tuple(crossings), planes, None, None, ())
    split = [
        [branch for branch in forecast.branches(k) if branch.probability >= _LEAST]
        if forecast.splits(k)
        else []
        for k in range(len(job.ids))
    ]
    spheres = [
        {
            'sphere': int(sphere),
            'branches': [
                {
                    'probability': branch.probability,
                    'touched': list(branch.touched),
                    'end': _numbers(branch.positions[-1]),
                    'end_deviation': _numbers(np.sqrt(np.diagonal(branch.covariance[-1]))),
                }
                for branch in own
            ],
        }
        for sphere, own in zip(job.ids, split, strict=True)
        if own
    ]
    return Spread(
        _deviations(job, forecast, times, dt),
        tuple(crossings),
        {**head, 'planes': told} if job.planes else None,
        {**head, 'spheres': spheres},
        forecast.covariance,
        tuple((branch.positions, branch.probability) for own in split for branch in own),
    )


def _deviations(job: SpreadJob, forecast: Forecast, times: Array, dt: float) -> bytes:
    """Message of deviations and correlations of positions, and deviations of velocities."""
    variances = np.diagonal(forecast.covariance, axis1=2, axis2=3)
    deviations = np.sqrt(variances)
    pairs = deviations[..., [0, 0, 1]] * deviations[..., [1, 2, 2]]
    correlations = forecast.covariance[..., [0, 0, 1], [1, 2, 2]] / np.maximum(pairs, 1e-300)
    of_velocity = forecast.paths.velocities[:, : len(times)].std(axis=0, ddof=1)
    unit = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*deviations.shape[:2], 4))
    return codec_of(job.frame_id, job.ids, len(times), dt).encode(
        job.stamp_ns,
        np.concatenate([deviations, unit], axis=2),
        np.concatenate([of_velocity, correlations], axis=2),
    )


@lru_cache(maxsize=8)
def codec_of(frame_id: str, ids: tuple[int, ...], points: int, dt: float) -> TrajectoryCodec:
    """Encoder of futures of some spheres, in points that are `dt` [s] apart."""
    names = [f'sphere_{sphere}' for sphere in ids]
    return TrajectoryCodec(frame_id, names, [round(step * dt * 1e9) for step in range(points)])


def _messages(job: SpreadJob, found: Crossing, k: int) -> tuple[bytes, bytes]:
    stamp = job.stamp_ns + round(float(found.time[k]) * 1e9)
    place, speed = found.position_covariance[k], found.velocity_covariance[k]
    return (
        encode_pose_with_covariance(stamp, job.frame_id, found.position[k], place),
        encode_twist_with_covariance(stamp, job.frame_id, found.velocity[k], speed),
    )


def _told(job: SpreadJob, found: Crossing, k: int) -> dict[str, Any]:
    time = float(found.time[k])
    return {
        'sphere': int(job.ids[k]),
        'probability': float(found.probability[k]),
        'stamp_ns': job.stamp_ns + round(time * 1e9),
        'time': time,
        'time_deviation': float(np.sqrt(found.time_variance[k])),
        'position': _numbers(found.position[k]),
        'position_deviation': _numbers(np.sqrt(np.diagonal(found.position_covariance[k]))),
        'velocity': _numbers(found.velocity[k]),
        'velocity_deviation': _numbers(np.sqrt(np.diagonal(found.velocity_covariance[k]))),
        'branches': [_branch(one) for one in found.branches[k] if one.probability >= _LEAST],
    }


def _branch(branch: Branch) -> dict[str, Any]:
    return {
        'probability': branch.probability,
        'touched': list(branch.touched),
        'time': branch.time,
        'position': _numbers(branch.position),
        'velocity': _numbers(branch.velocity),
    }


def _numbers(values: Array) -> list[float]:
    return [float(value) for value in values]


def text_of(content: Mapping[str, Any]) -> str:
    """Text of ~/crossings and ~/branches; null where a number is not known."""
    try:
        return json.dumps(content, allow_nan=False)
    except ValueError:
        return json.dumps(_finite(content))


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(one) for key, one in value.items()}
    return [_finite(one) for one in value] if isinstance(value, list) else value
