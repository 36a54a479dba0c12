# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Events of the middleware, as QoS that does not match: looked at now and then.

rclpy makes a new wait set for each message, of all that a node has. Each publisher and each
subscription has two events in it, of which one comes once in a run at most: at 240 frames per
second they took a third of the node's processor time.
"""

from __future__ import annotations

import time
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import EventHandler
from rclpy.node import Node

PERIOD, OPEN = 1.0, 0.05  # of looking, and how long that lasts [s]


class NowAndThen(CallbackGroup):
    """Group of what is waited for only a short while after each `look`."""

    def __init__(self) -> None:
        super().__init__()
        self._until = 0.0

    def look(self) -> None:
        """Wait for its entities, too, from now on for a while."""
        self._until = time.monotonic() + OPEN

    def can_execute(self, entity: Any) -> bool:  # noqa: ARG002 as rclpy calls it
        """Whether it is looked at now."""
        return time.monotonic() < self._until

    def beginning_execution(self, entity: Any) -> bool:  # noqa: ARG002 as rclpy calls it
        """Nothing excludes anything else."""
        return True

    def ending_execution(self, entity: Any) -> None:
        """Nothing waits for that."""


def look_now_and_then(node: Node) -> None:
    """Look at the events of all topics that a node has now once a second."""
    group = NowAndThen()
    for entity in node.waitables:
        if isinstance(entity, EventHandler):
            entity.callback_group = group
    node.create_timer(PERIOD, group.look, clock=Clock(clock_type=ClockType.STEADY_TIME))
