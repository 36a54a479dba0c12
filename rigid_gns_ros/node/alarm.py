# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A timer that rings once, at a time of the node's clock, be it real or simulated."""

from __future__ import annotations

from collections.abc import Callable
import time

from rclpy.node import Node

from .set_clock import simulated

EARLY = 1_000_000  # by which the timer fires, and the rest is slept: it wakes late by that [ns]


class Alarm:
    """Calls `callback` once for each `set`, from the node's executor.

    A periodic timer of rclpy drops a tick that comes a period late, and its ticks are counted from
    its own start; an alarm that is set from stamps neither drops nor drifts.
    """

    def __init__(self, node: Node, callback: Callable[[], None]) -> None:
        self._node, self._callback = node, callback
        self._timer = node.create_timer(1.0, self._ring, autostart=False)
        self._due: int | None = None

    def set(self, time_ns: int) -> None:
        """Ring when the node's clock reaches `time_ns`; at once where that is past."""
        self._due = time_ns
        # a simulated clock does not run while one sleeps
        early = 0 if simulated(self._node) else EARLY
        self._timer.timer_period_ns = max(self._left(time_ns) - early, 0)
        self._timer.reset()

    def cancel(self) -> None:
        """Do not ring."""
        self._timer.cancel()
        self._due = None

    def _ring(self) -> None:
        self._timer.cancel()
        due, self._due = self._due, None
        if due is None:
            return
        left = min(self._left(due), EARLY)
        if left > 0 and not simulated(self._node):
            time.sleep(left * 1e-9)
            if not self._node.context.ok():
                return  # stopped meanwhile
        self._callback()

    def _left(self, time_ns: int) -> int:
        return time_ns - self._node.get_clock().now().nanoseconds
