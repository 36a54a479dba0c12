# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The nodes' executor: all that rclpy's calls is called, with fewer wait sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
import threading
import time
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rigid_gns_ros.node.executor import PERIOD, Quick, QuickExecutor
from std_msgs.msg import String
from std_srvs.srv import Trigger

PATIENCE = 30.0  # [s]


class Heard(Node):
    """A node that notes what it is called for; `named` are called by its own calls."""

    def __init__(self, context: Any, name: str = 'heard') -> None:
        super().__init__(name, context=context)
        self.said: list[str] = []
        self.own: Quick = {}
        self.topic = self.create_subscription(String, 'said', self.hear, 9)
        self.timer = self.create_timer(0.01, lambda: self.said.append('timer'))
        self.guard = self.create_guard_condition(lambda: self.said.append('guard'))
        self.service = self.create_service(Trigger, 'asked', self.answer)
        self.publisher = self.create_publisher(String, 'said', 9)

    @property
    def quick(self) -> Quick:
        return self.own

    def hear(self, message: Any) -> None:
        self.said.append(message.data)

    def waiting(self) -> list[str]:
        """The message that the topic holds, if there is one, as a quick call takes it."""
        with self.topic.handle:
            message = self.topic.handle.take_message(String, False)
        return [] if message is None else [message[0].data]

    def answer(self, _: Any, response: Any) -> Any:
        self.said.append('service')
        return response


class Spun:
    """A node in the executor, in a context of their own."""

    def __init__(self) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.executor = QuickExecutor(context=self.context)
        self.node = Heard(self.context)
        self.executor.add_node(self.node)

    def until(self, condition: Callable[[], Any]) -> None:
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, self.node.said
            self.executor.spin_once()


@pytest.fixture
def spun() -> Iterator[Spun]:
    made = Spun()
    yield made
    made.executor.shutdown()
    made.node.destroy_node()
    made.context.try_shutdown()


def test_all_kinds_of_callbacks_are_called(spun: Spun) -> None:
    node = spun.node
    client = node.create_client(Trigger, 'asked')
    spun.until(client.service_is_ready)
    answer = client.call_async(Trigger.Request())
    spun.until(node.publisher.get_subscription_count)
    node.publisher.publish(String(data='message'))
    node.guard.trigger()
    spun.until(lambda: {'timer', 'message', 'guard', 'service'} <= set(node.said))
    spun.until(answer.done)


def test_quick_calls_take_the_place_of_callbacks(spun: Spun) -> None:
    node = spun.node
    taken: list[str] = []

    def take() -> None:
        taken.extend(node.waiting())

    def ring() -> None:
        node.timer.cancel()
        taken.append('timer')

    node.own = {node.topic: take, node.timer: ring, node.guard: lambda: taken.append('guard')}
    spun.executor.wake()  # as where entities change
    spun.until(lambda: 'timer' in taken)
    spun.until(node.publisher.get_subscription_count)
    node.said.clear()
    for word in ('one', 'two', 'three'):
        node.publisher.publish(String(data=word))
    spun.until(lambda: {'one', 'two', 'three'} <= {*taken, *node.said})
    node.guard.trigger()
    spun.until(lambda: 'guard' in taken or 'guard' in node.said)
    # but for those that rclpy's own turn has taken, once in a while
    assert len(taken) + len(node.said) == 5 and len(taken) >= 3


def test_in_a_lull_messages_lie_in_the_queue_and_are_taken_before_other_calls(spun: Spun) -> None:
    node = spun.node
    woken: list[str] = []
    lull = 10.0

    def drain() -> None:
        node.said += node.waiting()

    node.lull = lambda: lull  # type: ignore[attr-defined]
    node.drain = drain  # type: ignore[attr-defined]
    node.own = {node.topic: lambda: woken.extend(node.waiting())}
    spun.executor.wake()
    spun.until(node.publisher.get_subscription_count)
    node.said.clear()
    node.publisher.publish(String(data='one'))
    spun.until(lambda: 'one' in node.said)
    # by a timer, or by rclpy's own turn
    before = len(node.said)
    spun.until(lambda: 'timer' in node.said[before:])
    assert not woken
    lull = 1e-3  # nothing else wakes it
    node.destroy_timer(node.timer)
    node.publisher.publish(String(data='two'))
    spun.until(lambda: 'two' in node.said)
    lull = 0.0
    for word in ('three', 'four', 'five'):
        node.publisher.publish(String(data=word))
    spun.until(lambda: {'three', 'four', 'five'} <= {*woken, *node.said})
    assert woken  # but for one that rclpy's own turn has taken


def test_services_are_answered_while_messages_keep_coming(spun: Spun) -> None:
    node = spun.node
    node.destroy_timer(node.timer)
    client = node.create_client(Trigger, 'asked')
    spun.until(client.service_is_ready)
    spun.until(node.publisher.get_subscription_count)
    timer = node.create_timer(0.001, lambda: None)

    def tick() -> None:
        timer.handle.call_timer()
        node.said.append('tick')

    node.own = {timer: tick}  # so that rclpy's turn does not come with each
    spun.executor.wake()
    spun.until(lambda: node.said.count('tick') > 50)
    for _ in range(3):
        answer = client.call_async(Trigger.Request())
        spun.until(answer.done)
    assert node.said.count('service') == 3


def test_entities_that_come_and_go_are_followed(spun: Spun) -> None:
    node = spun.node
    spun.until(lambda: 'timer' in node.said)
    node.destroy_timer(node.timer)
    node.destroy_subscription(node.topic)
    node.topic = node.create_subscription(String, 'other', node.hear, 9)
    publisher = node.create_publisher(String, 'other', 9)
    spun.until(publisher.get_subscription_count)
    publisher.publish(String(data='other'))
    spun.until(lambda: 'other' in node.said)
    spun.executor.remove_node(node)
    added = Heard(spun.context, 'added')
    spun.executor.add_node(added)
    spun.until(lambda: 'timer' in added.said)
    added.destroy_node()


def test_what_a_callback_raises_is_raised(spun: Spun) -> None:
    node = spun.node

    def fail() -> None:
        raise ValueError('as a callback does')

    node.own = {node.guard: fail}
    node.destroy_timer(node.timer)
    node.create_timer(0.0, fail)
    with pytest.raises(ValueError, match='as a callback'):
        spun.until(lambda: False)
    with pytest.raises(ValueError, match='as a callback'):
        spun.until(lambda: False)


def test_a_shutdown_from_another_thread_ends_the_wait(spun: Spun) -> None:
    node = spun.node
    node.destroy_timer(node.timer)
    threading.Timer(3 * PERIOD, spun.context.shutdown).start()
    with suppress(ExternalShutdownException):  # as rclpy's own executor raises
        rclpy.spin(node, spun.executor)
    assert not spun.context.ok()
