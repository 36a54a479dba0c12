# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Futures: the predicted trajectory from the newest frame, computed in a thread."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future as Result
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
import threading
import time
from typing import TYPE_CHECKING

import numpy as np

from .spread import Spread, spread_of_future, SpreadJob
from ..messages.trajectories import encode_trajectory
from ..rollout.outcome import Recording
from ..scenes.state import Array

if TYPE_CHECKING:
    from ..rollout.rollout import Rollout


# steps are taken in blocks of about this time, after which a cancelled job ends [s]
BLOCK = 10e-3


@dataclass(frozen=True)
class Job:
    """A predicted trajectory to compute.

    Args:
        rollout: The model's rollout at its start, for this job alone.
        stamp_ns: Stamp of the start frame [ns].
        steps: Number of model steps.
        frame_id: Coordinate frame.
        ids: Id of each sphere.
        spread: What its spread is computed from; None: it is not.
    """

    rollout: Rollout
    stamp_ns: int
    steps: int
    frame_id: str
    ids: tuple[int, ...]
    spread: SpreadJob | None = None


@dataclass(frozen=True)
class Future:
    """A computed trajectory.

    Args:
        job: The job.
        cdr: trajectory_msgs/MultiDOFJointTrajectory, whose first point is the start.
        positions: Centres at the start and after each step [m], shape (points, n, 3).
        took: Time of the computation [s].
        error: Why it ends early; empty: it does not.
        spread: How sure it is; None: that was not asked for.
    """

    job: Job
    cdr: bytes
    positions: Array
    took: float
    error: str
    spread: Spread | None = None


class Horizon:
    """Computes one trajectory at a time in its own thread, then the newest requested one.

    The engine runs without Python's global lock. All methods are called from one thread.

    Args:
        done: Called in the computing thread when `take` may have a result.
    """

    def __init__(self, done: Callable[[], object]) -> None:
        self._done = done
        self._pool = ThreadPoolExecutor(1, thread_name_prefix='future')
        self._waiting: Callable[[], Job | None] | None = None
        self._running: Result[Future | None] | None = None
        self._cancelled = threading.Event()

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._running is not None or self._waiting is not None

    def request(self, make: Callable[[], Job | None]) -> bool:
        """Request a trajectory; False where it replaces an older request that still waited.

        Args:
            make: Makes the job when its turn comes, so that dropped requests cost nothing; returns
                None where there is nothing to compute.
        """
        superseded, self._waiting = self._waiting is not None, make
        self._begin()
        return not superseded

    def take(self) -> Future | None:
        """The result, where it is ready; the waiting job is begun then.

        Raises:
            Exception: What the computation raised; a rollout that diverged does not raise.
        """
        running = self._running
        if running is None or not running.done():
            return None
        self._running = None
        self._begin()
        return running.result()

    def cancel(self) -> None:
        """Drop the waiting and the running job."""
        self._cancelled.set()
        self._waiting = self._running = None
        self._cancelled = threading.Event()  # for later jobs

    def close(self) -> None:
        """Cancel all jobs and end the thread."""
        self.cancel()
        self._pool.shutdown()

    def _begin(self) -> None:
        while self._running is None and self._waiting is not None:
            make, self._waiting = self._waiting, None
            job = make()
            if job is not None:
                self._running = self._pool.submit(compute, job, self._cancelled.is_set)
                self._running.add_done_callback(lambda _: self._done())


def compute(job: Job, cancelled: Callable[[], bool]) -> Future | None:
    """Result of a job; None where it was cancelled."""
    begun = time.perf_counter()
    rollout = job.rollout
    recording = Recording(rollout.state, rollout.dt, job.steps)
    for states, error in rollout.blocks(job.steps, BLOCK):
        if cancelled():
            return None
        recording.add(states, error)
    future = recording.outcome.trajectory.window(0, recording.done + 1)
    poses = np.concatenate([future.positions, future.quaternions], axis=2)
    twists = np.concatenate([future.velocities, future.angular_velocities], axis=2)
    times = [round(step * rollout.dt * 1e9) for step in range(len(poses))]
    names = [f'sphere_{sphere}' for sphere in job.ids]
    cdr = encode_trajectory(job.stamp_ns, job.frame_id, names, times, poses, twists)
    spread = None
    if job.spread is not None:
        spread = spread_of_future(job.spread, len(poses), rollout.dt)
    took = time.perf_counter() - begun
    return Future(job, cdr, future.positions, took, recording.error, spread)
