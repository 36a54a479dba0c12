"""The simulator's topics, and the bag that takes every message of them, byte for byte."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from geometry_msgs.msg import PoseArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_msgs.msg import Float64, String

from .bag import BagWriter

_POSE_ARRAY = 'geometry_msgs/msg/PoseArray'


class Channels:
    """Publishers and subscription of the simulator, which move bytes and no message objects.

    Args:
        node: The node that they belong to.
        on_tracked: Called with the bytes of each tracked message.
        record: Folder of the bag to make; empty: do not record.

    Raises:
        OSError: The bag cannot be made.
    """

    def __init__(self, node: Node, on_tracked: Callable[[bytes], None], record: str) -> None:
        self._node, self._on_tracked = node, on_tracked
        # before anything can be received or published
        self.bag: BagWriter | None = None
        if record:
            try:
                self.bag = BagWriter(Path(record).expanduser(), on_error=self._log_error)
            except OSError as error:
                raise type(error)(f'parameter record is {record!r}: {error}') from error
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.predicted = node.create_publisher(PoseArray, 'predicted_poses', 10)
        self.scene = node.create_publisher(String, '~/scene', latched)
        self.step_time = node.create_publisher(Float64, '~/step_time', 10)
        self.tracked = node.create_subscription(
            PoseArray, 'tracked_poses', on_tracked, qos_profile_sensor_data, raw=True
        )
        if self.bag:
            self.bag.add_topic(self.tracked.topic_name, _POSE_ARRAY, 'sensor_data')
            self.bag.add_topic(self.predicted.topic_name, _POSE_ARRAY, 'reliable')
            self.bag.add_topic(self.scene.topic_name, 'std_msgs/msg/String', 'latched')
            self.bag.add_topic(self.step_time.topic_name, 'std_msgs/msg/Float64', 'reliable')

    @property
    def topics(self) -> dict[str, str]:
        """Resolved names, for whoever reads the bag."""
        return {
            'tracked': self.tracked.topic_name,
            'predicted': self.predicted.topic_name,
            'step_time': self.step_time.topic_name,
        }

    def send(self, publisher: Publisher, cdr: bytes) -> None:
        """Publish a message and record it."""
        publisher.publish(cdr)
        self._record(publisher.topic_name, cdr)

    def received(self, cdr: bytes) -> None:
        """Record a tracked message that was accepted."""
        self._record(self.tracked.topic_name, cdr)

    def drain(self) -> None:
        """Take all tracked messages that wait, of which the executor takes one at a time."""
        while True:
            with self.tracked.handle:
                taken = self.tracked.handle.take_message(self.tracked.msg_type, self.tracked.raw)
            if taken is None:
                return
            self._on_tracked(taken[0])

    def close(self) -> str:
        """Finish the bag; returns what became of it, or an empty text."""
        if self.bag is None:
            return ''
        self.bag.close()
        text = f'bag in {self.bag.folder}'
        if self.bag.error:
            text += f', INCOMPLETE: {self.bag.error}'
        if self.bag.lost:
            text += f' ({self.bag.lost} messages not recorded)'
        return text

    def _log_error(self, text: str) -> None:
        self._node.get_logger().error(text)

    def _record(self, topic: str, cdr: bytes) -> None:
        if self.bag:
            self.bag.write(topic, cdr, self._node.get_clock().now().nanoseconds)
