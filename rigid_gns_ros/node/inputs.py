# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What trackers send: topics of several types, each message taken for the PoseArray it amounts to.

tracked_poses is in `topics`; these are beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any, TYPE_CHECKING

from geometry_msgs.msg import PointStamped, PoseStamped
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.object_arrays import OBJECT_ARRAYS, pose_array_of_objects
from rigid_gns_core.messages.other_trackers import (
    pose_array_of_cloud,
    pose_array_of_point,
    pose_array_of_pose,
)
from rigid_gns_core.messages.poses import decode_pose_array
from rigid_gns_core.tracking.single_balls import SingleBalls
from sensor_msgs.msg import PointCloud2

from .clock_jumps import simulated
from .executor import Quick
from .inbox import Inbox
from .lost_messages import LostMessages

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from rclpy.qos_overriding_options import QoSOverridingOptions

# PoseArray of a message; None: other messages are needed for it
Convert = Callable[[bytes], bytes | None]

OTHERS: dict[str, tuple[Any, Convert]] = {
    'tracked_points': (PointCloud2, pose_array_of_cloud),
    'tracked_pose': (PoseStamped, pose_array_of_pose),
    'tracked_point': (PointStamped, pose_array_of_point),
}
# with a topic for each ball
_SINGLE: dict[str, tuple[Any, Convert]] = {
    'PoseStamped': (PoseStamped, pose_array_of_pose),
    'PointStamped': (PointStamped, pose_array_of_point),
}
_OBJECTS = 'tracked_objects'
_LONGEST = 1_000_000_000  # that a message lies in the queue [ns]


def inputs_of(tracker: str, balls: Sequence[str]) -> dict[str, tuple[Any, Convert]]:
    """Topics beside tracked_poses: those that are always heard, and those of a kind of tracker.

    Args:
        tracker: Parameter `tracker`.
        balls: Names in the parameter `balls`.

    Raises:
        UserError: The package of its messages is not installed.
    """
    if tracker in OBJECT_ARRAYS:
        package, name = tracker.split('/')
        try:
            kind = getattr(import_module(f'{package}.msg'), name)
        except ImportError as error:
            raise UserError(
                f'parameter tracker is {tracker!r}, but the ROS package {package} is not '
                f'installed: {error}'
            ) from error
        return {**OTHERS, _OBJECTS: (kind, partial(_of_objects, tracker, balls))}
    if tracker not in _SINGLE:
        return OTHERS
    kind, decode = _SINGLE[tracker]
    together = SingleBalls(len(balls))
    return OTHERS | {
        topic: (kind, partial(_of_one, decode, together, ball)) for ball, topic in enumerate(balls)
    }


def _of_objects(kind: str, balls: Sequence[str], cdr: bytes) -> bytes:
    return pose_array_of_objects(cdr, kind, balls)


def _of_one(decode: Convert, together: SingleBalls, ball: int, cdr: bytes) -> bytes | None:
    found = decode_pose_array(decode(cdr) or b'')
    return together.add(ball, found.stamp_ns, found.frame_id, found.poses[0])


class Input:
    """Subscription of one topic of a tracker.

    Args:
        node: Its node.
        kind: Message type.
        name: Topic.
        profile: QoS.
        options: Which QoS policies are parameters.
        inbox: Where messages wait.
        on_tracked: Called with the bytes of each message, what converts them to a PoseArray, and
            when it came, by the node's clock [ns].
        on_lost: Called with a topic, its queue's depth and the numbers of messages that were lost
            now and so far.
        convert: See `on_tracked`.
    """

    def __init__(
        self,
        node: Node,
        kind: Any,
        name: str,
        profile: QoSProfile,
        options: QoSOverridingOptions,
        inbox: Inbox,
        on_tracked: Callable[[bytes, Convert, int], None],
        on_lost: Callable[[str, int, int, int], None],
        convert: Convert = lambda cdr: cdr,
    ) -> None:
        self._on_tracked, self._on_lost, self._convert = on_tracked, on_lost, convert
        self._node, self._inbox = node, inbox
        heard: Any = self._heard  # rclpy counts its arguments
        self._subscribe = partial(
            node.create_subscription,
            *(kind, name, heard, profile),
            raw=True,
            qos_overriding_options=options,
        )
        self._subscription: Any = None
        self.open()
        self.topic = str(node.resolve_topic_name(name))
        self.depth = profile.depth

    def open(self) -> None:
        """Subscribe, unless it is."""
        if self._subscription is None:
            self._subscription = self._subscribe()
            self.lost = LostMessages(self._subscription.get_publisher_count)

    def close(self) -> None:
        """Hear nothing until the next `open`."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    @property
    def quick(self) -> Quick:
        """See `executor`."""
        return {self._subscription: self._drain_quickly} if self._subscription is not None else {}

    def drain(self) -> None:
        """Take the waiting messages into the inbox, as many as the queue holds at most."""
        for _ in range(max(self.depth, 1)):
            if (one := self._take()) is None:
                return
            self._put(*one)

    def _drain_quickly(self) -> None:
        self.drain()
        self._inbox.settle()

    def _take(self) -> tuple[bytes, Mapping[str, Any]] | None:
        own = self._subscription
        if own is None:
            return None
        with own.handle:
            taken: tuple[bytes, Mapping[str, Any]] | None
            taken = own.handle.take_message(own.msg_type, own.raw)
        return taken

    def _heard(self, cdr: bytes, information: Mapping[str, Any]) -> None:
        """Take a message from rclpy, with what it knows of it."""
        self._put(cdr, information)
        self._inbox.settle()

    def _put(self, cdr: bytes, information: Mapping[str, Any]) -> None:
        if lost := self.lost.take(information.get('publication_sequence_number')):
            self._on_lost(self.topic, self.depth, lost, self.lost.total)
        now = self._node.get_clock().now().nanoseconds
        # it may have lain in the queue; where the middleware does not tell how long, or by another
        # clock, it has come now
        came = int(information.get('received_timestamp') or 0)
        if simulated(self._node) or not 0 <= now - came <= _LONGEST:
            came = now
        self._inbox.put(partial(self._on_tracked, cdr, self._convert, came))
