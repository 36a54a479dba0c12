# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clocks that jump: simulated ones, and the system's where it is set while the node runs."""

from __future__ import annotations

from collections.abc import Callable
import time

from rclpy.clock import JumpHandle, JumpThreshold, ROSClock
from rclpy.duration import Duration
from rclpy.node import Node

AHEAD = 1_000_000_000  # the clock goes on like this at most; a smaller step is caught up with [ns]


def simulated(node: Node) -> bool:
    """Whether the node's clock is that of a simulation, as with `use_sim_time`."""
    clock = node.get_clock()
    return isinstance(clock, ROSClock) and clock.ros_time_is_active


def on_jump(node: Node, callback: Callable[[int], None]) -> JumpHandle:
    """Call `callback` with the jump [ns] where a simulated clock goes back, or far ahead at once.

    The handle must be kept, and unregistered before the node ends: rclpy may crash otherwise.
    """
    threshold = JumpThreshold(
        min_forward=Duration(nanoseconds=AHEAD + 1),
        min_backward=Duration(nanoseconds=-1),
        on_clock_change=False,
    )
    return node.get_clock().create_jump_callback(
        threshold, post_callback=lambda jump: callback(jump.delta.nanoseconds)
    )


class SetClock:
    """Compares a node's clock with the monotonic one, which nobody sets.

    rclpy tells jumps of simulated time alone. A robot without a battery clock boots years ago, and
    is set when it finds a time server.

    Args:
        node: Its clock is watched, unless it is simulated.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._apart: int | None = None  # of both clocks at the last look [ns]

    def set_by(self) -> int:
        """By how much the clock was set since the last call [ns]; 0 where it was not."""
        if simulated(self._node):
            self._apart = None
            return 0
        now = self._node.get_clock().now().nanoseconds
        before, self._apart = self._apart, now - time.monotonic_ns()
        ahead = 0 if before is None else self._apart - before
        return ahead if abs(ahead) > AHEAD else 0
