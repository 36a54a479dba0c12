# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator's topics: names, types and QoS; and the bag that records them byte for byte."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rigid_gns_core.bags.metadata import Qos
from rigid_gns_core.bags.writer import BagWriter
from std_msgs.msg import Float64, String
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import MarkerArray

from .executor import Quick
from .inbox import Inbox
from .inputs import Convert, Input
from .moving_surfaces import Listener
from .topic_names import TopicNames

# QoS policies that parameters may override, as qos_overrides./tracked_poses.subscription.depth
_CHANGEABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)


# messages of a tracker that the middleware keeps: those of a period of predictions, and more
DEPTH = 32


def sensor_data() -> QoSProfile:
    """New QoS profile: best effort; new since overrides change it in place."""
    return QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)


def overridable() -> QoSOverridingOptions:
    """Options that declare the QoS policies of a topic as parameters."""
    return QoSOverridingOptions(_CHANGEABLE)


class NodeTopics:
    """Publishers and subscription of the simulator, as serialised messages.

    Args:
        node: Node of the topics.
        on_tracked: See `Input`, as of the next.
        on_lost: See there.
        record: Folder of the bag to write; empty: no recording.
        inputs: Topics of trackers beside tracked_poses, see `inputs_of`.
        max_size: See `BagWriter` [MB].
        max_duration: See `BagWriter` [s].
        listeners: Further topics; what is accepted of them is recorded.

    Raises:
        OSError: The bag cannot be created.
        UserError: A name or a QoS parameter cannot be used.
    """

    def __init__(
        self,
        node: Node,
        on_tracked: Callable[[bytes, Convert, int], None],
        on_lost: Callable[[str, int, int, int], None],
        record: str,
        *,
        inputs: Mapping[str, tuple[Any, Convert]],
        max_size: float = 0.0,
        max_duration: float = 0.0,
        listeners: Sequence[Listener] = (),
    ) -> None:
        self._node, self._on_tracked, self._on_lost = node, on_tracked, on_lost
        self.bag: BagWriter | None = None
        self._recorded: list[
            tuple[str, str, Qos, int]
        ] = []  # name, type, QoS and depth of each recorded topic
        self._names = TopicNames(node)
        self._early: dict[str, bytes] = {}  # last messages before the first time on /clock
        self.recorded_bytes = 0  # of messages passed to the bag
        self.predicted = self._publisher(PoseArray, 'predicted_poses')
        self.trajectory = self._publisher(MultiDOFJointTrajectory, 'predicted_trajectory', depth=1)
        self.deviations = self._publisher(MultiDOFJointTrajectory, 'predicted_deviations', depth=1)
        self.branches = self._publisher(String, '~/branches', depth=1)
        self.crossings = self._publisher(String, '~/crossings')
        # what they say is in ~/crossings, too
        self.crossing = self._publisher(PoseWithCovarianceStamped, '~/crossing', recorded=False)
        self.crossing_velocity = self._publisher(
            TwistWithCovarianceStamped, '~/crossing_velocity', recorded=False
        )
        self.markers = self._publisher(MarkerArray, 'predicted_markers', recorded=False)
        self.scene = self._publisher(String, '~/scene', depth=1, latched=True)
        self.surfaces = self._publisher(
            MarkerArray, '~/surfaces', depth=1, latched=True, recorded=False
        )
        self.start = self._publisher(String, '~/start', depth=1, latched=True)
        self.learned = self._publisher(String, '~/learned', depth=1, latched=True)
        self.step_time = self._publisher(Float64, '~/step_time')
        self.diagnostics = self._publisher(DiagnosticArray, '/diagnostics')
        self._inputs: list[Input] = []
        self.inbox = Inbox()
        self.tracked = self._subscription(PoseArray, 'tracked_poses')
        for name, (kind, convert) in inputs.items():
            self._subscription(kind, name, convert)
        for name, kind, take in listeners:
            self._listen(name, kind, take)
        # last, so that a failing topic leaves no bag; no message was sent or received yet
        if record:
            self.bag = self._new_bag(record, max_size, max_duration)

    @property
    def names(self) -> dict[str, str]:
        """Resolved names of the recorded topics, by role, for ~/scene."""
        return {
            'tracked': self.tracked,
            'predicted': self.predicted.topic_name,
            'trajectory': self.trajectory.topic_name,
            'deviations': self.deviations.topic_name,
            'branches': self.branches.topic_name,
            'crossings': self.crossings.topic_name,
            'start': self.start.topic_name,
            'learned': self.learned.topic_name,
            'step_time': self.step_time.topic_name,
            'diagnostics': self.diagnostics.topic_name,
        }

    @property
    def futures_heard(self) -> bool:
        """Whether anybody hears of a future, or a bag records it."""
        told = (
            *(self.trajectory, self.crossing, self.crossings, self.crossing_velocity),
            *(self.markers, self.deviations, self.branches),
        )
        return self.bag is not None or any(one.get_subscription_count() for one in told)

    def send(self, publisher: Publisher, cdr: bytes) -> None:
        """Publish a message and record it."""
        publisher.publish(cdr)
        if self.bag is not None:
            self._record(publisher.topic_name, cdr, self._node.get_clock().now().nanoseconds)

    def received(self, cdr: bytes, time_ns: int) -> None:
        """Record an accepted message of tracked_poses, received at `time_ns` (node's clock)."""
        self._record(self.tracked, cdr, time_ns)

    @property
    def quick(self) -> Quick:
        """See `executor`."""
        return {entity: call for own in self._inputs for entity, call in own.quick.items()}

    def drain(self) -> None:
        """Process all waiting messages of trackers."""
        for own in self._inputs:
            own.drain()
        self.inbox.settle()

    @property
    def patience(self) -> float:
        """Number of messages that may lie in each queue: half of what it holds."""
        return min(own.depth for own in self._inputs) / 2

    @property
    def overtaken(self) -> bool:
        """Whether the tracker's next message is already here."""
        return len(self.inbox) > 0

    def hear(self, wanted: bool) -> None:
        """Subscribe to all topics of trackers and bodies, or to none."""
        for own in self._inputs:
            if wanted:
                own.open()
            else:
                own.close()

    def _subscription(self, kind: Any, name: str, *convert: Convert) -> str:
        """Hear a tracker's topic, recorded as a PoseArray on tracked_poses; its resolved name."""
        profile = sensor_data()
        with self._names.made(name, kind):
            own = Input(
                self._node,
                kind,
                name,
                profile,
                overridable(),
                self.inbox,
                self._on_tracked,
                self._on_lost,
                *convert,
            )
        self._inputs.append(own)
        if not convert:
            self._register(own.topic, PoseArray, profile)
        return own.topic

    def _listen(self, name: str, kind: Any, take: Callable[[bytes], bool]) -> None:
        """Subscribe to a topic that is no tracker's."""

        def heard(cdr: bytes, _: Convert, now: int) -> None:
            if take(cdr):
                self._record(own.topic, cdr, now)

        profile = sensor_data()
        with self._names.made(name, kind):
            own = Input(
                self._node, kind, name, profile, overridable(), self.inbox, heard, lambda *_: None
            )
        self._inputs.append(own)
        self._register(own.topic, kind, profile)

    def close(self) -> str:
        """Finish the bag; a line on the result, empty without a bag."""
        if self.bag is None:
            return ''
        self._record_early(self.bag, 0)  # no time came on /clock
        self.bag.close()
        text = f'bag in {self.bag.folder}'
        if self.bag.error:
            text += f', INCOMPLETE: {self.bag.error}'
        if self.bag.lost:
            text += f' ({self.bag.lost} messages not recorded)'
        return text

    def _publisher(
        self,
        kind: Any,
        name: str,
        *,
        depth: int = 10,
        latched: bool = False,
        recorded: bool = True,
    ) -> Publisher:
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        profile = QoSProfile(
            history=HistoryPolicy.KEEP_LAST,
            depth=depth,
            reliability=ReliabilityPolicy.RELIABLE,
            durability=durability,
        )
        with self._names.made(name, kind):
            publisher = self._node.create_publisher(
                kind, name, profile, qos_overriding_options=overridable()
            )
        if recorded:
            self._register(publisher.topic_name, kind, profile)
        return publisher

    def _register(self, name: str, kind: Any, profile: QoSProfile) -> None:
        """Register a topic for the bag, with its depth and the nearest of three QoS profiles."""
        package, kind_name = kind.__module__.split('.')[0], kind.__name__
        qos: Qos = 'reliable'
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            qos = 'latched'
        elif profile.reliability == ReliabilityPolicy.BEST_EFFORT:
            qos = 'sensor_data'
        self._recorded.append((name, f'{package}/msg/{kind_name}', qos, profile.depth))

    def _new_bag(self, record: str, max_size: float, max_duration: float) -> BagWriter:
        try:
            bag = BagWriter(
                Path(record).expanduser(),
                max_size=max_size,
                max_duration=max_duration,
                on_error=self._log_error,
            )
        except OSError as error:
            raise type(error)(f'parameter record is {record!r}: {error}') from error
        for topic in self._recorded:
            bag.add_topic(*topic)
        return bag

    def _log_error(self, text: str) -> None:
        self._node.get_logger().error(text)

    def _record(self, topic: str, cdr: bytes, time_ns: int) -> None:
        if self.bag is None:
            return
        if time_ns == 0:  # no /clock yet; a bag from there on would last for decades
            self._early[topic] = cdr
            return
        self._record_early(self.bag, time_ns)
        self._write(self.bag, topic, cdr, time_ns)

    def _record_early(self, bag: BagWriter, time_ns: int) -> None:
        for topic, cdr in self._early.items():
            self._write(bag, topic, cdr, time_ns)
        self._early.clear()

    def _write(self, bag: BagWriter, topic: str, cdr: bytes, time_ns: int) -> None:
        self.recorded_bytes += len(cdr)
        bag.write(topic, cdr, time_ns)
