"""A timer that rings once, at a time of the node's clock, be it real or simulated."""

from __future__ import annotations

from collections.abc import Callable

from rclpy.node import Node


class Alarm:
    """Calls `callback` once for each `set`, from the node's executor.

    A periodic timer of rclpy drops a tick that comes a period late, and its ticks are counted from
    its own start; an alarm that is set from stamps neither drops nor drifts.
    """

    def __init__(self, node: Node, callback: Callable[[], None]) -> None:
        self._node, self._callback = node, callback
        self._timer = node.create_timer(1.0, self._ring, autostart=False)

    def set(self, time_ns: int) -> None:
        """Ring when the node's clock reaches `time_ns`; at once where that is past."""
        delay = time_ns - self._node.get_clock().now().nanoseconds
        self._timer.timer_period_ns = max(delay, 0)
        self._timer.reset()

    def cancel(self) -> None:
        """Do not ring."""
        self._timer.cancel()

    def _ring(self) -> None:
        self._timer.cancel()
        self._callback()
