# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balls that come one by one, each with a stamp of its own, put together into frames."""

from __future__ import annotations

import numpy as np

from ..messages.poses import PoseArrayCodec, PoseArrayFrame
from ..scenes.state import Array

# poses whose stamps are no further apart are of one frame of the tracker [ns]
SAME_NS = 1_000_000
# a stamp so much older is of a clock that was set, or a tracker that restarted [ns]
_RESTART_NS = 1_000_000_000


class SingleBalls:
    """Poses of `count` balls, each of which comes in a message of its own.

    A frame is complete when it has all of them. Where one is missing, it is when the next begins,
    and NaN stands for that ball. One that waits when stamps go back is dropped: among the frames
    after that it would be from the future, and these late.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._frame: PoseArrayFrame | None = None
        self._there = np.zeros(count, dtype=np.bool_)

    def add(self, ball: int, stamp_ns: int, frame_id: str, pose: Array) -> bytes | None:
        """Add the pose of a ball, shape (7,); the PoseArray of a frame that it completes or ends.

        Raises:
            MessageError: The frame cannot be a message.
        """
        ended = None
        frame = self._frame
        if frame is not None and (
            self._there[ball]
            or abs(stamp_ns - frame.stamp_ns) > SAME_NS
            or frame_id != frame.frame_id
        ):
            ended = frame if frame.stamp_ns - stamp_ns < _RESTART_NS else None
            self._frame = None
        if self._frame is None:
            self._frame = PoseArrayFrame(stamp_ns, frame_id, np.full((self._count, 7), np.nan))
            self._there[:] = False
        self._frame.poses[ball], self._there[ball] = pose, True
        if self._there.all():  # never beside one that ended: that had a single ball
            ended, self._frame = self._frame, None
        if ended is None:
            return None
        return PoseArrayCodec(ended.frame_id, self._count).encode(ended.poses, ended.stamp_ns)
