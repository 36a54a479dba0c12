"""The whole future from a frame, computed a little at a time; only the newest frame counts.

No ROS in here, and no thread: docs/decisions.md says why.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from rigid_gns_core.state import Array, State

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
        self._states: list[State] = []
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
        """Compute for `budget` [s], and one model step at least; the future, where it is ready."""
        begun = time.perf_counter()
        if self._job is None:
            make, self._waiting = self._waiting, None
            self._job = make() if make else None
            if self._job is None:
                return None
            self._states, self._took = [self._job.rollout.state], 0.0
        job, states, error = self._job, self._states, ''
        while len(states) <= job.steps:
            try:
                state = job.rollout.step()
            except FloatingPointError as diverged:
                error = str(diverged)
            else:
                if not np.isfinite(state.positions).all():
                    error = 'a predicted position is not finite'
            if error:
                break
            states.append(state)
            if len(states) <= job.steps and time.perf_counter() - begun >= budget:
                self._took += time.perf_counter() - begun
                return None
        self._job = None
        future = _future(job, states, error)
        return replace(future, took=self._took + time.perf_counter() - begun)


def _future(job: Job, states: list[State], error: str) -> Future:
    poses = _stack(states, 'positions', 'quaternions')
    twists = _stack(states, 'velocities', 'angular_velocities')
    times = [round(step * job.rollout.dt * 1e9) for step in range(len(states))]
    names = [f'sphere_{sphere}' for sphere in job.ids]
    cdr = encode_trajectory(job.stamp_ns, job.frame_id, names, times, poses, twists)
    return Future(job, cdr, poses[:, :, :3], 0.0, error)


def _stack(states: list[State], *names: str) -> Array:
    return np.stack(
        [np.concatenate([getattr(state, name) for name in names], axis=1) for state in states]
    )
