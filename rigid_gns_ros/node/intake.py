# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Frames of a tracker on their way in: converted, moved by tf, checked, recorded and counted."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, TYPE_CHECKING

from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.poses import (
    decode_pose_array,
    PoseArrayCodec,
    PoseArrayFrame,
    restamped,
)
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.tracking.usable_frames import RejectedFrame, RESTART_FRAMES
from rigid_gns_core.tracking.window import TrackingWindow

from .diagnostics import Diagnostics
from .inputs import Convert
from .lost_messages import lost_text
from .odd_poses import OddPoses
from .silence import RESTARTED
from .transforms import Transforms

if TYPE_CHECKING:
    from rclpy.node import Node

# reasons for which frames of a restarted tracker are first refused
STAMPS = ('duplicate', 'late', 'ahead')


class Intake:
    """Brings the frames of a tracker into the window.

    `active`: whether frames are taken; `record` is called with the bytes of each accepted
    PoseArray and its time of arrival [ns].

    Args:
        node: Gives the clock, and hears tf.
        scene: Surfaces and spheres.
        window: Takes the frames.
        parameters: Parameters of the node by name.
        diagnostics: Counts them.
        warn: Called with a kind and a sentence, possibly often.
        before: Called with stamp and time of arrival of a frame before the window has it [ns].
        accepted: Called after that, with the time of arrival [ns] and whether the tracker has
            restarted.
    """

    def __init__(
        self,
        node: Node,
        scene: Scene,
        window: TrackingWindow,
        parameters: Mapping[str, Any],
        *,
        diagnostics: Diagnostics,
        warn: Callable[[str, str], None],
        before: Callable[[int, int], None],
        accepted: Callable[[int, bool], None],
    ) -> None:
        self._node, self._window, self._frame_id = node, window, str(parameters['frame_id'])
        self._latency_ns = round(float(parameters['latency']) * 1e9)
        self._diagnostics, self._warn = diagnostics, warn
        self._before, self._accepted = before, accepted
        self.active = False
        self.record: Callable[[bytes, int], None]
        self._odd = OddPoses(scene, window, warn)
        self._refused: deque[tuple[bytes, int]] = deque(maxlen=RESTART_FRAMES - 1)  # for STAMPS
        self.transforms = Transforms(
            node,
            self._frame_id,
            float(parameters['transform_timeout']),
            accept=self._on_transformed,
            refuse=self._refuse,
            warn=warn,
        )

    def take(self, cdr: bytes, convert: Convert, now: int) -> None:
        """Take a message that arrived at a time [ns], which `convert` makes a PoseArray."""
        try:
            if now == 0:
                raise RejectedFrame('clock', 'use_sim_time is set, but no /clock has come yet')
            converted = convert(cdr)
            if converted is None:
                return
            cdr = restamped(converted, -self._latency_ns)
            frame = decode_pose_array(cdr)
            if frame.frame_id not in ('', self._frame_id):
                self.transforms.put(frame)
                return
        except UserError as error:
            self._refuse(error)
            return
        self._add(cdr, frame, now)

    def lost(self, topic: str, depth: int, count: int, total: int) -> None:
        """Note messages that never came to `take`."""
        self._diagnostics.frames_lost(count)
        self._warn('lost', lost_text(topic, depth, total))

    def clear(self) -> None:
        """Begin anew, as with another tracker."""
        self._odd.clear()

    def _on_transformed(self, frame: PoseArrayFrame) -> None:
        """Process a frame that tf moved to the scene's coordinate frame; so it is recorded."""
        if not self.active:
            return
        cdr = PoseArrayCodec(self._frame_id, len(frame.poses)).encode(frame.poses, frame.stamp_ns)
        self._add(cdr, frame, self._node.get_clock().now().nanoseconds)

    def _add(self, cdr: bytes, frame: PoseArrayFrame, now: int) -> None:
        self._before(frame.stamp_ns, now)
        try:
            restarted = self._window.add(frame, now)
        except UserError as error:
            if getattr(error, 'kind', '') in STAMPS:
                self._refused.append((cdr, now))
            self._refuse(error)
            return
        if restarted:  # the frames refused before are accepted with this one
            for earlier, arrival in self._refused:
                self.record(earlier, arrival)
        self._refused.clear()
        if self._window.lost:
            self._warn('unseen', f'taken as not seen: {self._window.lost}')
        self.record(cdr, now)
        self._diagnostics.frame_accepted()
        self._odd.take(frame)
        if restarted:
            self._odd.clear()
            self._warn('restarted', RESTARTED)
        self._accepted(now, restarted)

    def _refuse(self, error: UserError) -> None:
        self._diagnostics.frame_rejected(str(error))
        self._warn(getattr(error, 'kind', 'bytes'), f'tracked message rejected: {error}')
