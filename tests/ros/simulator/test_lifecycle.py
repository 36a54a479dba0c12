# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A supervisor takes the simulator through its states, over the services of ROS' lifecycle."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.qos import qos_profile_sensor_data
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_ros.node.simulator import SimulatorNode

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Callable[..., Any]


class Supervised:
    """A simulator on simulated time that waits for a supervisor, and the ends of its topics."""

    def __init__(self, bench: Any, **parameters: Any) -> None:
        self.bench = bench
        self.node = bench.add(
            SimulatorNode, use_sim_time=True, velocity_window=1, autostart=False, **parameters
        )
        self.clock = bench.clock(self.node)
        self.clock.set(T0)
        self.publisher = bench.tester.create_publisher(
            PoseArray, 'tracked_poses', qos_profile_sensor_data
        )
        self.predicted: list[bytes] = []
        self.reports: list[bytes] = []
        for kind, topic, heard in (
            (PoseArray, 'predicted_poses', self.predicted),
            (DiagnosticArray, '/diagnostics', self.reports),
        ):
            bench.tester.create_subscription(kind, topic, heard.append, 100, raw=True)

    @property
    def state(self) -> str:
        return str(self.bench.call(GetState, 'simulator/get_state').current_state.label)

    def change(self, transition: str) -> bool:
        request = {'transition': ChangeState.Request().transition}
        request['transition'].label = transition
        return bool(self.bench.call(ChangeState, 'simulator/change_state', **request).success)

    def hears(self, *, wanted: bool) -> None:
        count = self.publisher.get_subscription_count
        self.bench.until(lambda: bool(count()) is wanted, f'subscriber: {wanted}')
        if wanted:
            (publisher,) = (
                own for own in self.node.publishers if own.topic_name == '/predicted_poses'
            )
            self.bench.until(publisher.get_subscription_count, 'the listener')

    def predict(self, falling: Falling, stamp_ns: int) -> None:
        """Send a frame, and wait for the prediction from it."""
        before, poses = len(self.predicted), falling((stamp_ns - T0) * 1e-9)
        self.clock.set(stamp_ns)
        self.publisher.publish(PoseArrayCodec('world', len(poses)).encode(poses, stamp_ns))
        predictor = self.node.simulation.predictor
        self.bench.until(lambda: predictor.pending is not None, 'the start')
        self.clock.set(stamp_ns + DT)
        self.bench.until(lambda: len(self.predicted) > before, 'the prediction')


def test_it_activates_itself(bench: Any) -> None:
    bench.add(SimulatorNode)
    found = bench.call(GetState, 'simulator/get_state').current_state
    assert found.label == 'active'


def test_a_supervisor_takes_it_through_all_states(
    bench: Any, falling: Falling, tmp_path: Path, log: Callable[[], str]
) -> None:
    folder = tmp_path / 'bag'
    own = Supervised(bench, record=str(folder))
    assert own.state == 'unconfigured' and not folder.exists()
    assert not own.change('activate')
    assert own.change('configure') and own.state == 'inactive'
    assert folder.exists()
    own.hears(wanted=False)
    assert own.change('activate') and own.state == 'active'
    own.hears(wanted=True)
    own.predict(falling, T0)

    assert own.change('deactivate') and own.state == 'inactive'
    own.hears(wanted=False)
    assert own.node.simulation.window.stamp_ns is None
    said = len(own.predicted), len(own.reports)
    for step in range(2, 12):  # none is due, and nothing is told
        own.clock.set(T0 + step * DT)
    own.node.simulation.report()
    assert own.state == 'inactive'  # the executor has turned for its answer
    assert (len(own.predicted), len(own.reports)) == said
    assert own.node.simulation.topics.bag.error is None

    assert own.change('activate')
    own.hears(wanted=True)
    own.predict(falling, T0 + 20 * DT)
    assert own.change('deactivate') and own.change('cleanup') and own.state == 'unconfigured'
    assert 'stopped: 2 published' in log()
    bag = read_bag(folder)
    assert not bag.warnings
    assert bag.topics['/predicted_poses'].messages == own.predicted
    assert len(bag.topics['/tracked_poses']) == 2
    assert len(bag.topics['/simulator/scene']) == 1
    named = [end.topic_name for end in (*own.node.publishers, *own.node.subscriptions)]
    assert not [name for name in named if 'poses' in name]

    # the bag is there now, so that a second one cannot be
    assert not own.change('configure') and own.state == 'unconfigured'
    assert f'parameter record is {str(folder)!r}' in log()
    assert own.change('shutdown') and own.state == 'finalized'


def test_the_same_is_predicted_however_it_was_started(
    bench: Any, falling: Falling, simulated: Callable[..., Any]
) -> None:
    own = Supervised(bench)
    assert own.change('configure') and own.change('activate')
    own.hears(wanted=True)
    own.predict(falling, T0)
    assert own.change('shutdown') and own.state == 'finalized'
    bench.nodes.remove(own.node)
    bench.executor.remove_node(own.node)
    own.node.destroy_node()
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(1)
    assert setup.tracked.predicted_bytes[:1] == own.predicted[:1]


def test_what_cannot_be_configured_is_said_and_it_can_be_shut_down(
    bench: Any, log: Callable[[], str]
) -> None:
    own = Supervised(bench, scene='nosuch')
    assert not own.change('configure') and own.state == 'unconfigured'
    assert 'nosuch' in log()
    assert own.change('shutdown') and own.state == 'finalized'


def test_it_can_be_shut_down_before_it_is_configured(bench: Any) -> None:
    own = Supervised(bench)
    assert own.change('shutdown') and own.state == 'finalized'


def test_a_topic_that_cannot_be_is_said_in_one_line(bench: Any, log: Callable[[], str]) -> None:
    own = Supervised(bench, tracker='PoseStamped', balls='ball 1')
    assert not own.change('configure') and own.state == 'unconfigured'
    said = log()
    assert 'Invalid topic name: ' in said and "'ball 1'" in said and 'Traceback' not in said
