# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Detection of clock jumps: of simulated time, and of the system clock when it is set."""

from __future__ import annotations

from collections.abc import Callable
import time

from rclpy.clock import JumpHandle, JumpThreshold, ROSClock
from rclpy.duration import Duration
from rclpy.node import Node

AHEAD = 1_000_000_000  # larger steps are jumps; smaller ones are caught up with [ns]


def simulated(node: Node) -> bool:
    """Whether the node runs on simulated time (`use_sim_time`)."""
    clock = node.get_clock()
    return isinstance(clock, ROSClock) and clock.ros_time_is_active


def on_jump(node: Node, callback: Callable[[int], None]) -> JumpHandle:
    """Call `callback` with each jump of simulated time [ns]: back, or ahead by over a second.

    The handle must be kept, and unregistered before the node ends, else rclpy may crash.
    """
    threshold = JumpThreshold(
        min_forward=Duration(nanoseconds=AHEAD + 1),
        min_backward=Duration(nanoseconds=-1),
        on_clock_change=False,
    )
    return node.get_clock().create_jump_callback(
        threshold, post_callback=lambda jump: callback(jump.delta.nanoseconds)
    )


class ClockWatch:
    """Detects a change of `use_sim_time`, and steps of the system clock by the monotonic clock.

    rclpy reports jumps of simulated time only. A robot without a battery-backed clock boots with a
    time years ago, which is set when it reaches a time server.

    Args:
        node: Node whose clock is watched, unless it is simulated.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._apart: int | None = None  # difference of both clocks at the last call [ns]
        self._simulated, self._now = simulated(node), 0  # at the last call

    def jump_ns(self, now: int) -> int:
        """Step of the clock since the last call [ns]; 0: it was not set.

        Args:
            now: Time of the node's clock [ns].
        """
        was, self._simulated = self._simulated, simulated(self._node)
        last, self._now = self._now, now
        if self._simulated != was:
            self._apart = None
            return now - last or 1  # another clock, even if it happens to tell the same time
        if self._simulated:
            return 0
        before, self._apart = self._apart, now - time.monotonic_ns()
        ahead = 0 if before is None else self._apart - before
        return ahead if abs(ahead) > AHEAD else 0
