# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Tracked frames of a bag, cut where they do not go on: gaps, another count, a tracker anew."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..bags.reader import Bag, BagError, Topic
from ..bags.topics import listing
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array
from ..tracking.tracked_motion import estimate_noise, PoseNoise

POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
# stamps that fall by more are of a tracker begun anew, and not merely late [ns]
_ANEW = 1_000_000_000
# for people, where the number of spheres changes
MATCH_REMEDY = '--match follows spheres that are missing now and then'


@dataclass(frozen=True)
class Segment:
    """Frames without a gap.

    Args:
        stamps: Rising times [ns], shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7).
        ids: Of the spheres, where poses were matched; None: their places in the message.
    """

    stamps: NDArray[np.int64]
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


def find_tracked(bag: Bag, name: str | None, said: Iterable[str] = ()) -> Topic:
    """Return the topic of tracked poses: `name`, else `said` by a node, else .../tracked_poses.

    Raises:
        BagError: It is not there, is empty, or is one of several.
    """
    arrays = [topic for topic in bag.topics.values() if topic.type_name == POSE_ARRAY]
    said = set(said)
    if name is not None:
        found = [topic for topic in arrays if topic.name == name]
    else:
        found = [topic for topic in arrays if topic.name in said] or [
            topic for topic in arrays if topic.name.split('/')[-1] == 'tracked_poses'
        ]
    found = [topic for topic in found if topic.messages] or found
    wanted = name or '.../tracked_poses'
    if len(found) != 1 or not found[0].messages:
        problem = f'{len(found)} topics {wanted}' if len(found) > 1 else f'no topic {wanted}'
        problem = f'{wanted} holds no messages' if len(found) == 1 else problem
        raise BagError(
            f'{bag.path}: {problem} of type {POSE_ARRAY}; choose one with --topic. '
            f'The bag holds {listing(bag)}'
        )
    return found[0]


def cut(frames: list[PoseArrayFrame], max_gap_ns: float) -> Cut:
    """Cut frames into segments.

    Left out are frames in another coordinate frame than most, without poses, with values that are
    not finite or a quaternion of length 0, and those whose stamp does not come after the one
    before.

    Args:
        frames: In the order of recording.
        max_gap_ns: Two frames further apart are not joined [ns].
    """
    names = Counter(frame.frame_id for frame in frames)
    usual = names.most_common(1)[0][0] if names else ''
    refused: Counter[str] = Counter()
    cuts: Counter[str] = Counter()
    runs: list[list[PoseArrayFrame]] = []
    for frame in frames:
        if reason := _reason(frame, usual):
            refused[reason] += 1
            continue
        if not runs:
            runs.append([frame])
            continue
        last = runs[-1][-1]
        step = frame.stamp_ns - last.stamp_ns
        if -_ANEW <= step <= 0:
            refused['stamp'] += 1
            continue
        why = 'anew' if step < 0 else 'gap' if step > max_gap_ns else ''
        if not why and len(frame.poses) != len(last.poses):
            why = 'count'
        if why:
            cuts[why] += 1
            runs.append([frame])
        else:
            runs[-1].append(frame)
    return Cut([_segment(run) for run in runs], dict(refused), dict(cuts))


def _reason(frame: PoseArrayFrame, usual: str) -> str:
    if frame.frame_id != usual:
        return 'frame'
    if not len(frame.poses):
        return 'empty'
    if not np.isfinite(frame.poses).all():
        return 'not finite'
    if (np.linalg.norm(frame.poses[:, 3:], axis=1) < 1e-6).any():
        return 'quaternion'
    return ''


def _segment(run: list[PoseArrayFrame]) -> Segment:
    poses = np.stack([frame.poses for frame in run])
    poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
    return Segment(np.array([frame.stamp_ns for frame in run], dtype=np.int64), poses)
