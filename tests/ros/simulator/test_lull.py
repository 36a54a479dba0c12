# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames that nothing follows from yet lie in the middleware's queue: in order, none is lost."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_ros.node import inputs
from rigid_gns_ros.node import simulation as simulations
from rigid_gns_ros.node.topics import DEPTH
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Callable[..., np.ndarray]
Simulated = Callable[..., Any]
Started = Callable[..., 'Taking']


class Taking:
    """A started simulator, and messages that lie in its middleware."""

    def __init__(self, setup: Any, falling: Falling, monkeypatch: pytest.MonkeyPatch) -> None:
        self.setup, self.falling = setup, falling
        self.simulation = setup.node.simulation
        self._queue: list[tuple[bytes, dict[str, int]]] = []
        own = self.simulation.topics._inputs[0]
        monkeypatch.setattr(own, '_take', lambda: self._queue.pop(0) if self._queue else None)

    def lie(self, *numbers: int, came: int = 0) -> list[bytes]:
        """Frames by number that came at a time [ns], which lie in the queue."""
        frames = [
            PoseArrayCodec('world', 3).encode(self.falling(1e-3 * k), T0 + k * 1_000_000)
            for k in numbers
        ]
        self._queue += [(frame, {'received_timestamp': came}) for frame in frames]
        return frames

    def take(self, *numbers: int) -> None:
        """Take frames by number."""
        self.lie(*numbers)
        self.setup.node.drain()

    @property
    def lull(self) -> float:
        return float(self.setup.node.lull())

    @property
    def newest(self) -> int:
        """Number of the newest frame in the window."""
        return (self.simulation.window.stamp_ns - T0) // 1_000_000


@pytest.fixture(name='started')
def started_fixture(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> Started:
    """`started(parameters)`: after its first frame, as by a real clock."""
    for module in (inputs, simulations):
        monkeypatch.setattr(module, 'simulated', lambda _: False)

    def start(**parameters: Any) -> Taking:
        setup = simulated(**parameters)
        setup.start(falling(0.0))
        return Taking(setup, falling, monkeypatch)

    return start


def test_half_a_queue_of_frames_may_lie_in_it(started: Started) -> None:
    taking = started()
    assert taking.lull == 0  # how fast they come is not known yet
    taking.take(4)
    assert taking.lull == pytest.approx(DEPTH / 2 * 4e-3)
    taking.take(8, 28)  # some were lost
    assert taking.lull == pytest.approx(DEPTH / 2 * 4e-3)
    taking.setup.clock.set(taking.simulation.predictor.due_ns - 5_000_000)
    assert taking.lull == pytest.approx(1e-3)  # so that they are processed before it is due


def test_frames_are_of_the_time_at_which_they_came(
    started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    taking = started()
    arrivals: list[int] = []
    monkeypatch.setattr(taking.simulation._intake, 'record', lambda _, now: arrivals.append(now))
    now = T0 + DT // 4
    taking.setup.clock.set(now)
    taking.lie(1, came=T0 + 2_000_000)
    taking.lie(2, came=0)  # this middleware does not tell
    taking.lie(3, came=now + 1)  # by another clock
    taking.lie(4, came=now - 2 * 10**9)
    assert taking.newest == 0
    taking.setup.node.drain()
    assert taking.newest == 4 and taking.simulation.window.counts['accepted'] == 5
    assert arrivals == [T0 + 2_000_000, now, now, now]


def test_a_simulated_clock_has_no_lull(started: Started, monkeypatch: pytest.MonkeyPatch) -> None:
    taking = started()
    taking.take(1)
    assert taking.lull > 0
    monkeypatch.setattr(simulations, 'simulated', lambda _: True)
    assert taking.lull == 0


@pytest.mark.parametrize('parameters', [{'start': 'diverged'}, {'learn': True}], ids=str)
def test_frames_that_something_follows_from_are_waited_for(
    started: Started, parameters: dict[str, Any]
) -> None:
    taking = started(**parameters)
    taking.take(1, 2)
    assert taking.lull == 0


def test_by_every_the_last_frame_before_a_computation_is_waited_for(
    started: Started, monkeypatch: pytest.MonkeyPatch
) -> None:
    taking = started(start='every')
    predictor, compared = taking.simulation.predictor, []
    fit = predictor.has_diverged
    monkeypatch.setattr(predictor, 'has_diverged', lambda: compared.append(taking.newest) or fit())
    taking.take(1)
    assert not compared  # frames every millisecond, 150 ms are left
    assert taking.lull == pytest.approx(DEPTH / 2 * 1e-3)
    taking.take(2, 3)
    assert compared == []
    taking.take(103, 203, 303)  # 100 ms apart now
    assert compared == [] and taking.lull == pytest.approx(0.05)
    taking.take(503, 703, 903)  # 200 ms
    assert compared == [903] and taking.lull <= 0


def test_frames_are_waited_for_where_futures_or_markers_are_heard_or_nothing_is_predicted(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (inputs, simulations):
        monkeypatch.setattr(module, 'simulated', lambda _: False)
    setup = simulated(horizon=0.2)
    taking = Taking(setup, falling, monkeypatch)
    assert taking.lull == 0  # nothing was predicted
    taking.take(0, 1)
    assert taking.lull > 0  # nobody hears of futures
    setup.node.simulation.pause(True)
    assert taking.lull == 0
    setup.node.simulation.pause(False)
    assert taking.lull > 0
    heard: list[Any] = []
    markers = setup.bench.tester.create_subscription(
        MarkerArray, '/predicted_markers', heard.append, 10
    )
    publisher = taking.simulation.topics.markers
    setup.bench.until(publisher.get_subscription_count, 'discovery')
    assert taking.lull == 0
    setup.bench.tester.destroy_subscription(markers)
    setup.bench.until(lambda: not publisher.get_subscription_count(), 'its end')
    assert taking.lull > 0
    trajectory = taking.simulation.topics.trajectory
    setup.bench.tester.create_subscription(
        MultiDOFJointTrajectory, '/predicted_trajectory', heard.append, 10
    )
    setup.bench.until(trajectory.get_subscription_count, 'discovery')
    assert taking.lull == 0


@pytest.mark.parametrize('down', [False, True], ids=['closed', 'after a signal'])
def test_frames_that_lie_in_the_queue_at_the_end_are_in_the_bag(
    started: Started, tmp_path: Path, down: bool
) -> None:
    taking = started(record=str(tmp_path / 'bag'))
    setup = taking.setup
    frames = taking.lie(1, 2, 3)
    if down:  # as by a signal
        setup.bench.context.try_shutdown()
    setup.node.close()
    assert read_bag(tmp_path / 'bag').topics['/tracked_poses'].messages[-3:] == frames
