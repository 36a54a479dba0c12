# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A tracker that is gone, and frames that never came."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_ros.node.lost_messages import LostMessages
from rigid_gns_ros.node.simulator import SimulatorNode

T0 = 1_000_123_456_789  # as in conftest.py
DT = 100_000_000
Simulated = Callable[..., Any]
Falling = Callable[..., np.ndarray]


def test_it_is_said_once_and_predictions_go_on(
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(30)  # 3 s, of which 1.25 s are usual
    setup.node.simulation.report()
    assert log().count('no tracked frame for') == 1
    assert 'predictions go on from the last start; parameter tracker_timeout stops them' in log()
    setup.frame(falling(3.0), T0 + 31 * DT)
    assert log().count('tracked frames come again') == 1


def test_the_timeout_stops_predictions_until_frames_come(
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated(tracker_timeout=0.95)
    setup.start(falling(0.0))
    setup.run(9)
    for step in range(10, 15):  # each would be the time of a prediction
        setup.clock.set(T0 + step * DT)
    simulation = setup.node.simulation
    setup.bench.until(lambda: simulation.predictor.forecast is None, 'the stop')
    assert len(setup.tracked.predicted) == 9
    assert 'no tracked frame for 1.0 s: predictions stop until frames come again' in log()
    setup.start(falling(1.5), T0 + 15 * DT)
    assert simulation.predictor.last_start.reason == 'restart'
    assert 'tracked frames come again' in log()


def test_frames_that_the_queue_dropped_are_counted(
    bench: Any, falling: Falling, log: Callable[[], str]
) -> None:
    node = bench.add(SimulatorNode, velocity_window=1)
    tracked = bench.tracked()
    tracked.send(falling(0.0), T0)
    topics, diagnostics = node.simulation.topics, node.simulation.diagnostics
    bench.until(lambda: node.simulation.window.stamp_ns == T0, 'the first frame')
    # 60 while nobody takes them, into a queue of half of that; the newest stays
    codec = PoseArrayCodec('world', 3)
    for k in range(1, 61):
        tracked.publisher.publish(codec.encode(falling(0.01 * k), T0 + k * DT // 50))
    last = T0 + 60 * DT // 50
    bench.until(lambda: node.simulation.window.stamp_ns == last, 'the last frame')
    accepted = node.simulation.window.counts['accepted']
    assert accepted < 61
    lost = topics._inputs[0].lost.total
    assert lost == diagnostics.lost == 61 - accepted  # none without a count
    assert f'{61 - accepted} so far' in log()
    assert 'qos_overrides./tracked_poses.subscription.depth:=100' in log()


@pytest.mark.parametrize(
    ('numbers', 'publishers', 'lost'),
    [
        ([1, 2, 3], 1, 0),
        ([7, 8, 12, 13], 1, 3),  # what came before the first is not known
        ([1, 2, 5, 1, 2, 4], 1, 3),  # begun anew
        ([1, 20, 2, 21, 3, 22], 2, 0),  # two in turns
        ([1, 20, 2, 23, 4, 24], 2, 3),
        ([1, 2, 900, 3, 901], 2, 0),  # the second was there before
        ([None, None], 1, 0),  # the middleware has no numbers
    ],
)
def test_gaps_in_the_numbers_are_losses(
    numbers: list[int | None], publishers: int, lost: int
) -> None:
    found = LostMessages(lambda: publishers)
    assert sum(found.take(number) for number in numbers) == found.total == lost


def test_numbers_of_publishers_that_have_gone_are_forgotten() -> None:
    """Some make a publisher for each message."""
    found = LostMessages(lambda: 1)
    assert not any(found.take(1) for _ in range(1000))
    assert len(found._newest) <= 100
