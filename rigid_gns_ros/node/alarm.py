# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A one-shot timer on the node's clock, real or simulated."""

from __future__ import annotations

from collections.abc import Callable
import time

from rclpy.node import Node

from .clock_jumps import simulated
from .executor import Quick

EARLY = 1_000_000  # the timer fires this early, as it wakes late by that; the rest is slept [ns]


class Alarm:
    """Calls `callback` once for each `set`, from the node's executor.

    A periodic timer of rclpy drops ticks that are a period late and counts from its own start; an
    alarm that is set from stamps neither drops nor drifts.
    """

    def __init__(self, node: Node, callback: Callable[[], None]) -> None:
        self._node, self._callback = node, callback
        self._timer = node.create_timer(1.0, self._ring, autostart=False)
        self._due: int | None = None
        self._exact = True

    def set(self, time_ns: int, *, exact: bool = True) -> None:
        """Call back when the node's clock reaches `time_ns`, at once where that is past.

        `exact`: not up to a millisecond sooner, for which the executor is held up as long.
        """
        self._due, self._exact = time_ns, exact
        # a simulated clock does not advance during a sleep
        early = 0 if simulated(self._node) else EARLY
        self._timer.timer_period_ns = max(self._left(time_ns) - early, 0)
        self._timer.reset()

    @property
    def quick(self) -> Quick:
        """See `executor`."""
        return {self._timer: self._ring_if_ready}

    @property
    def left(self) -> float:
        """Time until it calls back [s]; negative: it should have; 0: it is not set."""
        return 0.0 if self._due is None else self._left(self._due) * 1e-9

    def cancel(self) -> None:
        """Cancel the pending call."""
        self._timer.cancel()
        self._due = None

    def _ring_if_ready(self) -> None:
        if self._timer.is_ready():  # else it was set anew since it was
            self._ring()

    def _ring(self) -> None:
        self._timer.cancel()
        due, self._due = self._due, None
        if due is None:
            return
        left = min(self._left(due), EARLY)
        if self._exact and left > 0 and not simulated(self._node):
            time.sleep(left * 1e-9)
            if not self._node.context.ok():
                return  # the node was stopped during the sleep
        self._callback()

    def _left(self, time_ns: int) -> int:
        return time_ns - self._node.get_clock().now().nanoseconds
