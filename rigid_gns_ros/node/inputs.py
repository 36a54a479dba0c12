# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What trackers send: topics of several types, each message taken for the PoseArray it amounts to.

tracked_poses is in `topics`; these are beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TYPE_CHECKING

from geometry_msgs.msg import PointStamped, PoseStamped
from rigid_gns_core.messages.other_trackers import (
    pose_array_of_cloud,
    pose_array_of_point,
    pose_array_of_pose,
)
from sensor_msgs.msg import PointCloud2

from .lost_messages import LostMessages

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile
    from rclpy.qos_overriding_options import QoSOverridingOptions

Convert = Callable[[bytes], bytes]

OTHERS: dict[str, tuple[Any, Convert]] = {
    'tracked_points': (PointCloud2, pose_array_of_cloud),
    'tracked_pose': (PoseStamped, pose_array_of_pose),
    'tracked_point': (PointStamped, pose_array_of_point),
}


class Input:
    """Subscription of one topic of a tracker.

    Args:
        node: Its node.
        kind: Message type.
        name: Topic.
        profile: QoS.
        options: Which QoS policies are parameters.
        on_tracked: Called with the bytes of each message, and what converts them to a PoseArray.
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
        on_tracked: Callable[[bytes, Convert], None],
        on_lost: Callable[[str, int, int, int], None],
        convert: Convert = lambda cdr: cdr,
    ) -> None:
        self._on_tracked, self._on_lost, self._convert = on_tracked, on_lost, convert
        heard: Any = self._heard  # rclpy counts its arguments
        self.subscription = node.create_subscription(
            kind, name, heard, profile, raw=True, qos_overriding_options=options
        )
        self.lost = LostMessages(self.subscription.get_publisher_count)
        self.depth = profile.depth

    def drain(self) -> None:
        """Process all waiting messages; the executor takes one at a time."""
        own = self.subscription
        while True:
            with own.handle:
                taken = own.handle.take_message(own.msg_type, own.raw)
            if taken is None:
                return
            self._heard(*taken)

    def _heard(self, cdr: bytes, information: Mapping[str, Any]) -> None:
        """Take a message, with what rclpy knows of it."""
        if lost := self.lost.take(information.get('publication_sequence_number')):
            self._on_lost(self.subscription.topic_name, self.depth, lost, self.lost.total)
        self._on_tracked(cdr, self._convert)
