# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames that nothing follows from yet wait, and are processed together, in order, none lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_ros.node.inbox import MOST
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Callable[..., np.ndarray]
Simulated = Callable[..., Any]
Started = Callable[..., 'Taking']


class Taking:
    """A started simulator, and messages of its middleware that are taken by its quick call."""

    def __init__(self, setup: Any, falling: Falling, monkeypatch: pytest.MonkeyPatch) -> None:
        self.setup, self.falling = setup, falling
        self.simulation = setup.node.simulation
        self._queue: list[bytes] = []
        own = self.simulation.topics._inputs[0]
        monkeypatch.setattr(
            own, '_take', lambda: (self._queue.pop(0), {}) if self._queue else None
        )
        (self._drain,) = own.quick.values()

    def take(self, *numbers: int) -> list[bytes]:
        """Take frames as the executor does where they are ready."""
        frames = [
            PoseArrayCodec('world', 3).encode(self.falling(1e-3 * k), T0 + k * 1_000_000)
            for k in numbers
        ]
        self._queue += frames
        self._drain()
        return frames

    @property
    def newest(self) -> int:
        """Number of the newest frame in the window."""
        return (self.simulation.window.stamp_ns - T0) // 1_000_000

    @property
    def waiting(self) -> int:
        return len(self.simulation.topics.inbox)


@pytest.fixture(name='started')
def started_fixture(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> Started:
    """`started(parameters)`: after its first frame."""

    def start(**parameters: Any) -> Taking:
        setup = simulated(**parameters)
        setup.start(falling(0.0))
        return Taking(setup, falling, monkeypatch)

    return start


def test_frames_wait_for_what_the_executor_calls_next(
    started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    taking = started()
    arrivals: list[int] = []
    monkeypatch.setattr(taking.simulation._intake, 'record', lambda _, now: arrivals.append(now))
    taking.take(1, 2)
    taking.setup.clock.set(T0 + DT // 4)
    assert taking.waiting == 2 and taking.newest == 0 and not arrivals
    taking.setup.node.settle()
    assert taking.waiting == 0 and taking.newest == 2
    assert arrivals == [T0, T0]  # when they came, not when they were processed
    assert taking.simulation.window.counts['accepted'] == 3


def test_so_many_frames_wait_at_most(started: Started) -> None:
    taking = started()
    for number in range(1, MOST):
        taking.take(number)
    assert taking.waiting == MOST - 1 and taking.newest == 0
    taking.take(MOST)
    assert taking.waiting == 0 and taking.newest == MOST


@pytest.mark.parametrize(
    'parameters', [{'start': 'every'}, {'start': 'diverged'}, {'learn': True}], ids=str
)
def test_frames_that_something_follows_from_do_not_wait(
    started: Started, parameters: dict[str, Any]
) -> None:
    taking = started(**parameters)
    taking.take(1, 2)
    assert taking.waiting == 0 and taking.newest == 2


def test_by_every_frames_wait_and_are_not_fitted_while_another_one_is_expected(
    started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    taking = started(start='every')
    predictor, compared = taking.simulation.predictor, []
    fit = predictor.has_diverged
    monkeypatch.setattr(predictor, 'has_diverged', lambda: compared.append(taking.newest) or fit())
    taking.take(1)
    assert taking.newest == 1 and not compared  # frames every millisecond, 150 ms are left
    taking.take(2)
    taking.take(3)
    assert taking.newest == 1 and taking.waiting == 2
    taking.setup.node.settle()
    assert taking.newest == 3 and not compared
    taking.take(203)
    taking.setup.node.settle()
    assert compared == [203]  # frames are 200 ms apart now
    taking.take(204)
    assert taking.newest == 204 and not taking.waiting


def test_frames_do_not_wait_where_futures_or_markers_are_heard_or_nothing_is_predicted(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = simulated(horizon=0.2)
    taking = Taking(setup, falling, monkeypatch)
    taking.take(0)
    assert taking.newest == 0  # nothing was predicted
    taking.take(1)
    assert taking.newest == 0  # nobody hears of futures
    setup.node.simulation.pause(True)
    taking.take(2)
    assert taking.newest == 2
    setup.node.simulation.pause(False)
    taking.take(3)
    assert taking.newest == 2
    heard: list[Any] = []
    markers = setup.bench.tester.create_subscription(
        MarkerArray, '/predicted_markers', heard.append, 10
    )
    publisher = taking.simulation.topics.markers
    setup.bench.until(publisher.get_subscription_count, 'discovery')
    taking.take(4)
    assert taking.newest == 4
    setup.bench.tester.destroy_subscription(markers)
    setup.bench.until(lambda: not publisher.get_subscription_count(), 'its end')
    trajectory = taking.simulation.topics.trajectory
    setup.bench.tester.create_subscription(
        MultiDOFJointTrajectory, '/predicted_trajectory', heard.append, 10
    )
    setup.bench.until(trajectory.get_subscription_count, 'discovery')
    taking.take(5)
    assert taking.newest == 5


@pytest.mark.parametrize('down', [False, True], ids=['closed', 'after a signal'])
def test_frames_that_wait_at_the_end_are_in_the_bag(
    started: Started, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, down: bool
) -> None:
    taking = started(record=str(tmp_path / 'bag'))
    setup = taking.setup
    monkeypatch.setattr(taking.simulation.topics.inbox, 'may_wait', lambda: True)
    frames = taking.take(1, 2, 3)
    assert taking.waiting == 3
    if down:  # as by a signal
        setup.bench.context.try_shutdown()
    setup.node.close()
    assert read_bag(tmp_path / 'bag').topics['/tracked_poses'].messages[-3:] == frames
