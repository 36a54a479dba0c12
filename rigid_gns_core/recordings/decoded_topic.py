# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decoded messages of a topic of poses, in their order, and why they cannot be used."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ..bags.reader import BagError, PASS, Topic
from ..messages.poses import decode_pose_array, MessageError, PoseArrayFrame
from ..messages.tracker_types import AS_POSE_ARRAY
from ..tracking.rejected_frame import RejectedFrame
from ..tracking.usable_frames import (
    FrameOrder,
    median_interval,
    MEMORY,
    RESTART_FRAMES,
    seconds,
    Stamps,
)


@dataclass(frozen=True)
class DecodedTopic:
    """Decoded messages of a topic of poses.

    Args:
        frames: Content of the intact messages.
        times: Log times [ns], shape (frames,).
        indices: Index of each in the order of recording, shape (frames,).
        damaged: Number of damaged messages.
        problem: What is wrong with the first of them; empty: nothing.
    """

    frames: list[PoseArrayFrame]
    times: Stamps
    indices: Stamps
    damaged: int
    problem: str = ''

    @property
    def stamps(self) -> Stamps:
        """Stamps [ns], shape (frames,)."""
        return np.array([frame.stamp_ns for frame in self.frames], dtype=np.int64)

    def interval(self, where: str) -> float:
        """Median interval between frames [s].

        Raises:
            BagError: No two frames follow each other; the message begins with `where`.
        """
        stamps = self.stamps
        if median_interval(stamps):
            return _spacing(stamps) * 1e-9
        raise BagError(f'{where} {self._why_no_interval()}')

    def _why_no_interval(self) -> str:
        """Why no two frames follow each other."""
        count = len(self.frames)
        if self.damaged:
            return (
                f'holds {count + self.damaged} messages, of which {self.damaged} cannot be read; '
                f'the first: {self.problem}'
            )
        if count > 1:
            return (
                f'holds {count} frames with stamps that do not rise: all are '
                f'{seconds(self.frames[0].stamp_ns)} s'
                if len(set(self.stamps.tolist())) == 1
                else f'holds {count} frames with stamps that do not rise'
            ) + '; expected the time of each measurement in header.stamp'
        return f'holds {count} frames, no two of which follow each other; record for longer'

    def refusal(self, radius: float) -> str:
        """Why frames are refused that hold no poses that can be used, by the first; else empty.

        Args:
            radius: Radius of the largest sphere [m].
        """
        order = FrameOrder(usual_frame_id(self), radius)
        problems = []
        for frame in self.frames:
            try:
                order.check(frame)
            except RejectedFrame as error:
                problems.append(str(error))
        if not problems:
            return ''
        return (
            f'{len(problems)} of {len(self.frames)} frames are refused; the first: {problems[0]}'
        )


def decode_topic(topic: Topic) -> DecodedTopic:
    """Decode the messages of a topic of a tracker, in the order of `arrival`."""
    frames, kept, problem = [], [], ''
    as_pose_array = AS_POSE_ARRAY[topic.type_name]
    for index in arrival(topic).tolist():
        try:
            frames.append(decode_pose_array(as_pose_array(topic.messages[index])))
        except MessageError as error:
            problem = problem or str(error)
            continue
        kept.append(index)
    damaged = len(topic) - len(frames)
    return DecodedTopic(frames, topic.times[kept], topic.indices[kept], damaged, problem)


def arrival(topic: Topic) -> Stamps:
    """Indices of the messages by log time, but for a clock that was set back, shape (messages,).

    A bag holds what came after the step behind what came before, with times that go on from an
    earlier one; sorted by time, frames of both would be mixed.
    """
    recorded = np.argsort(topic.indices, kind='stable')
    times = topic.times[recorded]
    passes = np.zeros(len(times), dtype=np.int64)
    for k in np.flatnonzero(np.diff(times) < 0) + 1:
        before = times[:k][passes[:k] == passes[k]].max()
        after = times[k : k + RESTART_FRAMES]
        # a single one that is out of order is followed by later ones
        goes_on = len(after) == RESTART_FRAMES and (np.diff(after) > 0).all()
        if times[k] < before - PASS or (goes_on and after[-1] < before):
            passes[k:] += 1
    order: Stamps = recorded[np.lexsort((times, passes))]
    return order


def _spacing(stamps: Stamps) -> float:
    """Median time of a frame since that before it [ns], by stamp; some may arrive late.

    Those before it are sought among frames that arrived about then, as a clock that was set back,
    or a bag of two passes, has stamps that lie in between those of long before.
    """
    since = np.full(len(stamps), np.inf)
    for shift in range(1, MEMORY):
        apart = (stamps[shift:] - stamps[:-shift]).astype(np.float64)
        later, earlier = since[shift:], since[:-shift]
        np.minimum(later, np.where(apart > 0, apart, np.inf), out=later)
        np.minimum(earlier, np.where(apart < 0, -apart, np.inf), out=earlier)
    return float(np.median(since[np.isfinite(since)]))


def usual_frame_id(tracked: DecodedTopic) -> str:
    """Coordinate frame of most frames; empty where there are none."""
    names = Counter(frame.frame_id for frame in tracked.frames)
    return names.most_common(1)[0][0] if names else ''
