# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames of a bag, cut at gaps, at changes of the number of spheres and at restarts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .decoded_topic import DecodedTopic, usual_frame_id
from .short_gaps import complete, fill_short_gaps
from ..data.tracks import known_rotations, Track
from ..messages.poses import PoseArrayFrame
from ..scenes.scene import Scene
from ..scenes.state import Array, as_unit
from ..tracking.lost_spheres import lost_at_origin, measured
from ..tracking.pose_noise import estimate_noise, PoseNoise
from ..tracking.unknown_rotations import whole_rotations
from ..tracking.usable_frames import Stamps, usable_passes

# advice where the number of spheres changes
MATCH_REMEDY = '--match follows spheres that are missing now and then'


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
        frames = []
        for pass_ in passes:
            # a lost sphere cannot be compared; poses are interpolated between the frames around
            whole = [k for k, seen in zip(pass_, _seen(tracked, pass_), strict=True) if seen]
            refused['unseen'] += len(pass_) - len(whole)
            chosen = [tracked.frames[k] for k in whole]
            poses = np.array([frame.poses for frame in chosen]).reshape(-1, count, 7)
            turns = whole_rotations(poses[..., 3:])
            places = np.concatenate([poses[..., :3], turns], axis=-1)
            frames.append([replace(f, poses=p) for f, p in zip(chosen, places, strict=True)])
        return cls(frames or [[]], starts, dict(+refused))

    def beside(self, indices: Stamps) -> tuple[list[PoseArrayFrame], dict[str, int]]:
        """Frames of the pass with most of these recording indices; the number of all others."""
        shares = np.bincount(
            np.searchsorted(self.starts, indices, side='right'), minlength=len(self.frames)
        )
        chosen = self.frames[int(np.argmax(shares))]
        others = sum(map(len, self.frames)) - len(chosen)
        return chosen, {**self.refused, **({'pass': others} if others else {})}


def _seen(tracked: DecodedTopic, indices: list[int]) -> NDArray[np.bool_]:
    """Whether each of these frames, of one number of spheres, shows them all, shape (k,)."""
    if not indices:
        return np.zeros(0, dtype=np.bool_)
    poses = np.stack([tracked.frames[k].poses for k in indices])
    lost = ~measured(poses) | lost_at_origin(poses[..., :3])
    return np.asarray(~lost.any(axis=-1))


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
        filled: Number of poses filled in where a sphere was not seen.
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


def segment_frames(tracked: DecodedTopic, scene: Scene, max_gap_ns: float) -> Segmentation:
    """Cut frames into segments.

    Frames in an unusual coordinate frame, and those that `usable_passes` refuses, are left out.
    Spheres that were lost in up to two frames are filled in; frames with longer gaps are left out.

    Args:
        tracked: All frames.
        scene: Gives gravity and radii.
        max_gap_ns: Longest time between frames of a segment [ns].
    """
    passes, refused = usable_passes(
        tracked.frames,
        tracked.times,
        frame_id=usual_frame_id(tracked),
        radius=float(np.max(scene.radius)),
    )
    cuts = Counter(anew=max(len(passes) - 1, 0))
    segments: list[Segment] = []
    filled = 0
    for pass_ in passes:
        parts, why = split_at_gaps([tracked.frames[k] for k in pass_], max_gap_ns)
        cuts += why
        for part in parts:
            if np.isfinite(part.poses).all():
                segments.append(part)
                continue
            whole, count = _filled(part, scene)
            filled += count
            refused['unseen'] += len(part.stamps) - len(whole)
            again, why = split_at_gaps(whole, max_gap_ns)
            segments += again
            cuts += why
    return Segmentation(segments, dict(+refused), dict(+cuts), filled)


def _filled(part: Segment, scene: Scene) -> tuple[list[PoseArrayFrame], int]:
    """The frames in which all spheres are known, and the number of poses filled in."""
    poses = part.poses.copy()
    known = complete(poses)
    noise = estimate_noise([(part.times[known], poses[known, :, :3], poses[known, :, 3:])])
    count = fill_short_gaps(part.stamps, poses, scene, noise.position)
    frames = [PoseArrayFrame(int(part.stamps[k]), '', poses[k]) for k in complete(poses)]
    return frames, count


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
    poses[~measured(poses) | lost_at_origin(poses[..., :3])] = np.nan
    poses[..., 3:] = as_unit(whole_rotations(poses[..., 3:]))
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
