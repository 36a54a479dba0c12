# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""An executor that waits for messages, timers and guard conditions in few microseconds.

rclpy makes a wait set of all that a node has for each callback, and a second one since the end of
a callback wakes it; a callback is a task and two coroutines. With 240 frames per second that took
half of a node's processor time. Here one wait set of subscriptions, timers and guard conditions is
used again, and a node may say what to call at once. Services, clients and events wait for
rclpy's own turn, which comes at least every `PERIOD` seconds, and at once where nothing else does.
Messages that nothing follows from for a while are not waited for: half of what was left were
wakes for them, each with cold caches.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
import time
from typing import Any, TYPE_CHECKING

from rclpy.executors import ShutdownException, SingleThreadedExecutor, TimeoutException
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.signals import SignalHandlerGuardCondition

if TYPE_CHECKING:
    from rclpy.context import Context
    from rclpy.node import Node

PERIOD = 0.1  # [s]

# what to call where a subscription, a timer or a guard condition is ready
Quick = Mapping[Any, Callable[[], object]]


class QuickExecutor(SingleThreadedExecutor):
    """Runs the callbacks of nodes in one thread.

    A node may have a property `quick`: what to call when a subscription, a timer or a guard
    condition of it is ready, which then takes the message or resets the timer. It may have a
    method `lull`: how long nobody needs to wait for these subscriptions [s], whose messages stay
    in the middleware; its method `drain`, which takes them, is called after that or before any
    other call.

    Args:
        context: Of the nodes; None: the default one.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._changed: Any = GuardCondition(None, None, context=self.context)
        self._signal: Any = SignalHandlerGuardCondition(context=self.context)
        self._wait_set: Any = None  # None: to be made anew
        self._turn = 0.0  # when rclpy's turn comes [s]
        self._idle = True  # whether nothing has come since its last one
        self._kept = ExitStack()  # handles of the wait set: they cannot be destroyed meanwhile
        self._lulls: list[Callable[[], float]] = []
        self._drains: list[Callable[[], None]] = []

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for something, and do what is ready.

        Args:
            timeout_sec: Longest time to wait [s], in rclpy's way; None: as long as it takes.
        """
        if timeout_sec is not None:
            super().spin_once(timeout_sec)
            return
        left = self._turn - time.monotonic()
        if left > 0:
            self._wait(left)
        elif self._idle or not self._rest():
            if self._idle:
                super().spin_once()
            self._idle, self._turn = True, time.monotonic() + PERIOD

    def wake(self) -> None:
        """Note that entities were created or destroyed, or that a shutdown has begun."""
        super().wake()
        self._renew()

    def add_node(self, node: Node) -> bool:
        """See `rclpy.executors.Executor.add_node`."""
        self._renew()
        return super().add_node(node)

    def remove_node(self, node: Node) -> None:
        """See `rclpy.executors.Executor.remove_node`."""
        super().remove_node(node)
        self._renew()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """See `rclpy.executors.Executor.shutdown`."""
        self._renew()
        done = super().shutdown(timeout_sec)
        if done and self._signal is not None:
            self._kept.close()
            self._signal.destroy()
            self._changed.destroy()
            self._signal = self._changed = None
        return done

    def _renew(self) -> None:
        self._wait_set = None
        if self._changed is not None:
            self._changed.trigger()

    def _rest(self) -> bool:
        """Do one thing that is ready in rclpy's way; False: there is none."""
        try:
            handler, _, _ = self.wait_for_ready_callbacks(timeout_sec=0)
        except (TimeoutException, ShutdownException):
            return False
        handler()
        handler.result()  # raises what the callback raised
        return True

    def _wait(self, seconds: float) -> None:
        """Wait so long for subscriptions, timers and guard conditions; do what is ready."""
        # another thread may call for a new one at any time
        wait_set = self._wait_set or self._make_wait_set()
        lull = min([one() for one in self._lulls], default=0.0)
        wait_set.clear_entities()
        for handle, add in self._others if lull > 0 else self._entities:
            add(handle)
        wait_set.wait(max(int((min(lull, seconds) if lull > 0 else seconds) * 1e9), 0))
        ready = [
            pointer
            for kind in ('timer', 'subscription', 'guard_condition')
            for pointer in wait_set.get_ready_entities(kind)
        ]
        if lull > 0:
            for drain in self._drains:
                drain()
        for pointer in ready:
            if self.context.ok() and (call := self._calls.get(pointer)) is not None:
                self._idle = False
                call()

    def _make_wait_set(self) -> Any:
        self._kept.close()
        nodes = self.get_nodes()
        quiet: list[Any] = [node for node in nodes if hasattr(node, 'lull')]
        self._lulls = [node.lull for node in quiet]
        self._drains = [node.drain for node in quiet]
        quick: dict[Any, Callable[[], object]] = {}
        for node in nodes:
            quick.update(getattr(node, 'quick', {}))
        subscriptions, timers, guards = (
            [entity for node in nodes for entity in getattr(node, name)]
            for name in ('subscriptions', 'timers', 'guards')
        )
        own = [self._changed, self._signal]
        made = self._wait_set = rclpy_implementation.WaitSet(
            *(len(subscriptions), len(guards) + len(own), len(timers), 0, 0, 0),
            self.context.handle,
        )
        self._entities = [
            *((one.handle, made.add_subscription) for one in subscriptions),
            *((one.handle, made.add_timer) for one in timers),
            *((one.handle, made.add_guard_condition) for one in (*guards, *own)),
        ]
        taken = [one.handle for one in subscriptions if one in quick]
        self._others = [one for one in self._entities if one[0] not in taken]
        for handle, _ in self._entities:
            self._kept.enter_context(handle)
        calls: dict[int, Callable[[], object]] = {}
        for entity in (*subscriptions, *timers):
            calls[entity.handle.pointer] = quick.get(entity, self._rest)
        for guard in guards:
            calls[guard.handle.pointer] = quick.get(guard, partial(self._trigger, guard))
        self._calls = calls
        return made

    def _trigger(self, guard: GuardCondition) -> None:
        """Trigger a guard condition again, whose trigger this wait took."""
        guard.trigger()
        self._rest()
