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

"""The whole future from a frame, computed a little at a time; only the newest frame counts.

No ROS in here, and no thread: docs/decisions.md says why.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
import time
from typing import TYPE_CHECKING

import numpy as np
from rigid_gns_core.state import Array, State
from rigid_gns_core.stepper import stacked

from ..encoding.trajectory_message import encode_trajectory

if TYPE_CHECKING:
    from rigid_gns_core.rollout import Rollout


@dataclass(frozen=True)
class Job:
    """A future to compute.

    Args:
        rollout: The model's rollout, at its start; used by nobody else.
        stamp_ns: Stamp of the start frame [ns].
        steps: Steps of the model.
        frame_id: Coordinate frame.
        ids: Id of each sphere.
    """

    rollout: Rollout
    stamp_ns: int
    steps: int
    frame_id: str
    ids: tuple[int, ...]


@dataclass(frozen=True)
class Future:
    """What a job gave.

    Args:
        job: The job.
        cdr: trajectory_msgs/MultiDOFJointTrajectory; its first point is the start.
        positions: Centres [m] of start and steps, shape (points, n, 3).
        took: Time spent on it [s].
        error: Why it ends before its time, or ''.
    """

    job: Job
    cdr: bytes
    positions: Array
    took: float
    error: str


def steps_of(horizon: float, dt: float) -> int:
    """Least number of model steps of `dt` [s] that reach `horizon` [s]."""
    return int(np.ceil(horizon / dt - 1e-9))


class Horizon:
    """Computes one future at a time, and then the newest that was asked for."""

    def __init__(self) -> None:
        self._waiting: Callable[[], Job | None] | None = None
        self._job: Job | None = None
        self._blocks: list[State] = []  # states that are stacked
        self._took = 0.0

    @property
    def busy(self) -> bool:
        """Whether there is something to compute."""
        return self._job is not None or self._waiting is not None

    def request(self, make: Callable[[], Job | None]) -> bool:
        """Ask for a future. False where an older one that waited is dropped for it.

        Args:
            make: Makes the job when its turn comes, as to begin takes milliseconds that would be
                lost for one that is dropped; None: there is no future.
        """
        superseded, self._waiting = self._waiting is not None, make
        return not superseded

    def cancel(self) -> None:
        """Drop what waits and what is computed."""
        self._waiting = self._job = None

    def work(self, budget: float) -> Future | None:
        """Compute for about `budget` [s], and one step at least; the future, where it is ready."""
        begun = time.perf_counter()
        if self._job is None:
            make, self._waiting = self._waiting, None
            self._job = make() if make else None
            if self._job is None:
                return None
            self._blocks, self._took = [stacked([self._job.rollout.state])], 0.0
        job, error = self._job, ''
        steps = 1  # of which the first tell how long one takes
        while job.rollout.steps < job.steps:
            turn = time.perf_counter()
            block = job.rollout.advance(min(steps, job.steps - job.rollout.steps))
            if len(block.states):
                self._blocks.append(block.states)
            if error := block.error:
                break
            now = time.perf_counter()
            left = budget - (now - begun)
            if left <= 0 and job.rollout.steps < job.steps:
                self._took += now - begun
                return None
            steps = max(1, int(left / (now - turn) * steps))
        self._job = None
        future = _future(job, self._blocks, error)
        return replace(future, took=self._took + time.perf_counter() - begun)


def _future(job: Job, blocks: list[State], error: str) -> Future:
    poses = _joined(blocks, 'positions', 'quaternions')
    twists = _joined(blocks, 'velocities', 'angular_velocities')
    times = [round(step * job.rollout.dt * 1e9) for step in range(len(poses))]
    names = [f'sphere_{sphere}' for sphere in job.ids]
    cdr = encode_trajectory(job.stamp_ns, job.frame_id, names, times, poses, twists)
    return Future(job, cdr, poses[:, :, :3], 0.0, error)


def _joined(blocks: list[State], *names: str) -> Array:
    fields = [np.concatenate([getattr(block, name) for block in blocks]) for name in names]
    return np.concatenate(fields, axis=2)
