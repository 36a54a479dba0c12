# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames of a bag, cut where they do not go on: gaps, another count, a tracker anew."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ..bags.reader import BagError, Topic
from ..messages.poses import decode_pose_array, MessageError, PoseArrayFrame
from ..scenes.state import Array
from ..tracking.pose_noise import estimate_noise, PoseNoise
from ..tracking.usable_frames import median_interval, Stamps, usable_passes

# for people, where the number of spheres changes
MATCH_REMEDY = '--match follows spheres that are missing now and then'


@dataclass(frozen=True)
class Decoded:
    """Messages of a topic of poses that are whole.

    Args:
        frames: Their content.
        times: Log times [ns], shape (frames,).
        places: Places in the recording, shape (frames,).
        damaged: Number of messages that are not whole.
    """

    frames: list[PoseArrayFrame]
    times: Stamps
    places: Stamps
    damaged: int

    @property
    def stamps(self) -> Stamps:
        """Stamps [ns], shape (frames,)."""
        return np.array([frame.stamp_ns for frame in self.frames], dtype=np.int64)

    def interval(self, where: str) -> float:
        """Return the median time between two frames [s].

        Raises:
            BagError: There are none that follow each other.
        """
        if found := median_interval(self.stamps):
            return found * 1e-9
        raise BagError(
            f'{where} holds {len(self.frames)} frames, no two of which follow each other; record '
            'for longer'
        )


def decode_topic(topic: Topic) -> Decoded:
    """Frames of a topic."""
    frames, kept = [], []
    for index, message in enumerate(topic.messages):
        try:
            frames.append(decode_pose_array(message))
        except MessageError:
            continue
        kept.append(index)
    return Decoded(frames, topic.times[kept], topic.places[kept], len(topic) - len(frames))


@dataclass(frozen=True)
class Passes:
    """Usable tracked frames, cut where the tracker began anew.

    Args:
        frames: Of each pass, at least one.
        starts: Places in the recording where the second and later ones begin.
        refused: Number of other frames, by reason.
    """

    frames: list[list[PoseArrayFrame]]
    starts: Stamps
    refused: dict[str, int]

    @classmethod
    def of(cls, tracked: Decoded, frame_id: str, count: int, radius: float) -> Passes:
        """Tracked frames that can be a reference; other arguments as of `usable_passes`."""
        passes, refused = usable_passes(
            tracked.frames, tracked.times, frame_id=frame_id, radius=radius, count=count
        )
        starts = np.array([tracked.places[one].min() for one in passes[1:]], dtype=np.int64)
        frames = [[tracked.frames[k] for k in one] for one in passes]
        return cls(frames or [[]], starts, dict(refused))

    def beside(self, places: Stamps) -> tuple[list[PoseArrayFrame], dict[str, int]]:
        """Frames of the pass with most of these places, and the number of all others."""
        shares = np.bincount(
            np.searchsorted(self.starts, places, side='right'), minlength=len(self.frames)
        )
        chosen = self.frames[int(np.argmax(shares))]
        others = sum(map(len, self.frames)) - len(chosen)
        return chosen, {**self.refused, **({'pass': others} if others else {})}


@dataclass(frozen=True)
class Segment:
    """Frames without a gap.

    Args:
        stamps: Rising times [ns], shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7).
        ids: Of the spheres, where poses were matched; None: their places in the message.
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
class Cut:
    """What became of the frames.

    Args:
        segments: Stretches, in the order of recording; some may be of one frame.
        refused: Number of frames left out, by reason.
        cuts: Number of cuts, by reason: `gap`, `count`, `anew`; of matched poses also `set`.
        filled: Number of poses put in where a sphere was not seen; of matched poses alone.
    """

    segments: list[Segment]
    refused: dict[str, int]
    cuts: dict[str, int]
    filled: int = 0

    def noise(self) -> PoseNoise:
        """Noise of the tracker, see `estimate_noise`."""
        return estimate_noise(
            [(part.times, part.poses[..., :3], part.poses[..., 3:]) for part in self.segments]
        )


def cut(tracked: Decoded, radius: float, max_gap_ns: float) -> Cut:
    """Cut frames into segments.

    Left out are frames in another coordinate frame than most, and those that `usable_passes`
    refuses.

    Args:
        tracked: All frames.
        radius: Of the largest sphere [m].
        max_gap_ns: Two frames further apart are not joined [ns].
    """
    passes, refused = usable_passes(
        tracked.frames, tracked.times, frame_id=usual_frame_id(tracked), radius=radius
    )
    cuts = Counter(anew=max(len(passes) - 1, 0))
    segments = []
    for one in passes:
        parts, why = without_gaps([tracked.frames[k] for k in one], max_gap_ns)
        segments += parts
        cuts += why
    return Cut(segments, dict(refused), dict(+cuts))


def usual_frame_id(tracked: Decoded) -> str:
    """Coordinate frame of most frames; empty where there are none."""
    names = Counter(frame.frame_id for frame in tracked.frames)
    return names.most_common(1)[0][0] if names else ''


def without_gaps(
    frames: list[PoseArrayFrame], max_gap_ns: float, ids: tuple[int, ...] | None = None
) -> tuple[list[Segment], Counter[str]]:
    """Cut usable frames of one pass into segments; and count the cuts, by reason.

    Args:
        frames: Of rising stamps.
        max_gap_ns: Two frames further apart are not joined [ns].
        ids: Of the spheres.
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
    poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
    return Segment(np.array([frame.stamp_ns for frame in run], dtype=np.int64), poses, ids)
