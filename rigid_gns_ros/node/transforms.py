# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Transforms of tf: what comes in other coordinate frames waits for theirs."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
import time
from typing import Any, TYPE_CHECKING

from rclpy.qos import DurabilityPolicy, QoSProfile
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.messages.transforms import decode_transforms, Transform
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.rejected_frame import RejectedFrame
from rigid_gns_core.tracking.single_balls import SingleBalls
from rigid_gns_core.tracking.transform_buffer import NoTransform, TransformBuffer

if TYPE_CHECKING:
    from rclpy.node import Node

_DEPTH = 100  # of tf2's own listener


@dataclass(frozen=True)
class _Waiting:
    """What waits for a transform since a time [s]; `find` raises NoTransform without it."""

    find: Callable[[], Any]
    accept: Callable[[Any], None]
    refuse: Callable[[UserError], None]
    since: float


class Transforms:
    """Transforms what comes in other frames into the scene's coordinate frame, in its order.

    /tf is heard from the first frame on that needs it, as a robot sends much on it.

    Args:
        node: Node that hears /tf_static and /tf.
        frame_id: Coordinate frame of the scene.
        timeout: How long a frame waits for its transform [s].
        accept: Called with each transformed frame.
        refuse: Called with the error of each frame without a transform.
        warn: Called with a kind and a text of what on /tf cannot be used.
    """

    def __init__(
        self,
        node: Node,
        frame_id: str,
        timeout: float,
        *,
        accept: Callable[[PoseArrayFrame], None],
        refuse: Callable[[UserError], None],
        warn: Callable[[str, str], None],
    ) -> None:
        self._node, self._frame_id, self._timeout = node, frame_id, timeout
        self._accept, self._refuse, self._warn = accept, refuse, warn
        self._waiting: dict[str, deque[_Waiting]] = {}  # in order, by who sent it
        self.buffer = TransformBuffer()
        self._kind = _message_type()
        self._hears_all = False
        self._balls: dict[str, int] = {}  # by frame of tf
        self._together = SingleBalls(0)
        self._take_balls: Callable[[bytes], None]
        self._watched: dict[str, int] = {}  # newest stamp that was told, by frame of tf [ns]
        self._told: Callable[[str, int, Array], None]
        if self._kind is not None:
            self._hear('/tf_static', static=True)

    def follow(self, balls: Sequence[str], take: Callable[[bytes], None]) -> None:
        """Take frames of tf for balls.

        Args:
            balls: Names of the frames, in the order of the poses.
            take: Called with each PoseArray, in the frame of their parents.

        Raises:
            UserError: tf cannot be heard.
        """
        if self._kind is None:
            raise UserError("parameter tracker is 'tf', which needs the ROS package tf2_msgs")
        self._balls = {name.lstrip('/'): ball for ball, name in enumerate(balls)}
        self._together, self._take_balls = SingleBalls(len(balls)), take
        self._hear_all()

    def watch(self, frames: Sequence[str], told: Callable[[str, int, Array], None]) -> None:
        """Tell where frames of tf are in the scene's coordinate frame, with each message on /tf.

        Args:
            frames: Their names.
            told: Called with a name, a stamp [ns] and a pose, shape (7,).

        Raises:
            UserError: tf cannot be heard.
        """
        if self._kind is None:
            raise UserError(
                f'moving_surfaces has the frame {frames[0]!r} of tf, which needs the ROS package '
                'tf2_msgs'
            )
        self._watched, self._told = dict.fromkeys(frames, -1), told
        self._hear_all()

    def put(self, frame: PoseArrayFrame) -> None:
        """Take a frame in another coordinate frame.

        Raises:
            RejectedFrame: tf cannot be heard.
        """
        self._wait(
            '',
            frame.frame_id,
            lambda: self.buffer.in_frame(frame, self._frame_id),
            self._accept,
            self._refuse,
        )

    def find(
        self,
        sender: str,
        frame_id: str,
        stamp_ns: int,
        found: Callable[[Array], None],
        refuse: Callable[[UserError], None],
    ) -> None:
        """Find the pose of a frame in the scene's, shape (7,), now or within the timeout.

        Args:
            sender: Who needs it; what one sender needs is found in the order of its calls.
            frame_id: The frame.
            stamp_ns: Time of the pose [ns].
            found: Called with the pose.
            refuse: Called with the error, where it does not come.

        Raises:
            RejectedFrame: tf cannot be heard.
        """
        self._wait(
            sender,
            frame_id,
            lambda: self.buffer.lookup(self._frame_id, frame_id, stamp_ns),
            found,
            refuse,
        )

    def _wait(
        self,
        sender: str,
        frame_id: str,
        find: Callable[[], Any],
        accept: Callable[[Any], None],
        refuse: Callable[[UserError], None],
    ) -> None:
        if self._kind is None:
            raise RejectedFrame(
                'frame',
                f'its frame is {frame_id!r}, expected {self._frame_id!r} (parameter '
                'frame_id); to transform it by tf, install the ROS package tf2_msgs',
            )
        self._hear_all()
        queue = self._waiting.setdefault(sender, deque())
        queue.append(_Waiting(find, accept, refuse, time.monotonic()))
        self.resolve()

    def resolve(self) -> None:
        """Pass on that whose transforms are known, and refuse what waited too long."""
        for queue in list(self._waiting.values()):
            while queue:
                first = queue[0]
                try:
                    found = first.find()
                except NoTransform as error:
                    if error.may_come and time.monotonic() - first.since < self._timeout:
                        break
                    queue.popleft()
                    first.refuse(error)
                    continue
                queue.popleft()
                first.accept(found)

    def clear(self) -> None:
        """Forget all that depends on time, as after a jump of the clock."""
        self.buffer.clear()
        for queue in self._waiting.values():
            queue.clear()

    def _hear_all(self) -> None:
        if not self._hears_all:
            self._hears_all = True
            self._hear('/tf', static=False)

    def _hear(self, topic: str, *, static: bool) -> None:
        profile = QoSProfile(depth=_DEPTH)
        if static:
            profile.durability = DurabilityPolicy.TRANSIENT_LOCAL

        def heard(cdr: bytes) -> None:
            try:
                self._take(decode_transforms(cdr), static=static)
            except UserError as error:
                self._warn('tf', f'message on {topic} not used: {error}')

        called: Any = heard  # rclpy has other types for raw messages
        self._node.create_subscription(self._kind, topic, called, profile, raw=True)

    def _take(self, transforms: list[Transform], *, static: bool) -> None:
        if problem := self.buffer.add(transforms, static=static):
            self._warn('tf', f'on {"/tf_static" if static else "/tf"} {problem}')
        self.resolve()
        for stamp in () if static else sorted({one.stamp_ns for one in transforms}):
            self._look(stamp)
        for one in () if static else transforms:
            ball = self._balls.get(one.child.lstrip('/'))
            if ball is None:
                continue
            cdr = self._together.add(ball, one.stamp_ns, one.parent.lstrip('/'), one.pose)
            if cdr is not None:
                self._take_balls(cdr)

    def _look(self, stamp_ns: int) -> None:
        """Tell where the watched frames are at a time, as far as that is known by now."""
        for name, newest in self._watched.items():
            if stamp_ns == newest:
                continue
            with suppress(NoTransform):
                pose = self.buffer.lookup(self._frame_id, name, stamp_ns)
                self._watched[name] = stamp_ns
                self._told(name, stamp_ns, pose)


def _message_type() -> Any:
    """Type of the messages of tf; None: it is not installed, as with ROS from wheels."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return None
    return TFMessage
