# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Futures: the predicted trajectory from the newest frame, in a thread where it takes long."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future as Result
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
import threading
import time
from typing import TYPE_CHECKING

import numpy as np

from .spread import Spread, spread_of_future, SpreadJob
from ..messages.trajectories import TrajectoryCodec
from ..scenes.state import Array, State

if TYPE_CHECKING:
    from ..rollout.rollout import Rollout


# steps are taken in blocks of about this time, after which a cancelled job ends [s]
BLOCK = 10e-3
# a job is computed at once where it takes less than this [s], and than this share of the time
# between two: to wake the executor for it costs rclpy half as much as a future of one ball
SHORT, SHARE = 1e-3, 0.25


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
        first: So many steps take less than `BLOCK`, as far as is known.
    """

    rollout: Rollout
    stamp_ns: int
    steps: int
    frame_id: str
    ids: tuple[int, ...]
    spread: SpreadJob | None = None
    first: int = 1


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

    The engine runs without Python's global lock. All methods are called from one thread. That
    thread computes by itself, within `request`, where it may and the last job as large was short.

    Args:
        done: Called in the computing thread when `take` may have a result; not for one that
            `request` has computed.
    """

    def __init__(self, done: Callable[[], object]) -> None:
        self._done = done
        self._pool = ThreadPoolExecutor(1, thread_name_prefix='future')
        self._waiting: Callable[[], Job | None] | None = None
        self._running: Result[Future | None] | None = None
        self._cancelled = threading.Event()
        # spheres, steps and time [s] of the last job
        self._last: tuple[int, int, float] | None = None
        self._begun = 0.0  # when a job was begun last [s]

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._running is not None or self._waiting is not None

    def request(self, make: Callable[[], Job | None], *, at_once: bool = False) -> bool:
        """Request a trajectory; False where it replaces an older request that still waited.

        Args:
            make: Makes the job when its turn comes, so that dropped requests cost nothing; returns
                None where there is nothing to compute.
            at_once: Whether there is time to compute a short job within this call.
        """
        superseded, idle, self._waiting = self._waiting is not None, not self.busy, make
        self._begin(at_once=at_once and idle)
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
        future = running.result()
        if future is not None:
            self._last = len(future.job.ids), future.job.steps, future.took
        return future

    def cancel(self) -> None:
        """Drop the waiting and the running job."""
        self._cancelled.set()
        self._waiting = self._running = self._last = None
        self._cancelled = threading.Event()  # for later jobs

    def close(self) -> None:
        """Cancel all jobs and end the thread."""
        self.cancel()
        self._pool.shutdown()

    def _begin(self, *, at_once: bool = False) -> None:
        while self._running is None and self._waiting is not None:
            make, self._waiting = self._waiting, None
            job = make()
            if job is None:
                continue
            job = replace(job, first=self._first(job))
            before, self._begun = self._begun, time.perf_counter()
            if at_once and self._is_short(job, self._begun - before):
                self._running = Result()
                try:
                    self._running.set_result(compute(job, self._cancelled.is_set))
                except Exception as error:  # `take` raises it
                    self._running.set_exception(error)
                return
            self._running = self._pool.submit(compute, job, self._cancelled.is_set)
            self._running.add_done_callback(lambda _: self._done())

    def _is_short(self, job: Job, interval: float) -> bool:
        """Whether a job that comes so long after the last one takes a small part of that time."""
        if self._last is None or job.spread is not None:
            return False
        spheres, steps, took = self._last
        alike = len(job.ids) <= spheres and job.steps <= steps
        return alike and took < min(SHORT, SHARE * interval)

    def _first(self, job: Job) -> int:
        if self._last is None or len(job.ids) > self._last[0]:
            return 1
        _, steps, took = self._last
        return min(max(int(steps * BLOCK / took), 1), job.steps)


def compute(job: Job, cancelled: Callable[[], bool]) -> Future | None:
    """Result of a job; None where it was cancelled."""
    begun = time.perf_counter()
    rollout, points, error = job.rollout, 1, ''
    # rows of the message
    poses = np.empty((job.steps + 1, len(job.ids), 7))
    twists = np.empty((job.steps + 1, len(job.ids), 6))
    _fill(poses[0], twists[0], rollout.state)
    for states, why in rollout.blocks(job.steps, BLOCK, job.first):
        if cancelled():
            return None
        error = why
        if count := len(states):
            rows = slice(points, points + count)
            _fill(poses[rows], twists[rows], states)
            points += count
    poses, twists = poses[:points], twists[:points]
    codec = _codec_of(job.frame_id, job.ids, points, rollout.dt)
    cdr = codec.encode(job.stamp_ns, poses, twists)
    spread = None
    if job.spread is not None:
        spread = spread_of_future(job.spread, points, rollout.dt)
    took = time.perf_counter() - begun
    return Future(job, cdr, poses[..., :3], took, error, spread)


def _fill(poses_out: Array, twists_out: Array, states: State) -> None:
    poses_out[..., :3], poses_out[..., 3:] = states.positions, states.quaternions
    twists_out[..., :3], twists_out[..., 3:] = states.velocities, states.angular_velocities


@lru_cache(maxsize=8)
def _codec_of(frame_id: str, ids: tuple[int, ...], points: int, dt: float) -> TrajectoryCodec:
    names = [f'sphere_{sphere}' for sphere in ids]
    return TrajectoryCodec(frame_id, names, [round(step * dt * 1e9) for step in range(points)])
