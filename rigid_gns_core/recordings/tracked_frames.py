# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames of a bag, cut at gaps, at changes of the number of spheres and at restarts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ..bags.reader import BagError, Topic
from ..data.tracks import known_rotations, Track
from ..messages.poses import decode_pose_array, MessageError, PoseArrayFrame
from ..scenes.state import Array, as_unit
from ..tracking.pose_noise import estimate_noise, PoseNoise
from ..tracking.usable_frames import (
    FrameOrder,
    median_interval,
    RejectedFrame,
    seconds,
    Stamps,
    usable_passes,
)

# advice where the number of spheres changes
MATCH_REMEDY = '--match follows spheres that are missing now and then'


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
        if found := median_interval(self.stamps):
            return found * 1e-9
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
    """Decode the messages of a topic of poses."""
    frames, kept, problem = [], [], ''
    for index, message in enumerate(topic.messages):
        try:
            frames.append(decode_pose_array(message))
        except MessageError as error:
            problem = problem or str(error)
            continue
        kept.append(index)
    damaged = len(topic) - len(frames)
    return DecodedTopic(frames, topic.times[kept], topic.indices[kept], damaged, problem)


@dataclass(frozen=True)
class Passes:
    """Usable tracked frames, cut where the tracker restarted.

    Args:
        frames: Frames of each pass; there is at least one pass, which may be empty.
        starts: Indices in the order of recording at which the second and later passes begin.
        refused: Number of other frames, by reason.
    """

    frames: list[list[PoseArrayFrame]]
    starts: Stamps
    refused: dict[str, int]

    @classmethod
    def of(cls, tracked: DecodedTopic, frame_id: str, count: int, radius: float) -> Passes:
        """Passes of the frames that can be a reference; arguments as in `usable_passes`."""
        passes, refused = usable_passes(
            tracked.frames, tracked.times, frame_id=frame_id, radius=radius, count=count
        )
        starts = np.array([tracked.indices[pass_].min() for pass_ in passes[1:]], dtype=np.int64)
        frames = [[tracked.frames[k] for k in pass_] for pass_ in passes]
        return cls(frames or [[]], starts, dict(refused))

    def beside(self, indices: Stamps) -> tuple[list[PoseArrayFrame], dict[str, int]]:
        """Frames of the pass with most of these recording indices; the number of all others."""
        shares = np.bincount(
            np.searchsorted(self.starts, indices, side='right'), minlength=len(self.frames)
        )
        chosen = self.frames[int(np.argmax(shares))]
        others = sum(map(len, self.frames)) - len(chosen)
        return chosen, {**self.refused, **({'pass': others} if others else {})}


@dataclass(frozen=True)
class Segment:
    """Consecutive frames without a gap.

    Args:
        stamps: Rising stamps [ns], shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7).
        ids: Ids of the spheres, where poses were matched; None: their order in the message.
    """

    stamps: Stamps
    poses: Array
    ids: tuple[int, ...] | None = None

    @property
    def times(self) -> Array:
        """Times since the first frame [s], shape (k,)."""
        since: Array = (self.stamps - self.stamps[0]) * 1e-9  # differences first: exact
        return since


@dataclass(frozen=True)
class Segmentation:
    """Frames cut into segments.

    Args:
        segments: Segments in the order of recording; some may have one frame only.
        refused: Number of frames left out, by reason.
        cuts: Number of cuts, by reason: `gap`, `count`, `anew` (restart); of matched poses `set`.
        filled: Number of poses filled in where a sphere was not seen; of matched poses alone.
    """

    segments: list[Segment]
    refused: dict[str, int]
    cuts: dict[str, int]
    filled: int = 0

    def noise(self) -> PoseNoise:
        """Measurement noise of the tracker, see `estimate_noise`."""
        return estimate_noise(
            [(part.times, part.poses[..., :3], part.poses[..., 3:]) for part in self.segments]
        )


def segment_frames(tracked: DecodedTopic, radius: float, max_gap_ns: float) -> Segmentation:
    """Cut frames into segments.

    Frames in an unusual coordinate frame, and those that `usable_passes` refuses, are left out.

    Args:
        tracked: All frames.
        radius: Radius of the largest sphere [m].
        max_gap_ns: Longest time between frames of a segment [ns].
    """
    passes, refused = usable_passes(
        tracked.frames, tracked.times, frame_id=usual_frame_id(tracked), radius=radius
    )
    cuts = Counter(anew=max(len(passes) - 1, 0))
    segments = []
    for pass_ in passes:
        parts, why = split_at_gaps([tracked.frames[k] for k in pass_], max_gap_ns)
        segments += parts
        cuts += why
    return Segmentation(segments, dict(refused), dict(+cuts))


def usual_frame_id(tracked: DecodedTopic) -> str:
    """Coordinate frame of most frames; empty where there are none."""
    names = Counter(frame.frame_id for frame in tracked.frames)
    return names.most_common(1)[0][0] if names else ''


def split_at_gaps(
    frames: list[PoseArrayFrame], max_gap_ns: float, ids: tuple[int, ...] | None = None
) -> tuple[list[Segment], Counter[str]]:
    """Cut usable frames of one pass into segments, and count the cuts by reason.

    Args:
        frames: Frames of rising stamps.
        max_gap_ns: Longest time between frames of a segment [ns].
        ids: Ids of the spheres, where poses were matched.
    """
    cuts: Counter[str] = Counter()
    begin, segments = 0, []
    for k, frame in enumerate(frames[1:], 1):
        before = frames[k - 1]
        gap = frame.stamp_ns - before.stamp_ns > max_gap_ns
        if gap or len(frame.poses) != len(before.poses):
            cuts['gap' if gap else 'count'] += 1
            segments.append(_segment(frames[begin:k], ids))
            begin = k
    return ([*segments, _segment(frames[begin:], ids)] if frames else []), cuts


def _segment(run: list[PoseArrayFrame], ids: tuple[int, ...] | None) -> Segment:
    poses = np.stack([frame.poses for frame in run])
    poses[..., 3:] = as_unit(poses[..., 3:])
    return Segment(np.array([frame.stamp_ns for frame in run], dtype=np.int64), poses, ids)


def as_track(part: Segment, name: str) -> Track:
    """A segment as the tracker gave it; poses that `--match` filled in are among its own."""
    ids = range(part.poses.shape[1]) if part.ids is None else part.ids
    return Track(
        name=name,
        times=part.times,
        positions=part.poses[..., :3],
        quaternions=known_rotations(part.poses[..., 3:]),
        spheres=tuple(str(sphere) for sphere in ids),
        begin=int(part.stamps[0]) * 1e-9,
    )
