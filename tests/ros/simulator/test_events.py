# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Events of the simulator's topics: told, but not waited for with each message."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PoseArray
from rclpy.event_handler import EventHandler
from rclpy.qos import DurabilityPolicy, QoSProfile
from rigid_gns_ros.node.events import NowAndThen, OPEN


def test_qos_that_does_not_match_is_told(
    bench: Any, simulated: Callable[..., Any], log: Callable[[], str]
) -> None:
    simulated()
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    bench.tester.create_subscription(PoseArray, 'predicted_poses', print, latched)
    text = "subscription discovered on topic 'predicted_poses', requesting incompatible QoS"
    bench.until(lambda: text in log(), 'the warning')


def test_events_are_waited_for_after_a_look_only(simulated: Callable[..., Any]) -> None:
    node = simulated().node
    events = [own for own in node.waitables if isinstance(own, EventHandler)]
    groups = {own.callback_group for own in events}
    assert len(events) > 30 and len(groups) == 1
    (group,) = groups
    assert isinstance(group, NowAndThen)
    group.look()
    assert group.can_execute(events[0])
    time.sleep(OPEN)
    assert not group.can_execute(events[0])
