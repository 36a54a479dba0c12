# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Real nodes, real DDS: fixtures that wait for what happens and never for a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import itertools
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
from recorded_bags import falling
from rigid_gns_core.messages.poses import decode_pose_array, PoseArrayCodec, PoseArrayFrame

PATIENCE = 120.0  # [s], for a machine that is busy with other things; nothing waits that long
ROOT = Path(__file__).resolve().parents[2]


class Bench:
    """Nodes of one test in one context and one executor, and a tester that talks to them."""

    falling = staticmethod(falling)

    def __init__(self) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node

        self.context = rclpy.Context()  # not the default one: pytest keeps its signal handlers
        rclpy.init(context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.tester = Node('tester', context=self.context)
        self.executor.add_node(self.tester)
        self.nodes: list[Any] = []

    def close(self) -> None:
        for node in self.nodes:
            node.close()
        self.executor.shutdown()
        for node in [*self.nodes, self.tester]:
            node.destroy_node()
        self.context.try_shutdown()

    def add(self, kind: type, remap: tuple[str, ...] = (), **parameters: Any) -> Any:
        """Return a node of this package with parameters, spun together with the tester."""
        from rclpy.parameter import Parameter

        overrides = [Parameter(name, value=value) for name, value in parameters.items()]
        arguments = ['--ros-args', *(word for rule in remap for word in ('-r', rule))]
        node = kind(context=self.context, parameter_overrides=overrides, cli_args=arguments)
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def tracked(self, namespace: str = '') -> Tracked:
        """Return what stands for the tracker; make it after the nodes that it talks to."""
        return Tracked(self, namespace)

    def clock(self, node: Any) -> Clock:
        """Return simulated time for `node`, which has `use_sim_time`."""
        return Clock(self, node)

    def until(self, condition: Callable[[], Any], what: str = 'the condition') -> None:
        """Spin until `condition()` is true."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f'{what} did not come'
            self.executor.spin_once(timeout_sec=0.05)

    def now(self) -> int:
        return self.tester.get_clock().now().nanoseconds

    def call(self, kind: Any, name: str, **fields: Any) -> Any:
        """Response of a service."""
        client = self.tester.create_client(kind, name)
        self.until(client.service_is_ready, f'service {name}')
        future = client.call_async(kind.Request(**fields))
        self.until(future.done, f'answer of {name}')
        return future.result()


class Tracked:
    """The tester's publisher of tracked poses and what it hears of the predictions."""

    def __init__(self, bench: Bench, namespace: str = '') -> None:
        from geometry_msgs.msg import PoseArray
        from rclpy.qos import qos_profile_sensor_data
        from std_msgs.msg import Float64

        self.bench = bench
        self.predicted_bytes: list[bytes] = []
        self.publisher = bench.tester.create_publisher(
            PoseArray, f'{namespace}/tracked_poses', qos_profile_sensor_data
        )
        self.step_bytes: list[bytes] = []
        for kind, topic, heard in (
            (PoseArray, 'predicted_poses', self.predicted_bytes),
            (Float64, 'simulator/step_time', self.step_bytes),
        ):
            bench.tester.create_subscription(
                kind, f'{namespace}/{topic}', heard.append, 100, raw=True
            )
        bench.until(self.publisher.get_subscription_count, 'a subscriber of tracked poses')
        for node in bench.nodes:
            for publisher in node.publishers:
                if publisher.topic_name in (
                    f'{namespace}/predicted_poses',
                    f'{namespace}/simulator/step_time',
                ):
                    bench.until(publisher.get_subscription_count, publisher.topic_name)

    @property
    def predicted(self) -> list[PoseArrayFrame]:
        return [decode_pose_array(cdr) for cdr in self.predicted_bytes]

    def send(self, poses: np.ndarray, stamp_ns: int, frame_id: str = 'world') -> bytes:
        cdr = PoseArrayCodec(frame_id, len(poses)).encode(poses, stamp_ns)
        self.publisher.publish(cdr)
        return cdr

    def send_until(
        self, count: int, poses: np.ndarray, stamp_ns: int, frame_id: str = 'world'
    ) -> list[PoseArrayFrame]:
        """Send every 0.1 s as a tracker does, until there are `count` predictions.

        To a node in another process one message is not enough: it is best effort, and lost where
        the node has not discovered the tester yet, though the tester has discovered the node.
        """
        sent = itertools.count()
        due = 0.0

        def done() -> bool:
            nonlocal due
            if time.monotonic() >= due:
                self.send(poses, stamp_ns + next(sent) * 100_000_000, frame_id)
                due = time.monotonic() + 0.1
            return len(self.predicted_bytes) >= count

        self.bench.until(done, f'{count} predictions')
        return self.predicted[:count]

    def wait_computed(self, steps: int) -> None:
        """Wait until the model has done so many steps in all."""
        self.bench.until(lambda: len(self.step_bytes) >= steps, f'{steps} model steps')

    def wait(self, count: int) -> list[PoseArrayFrame]:
        """Return the first `count` predictions."""
        self.bench.until(lambda: len(self.predicted_bytes) >= count, f'{count} predictions')
        return self.predicted[:count]


class Clock:
    """Simulated time for the nodes of a bench: it stands still until it is set."""

    def __init__(self, bench: Bench, node: Any) -> None:
        from rosgraph_msgs.msg import Clock as Message

        self.bench, self.node, self.message = bench, node, Message
        self.publisher = bench.tester.create_publisher(Message, '/clock', 1)
        bench.until(self.publisher.get_subscription_count, 'a subscriber of /clock')

    def set(self, time_ns: int) -> None:
        """Set the time and wait until the node knows it."""
        message = self.message()
        message.clock.sec, message.clock.nanosec = divmod(time_ns, 10**9)
        self.publisher.publish(message)
        clock = self.node.get_clock()
        self.bench.until(lambda: clock.now().nanoseconds == time_ns, 'the simulated time')


@pytest.fixture
def log(capfd: pytest.CaptureFixture[str]) -> Callable[[], str]:
    """Everything that nodes in this process have logged so far in the test."""
    seen: list[str] = []

    def read() -> str:
        captured = capfd.readouterr()
        seen.append(captured.out + captured.err)
        return ''.join(seen)

    return read


@pytest.fixture
def bench() -> Iterator[Bench]:
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    made = Bench()
    yield made
    made.close()


class NodeRun:
    """A node in a process of its own; `output` holds its log so far."""

    def __init__(self, command: list[str], log: Path, environment: dict[str, str]) -> None:
        self.log = log
        with log.open('wb') as file:
            self.process = subprocess.Popen(
                command,
                stdout=file,
                stderr=subprocess.STDOUT,
                env=environment,
                cwd=ROOT,
                start_new_session=True,
            )

    @property
    def output(self) -> str:
        return self.log.read_text(errors='replace')

    def wait_for(self, text: str) -> None:
        end = time.monotonic() + PATIENCE
        while text not in self.output:
            assert self.process.poll() is None, self.output
            assert time.monotonic() < end, f'{text!r} did not come:\n{self.output}'
            time.sleep(0.02)

    def signal(self, number: int) -> None:
        os.killpg(self.process.pid, number)

    def exit_code(self) -> int:
        return self.process.wait(PATIENCE)


@pytest.fixture
def run_process(tmp_path: Path) -> Iterator[Callable[..., NodeRun]]:
    """Start `python -m MODULE --ros-args ...`, or a command, and end it after the test."""
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    runs: list[NodeRun] = []

    def start(
        module: str | list[str], *arguments: str, environment: dict[str, str] | None = None
    ) -> NodeRun:
        command = [sys.executable, '-m', module] if isinstance(module, str) else module
        if arguments:
            command = [*command, '--ros-args', *arguments]
        log = tmp_path / f'process_{len(runs)}.log'
        runs.append(NodeRun(command, log, environment or dict(os.environ)))
        return runs[-1]

    yield start
    for run in runs:
        if run.process.poll() is None:
            run.signal(signal.SIGKILL)
            run.process.wait()


@pytest.fixture(scope='session')
def message_package(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Any]:
    """Return a function of the name of a package, such as tf2_msgs: its module `msg`."""
    pytest.importorskip('rclpy', reason='ROS 2 is not installed')
    import message_packages

    folder = tmp_path_factory.mktemp('messages')
    return lambda name: message_packages.message_package(name, folder)
