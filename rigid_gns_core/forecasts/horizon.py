# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Futures: the predicted trajectory from the newest frame, in a thread where it takes long."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future as Result
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
import threading
import time
from typing import TYPE_CHECKING

import numpy as np

from .spread import codec_of, drawn_rollouts, Spread, spread_of_future, SpreadJob
from ..rollout.stepper import state_at
from ..scenes.state import Array, State

if TYPE_CHECKING:
    from ..rollout.rollout import Rollout


# steps are taken in blocks of about this time, after which a cancelled job ends [s]
BLOCK = 10e-3
# a job is computed at once where its thread would take less than this share of the time between
# two, and this [s] less than the executor has: beside the executor, one thread with Python's lock
# waits for the other, and a future of one ball takes twice as long
SHARE, SPARE = 0.6, 1e-3


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
        worked: Processor time of that [s].
        error: Why it ends early; empty: it does not.
        spread: How sure it is; None: that was not asked for.
    """

    job: Job
    cdr: bytes
    positions: Array
    took: float
    worked: float
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
        self._last: Future | None = None
        self._begun = 0.0  # when a job was begun last [s]

    @property
    def busy(self) -> bool:
        """Whether a job runs or waits."""
        return self._running is not None or self._waiting is not None

    def request(self, make: Callable[[], Job | None], *, left: float = 0.0) -> bool:
        """Request a trajectory; False where it replaces an older request that still waited.

        Args:
            make: Makes the job when its turn comes, so that dropped requests cost nothing; returns
                None where there is nothing to compute.
            left: How long this call may take, the making included [s].
        """
        superseded, self._waiting = self._waiting is not None, make
        self._begin(left)
        return not superseded

    def take(self, left: float = 0.0) -> Future | None:
        """The result, where it is ready; the waiting job is begun then, as by `request`.

        Raises:
            Exception: What the computation raised; a rollout that diverged does not raise.
        """
        running = self._running
        if running is None or not running.done():
            return None
        self._running = None
        future = None if running.exception() else running.result()
        self._last = future or self._last
        self._begin(left)
        return running.result()

    def cancel(self) -> None:
        """Drop the waiting and the running job."""
        self._cancelled.set()
        self._waiting = self._running = self._last = None
        self._cancelled = threading.Event()  # for later jobs

    def close(self) -> None:
        """Cancel all jobs and end the thread."""
        self.cancel()
        self._pool.shutdown()

    def _begin(self, left: float) -> None:
        until = time.perf_counter() + left
        while self._running is None and self._waiting is not None:
            make, self._waiting = self._waiting, None
            job = make()
            if job is None:
                continue
            job = replace(job, first=self._first(job))
            before, self._begun = self._begun, time.perf_counter()
            if self._is_short(
                job, min(until - self._begun - SPARE, SHARE * (self._begun - before))
            ):
                self._running = Result()
                try:
                    self._running.set_result(compute(job, self._cancelled.is_set))
                except Exception as error:  # `take` raises it
                    self._running.set_exception(error)
                return
            self._running = self._pool.submit(compute, job, self._cancelled.is_set)
            self._running.add_done_callback(lambda _: self._done())

    def _is_short(self, job: Job, time_left: float) -> bool:
        """Whether a job is like the last one, which took less than a time [s]."""
        last = self._last
        if last is None or len(job.ids) > len(last.job.ids) or job.steps > last.job.steps:
            return False
        return last.worked < time_left and _samples(job) <= _samples(last.job)

    def _first(self, job: Job) -> int:
        last = self._last
        if last is None or len(job.ids) > len(last.job.ids):
            return 1
        return min(max(int(last.job.steps * BLOCK / last.took), 1), job.steps)


def _samples(job: Job) -> int:
    """Samples of a job; -1: its spread is not wanted."""
    return job.spread.samples if job.spread is not None else -1


def compute(job: Job, cancelled: Callable[[], bool]) -> Future | None:
    """Result of a job; None where it was cancelled."""
    begun, working = time.perf_counter(), time.thread_time()
    drawn, error = None, ''
    if job.spread is not None:
        drawn = drawn_rollouts(job.spread, job.steps)
    if drawn is not None and np.isfinite(drawn.positions[0]).all():
        states = state_at(drawn, 0)  # the estimated state itself is the first of those drawn
    else:
        rolled = _rolled(job, cancelled)
        if rolled is None:
            return None
        states, error = rolled
    points = len(states.positions)
    poses, twists = np.empty((points, len(job.ids), 7)), np.empty((points, len(job.ids), 6))
    poses[..., :3], poses[..., 3:] = states.positions, states.quaternions
    twists[..., :3], twists[..., 3:] = states.velocities, states.angular_velocities
    codec = codec_of(job.frame_id, job.ids, points, job.rollout.dt)
    cdr = codec.encode(job.stamp_ns, poses, twists)
    spread = None
    if job.spread is not None and drawn is not None:
        spread = spread_of_future(job.spread, drawn, points, job.rollout.dt)
    took, worked = time.perf_counter() - begun, time.thread_time() - working
    return Future(job, cdr, poses[..., :3], took, worked, error, spread)


def _rolled(job: Job, cancelled: Callable[[], bool]) -> tuple[State, str] | None:
    """States of the rollout from its start on, and why they end early; None: cancelled."""
    start, error = job.rollout.state, ''
    parts = [State.unchecked(*(values[None] for values in vars(start).values()))]
    for states, why in job.rollout.blocks(job.steps, BLOCK, job.first):
        if cancelled():
            return None
        parts.append(states)
        error = why
    fields = zip(*(vars(part).values() for part in parts), strict=True)
    return State.unchecked(*(np.concatenate(field) for field in fields)), error
