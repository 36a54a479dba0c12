# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node with the shipped model, in this process; time stands still unless set."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.scene_file import load_scene

T0 = 1_000_123_456_789  # [ns]; digits that a float32 or a rounded float64 would lose
DT = 100_000_000  # [ns], the shipped model's step at radius 1 m


class Setup:
    """A simulator on simulated time, and the tester's ends of its topics."""

    def __init__(self, bench: Any, **parameters: Any) -> None:
        from rigid_gns_ros.node.simulator import SimulatorNode

        self.bench = bench
        self.node = bench.add(SimulatorNode, use_sim_time=True, **parameters)
        self.clock = bench.clock(self.node)
        self.tracked = bench.tracked()
        self.clock.set(T0)

    def start(self, poses: np.ndarray, stamp_ns: int = T0) -> None:
        """Send one frame and wait until the first prediction is computed."""
        before = len(self.tracked.step_bytes)
        self.tracked.send(poses, stamp_ns)
        self.tracked.wait_computed(before + 1)

    def frame(self, poses: np.ndarray, stamp_ns: int) -> None:
        """Send one frame and wait until it is accepted."""
        self.tracked.send(poses, stamp_ns)
        self.bench.until(lambda: self.node.simulation.window.stamp_ns == stamp_ns, 'the frame')

    def follow(self, times_ns: list[int], interval_ns: int) -> list[int]:
        """Stamps of predictions while a tracker sends at the given times, counted from T0.

        The clock stops at each frame and each half of a period; a prediction that falls due at a
        stop is waited for.
        """
        start = self.node.get_clock().now().nanoseconds
        stops = set(times_ns) | set(range(0, max(times_ns) + interval_ns, interval_ns // 2))
        for stop in sorted(stop for stop in stops if T0 + stop >= start):
            self.clock.set(T0 + stop)
            if stop in times_ns:
                self.frame(self.bench.falling(stop * 1e-9), T0 + stop)
            self.bench.until(lambda stop=stop: self._next_ns() > T0 + stop, 'what is due')
        self.tracked.wait(self.node.simulation.predictor.counts['published'])
        return [frame.stamp_ns for frame in self.tracked.predicted]

    def _next_ns(self) -> int:
        """When the node publishes or computes next."""
        predictor = self.node.simulation.predictor
        half = 0 if predictor.pending else predictor.period_ns // 2
        return predictor.due_ns + half

    def run(self, count: int) -> list[Any]:
        """Advance the clock, period by period, until there are `count` predictions."""
        while len(self.tracked.predicted_bytes) < count:
            due = self.node.get_clock().now().nanoseconds + DT
            self.clock.set(due)
            self.tracked.wait(1 + sum(f.stamp_ns < due for f in self.tracked.predicted))
        return self.tracked.predicted


@pytest.fixture
def simulated(bench: Any) -> Callable[..., Setup]:
    def make(**parameters: Any) -> Setup:
        return Setup(bench, **{'velocity_window': 1, **parameters})

    return make


@pytest.fixture(name='expected')
def expected_fixture() -> Callable[..., np.ndarray]:
    """`expected(poses, steps, velocities)`: see there."""
    return expected


def expected(poses: np.ndarray, steps: int, velocities: np.ndarray | None = None) -> np.ndarray:
    """Poses of the model's own rollout, shape (steps + 1, n, 7)."""
    trajectory = load_simulator().rollout(
        load_scene('box_154'), poses[:, :3], velocities, steps=steps, quaternions=poses[:, 3:]
    )
    return np.concatenate([trajectory.positions, trajectory.quaternions], axis=2)
