# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames without identities: poses associated with tracks, as in the node."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from .decoded_topic import DecodedTopic, usual_frame_id
from .replay import replay_starts
from .short_gaps import complete, fill_short_gaps
from .tracked_frames import Segmentation, split_at_gaps
from ..forecasts.forecaster import Forecaster
from ..forecasts.learned_scene import LearnedScene
from ..forecasts.starts import Start
from ..forecasts.window_setup import window_of
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array
from ..tracking.unknown_rotations import whole_rotations
from ..tracking.usable_frames import RejectedFrame
from ..tracking.window import TrackingWindow


@dataclass(frozen=True)
class _Matched:
    """The tracks of a frame.

    Args:
        stamp_ns: Stamp of the frame [ns].
        epoch: Number of times that the window was emptied before.
        ids: Ids of the tracks, within this epoch.
        poses: Position [m] and quaternion (x, y, z, w), NaN where not seen, shape (n, 7).
    """

    stamp_ns: int
    epoch: int
    ids: tuple[int, ...]
    poses: Array

    @classmethod
    def of(
        cls, window: TrackingWindow, frame: PoseArrayFrame, epoch: int, radius: float
    ) -> _Matched | None:
        """Tracks of the frame that a window accepted last; None where it gives no start.

        A pose further than a radius [m] from a track is not associated with it.
        """
        if not window.full or window.stamp_ns != frame.stamp_ns:
            return None
        poses = assign_poses(window.start()[1].positions, frame.poses, radius)
        return cls(frame.stamp_ns, epoch, window.ids, poses)


def segment_matched_frames(
    tracked: DecodedTopic, model: Forecaster, parameters: Mapping[str, Any], max_gap_ns: float
) -> Segmentation:
    """Cut frames into segments, each with one set of tracks.

    Gaps of up to two frames in a track are filled, see `fill_short_gaps`. Frames with a longer
    gap, and those before all tracks are initiated, are left out (`unseen`).

    Args:
        tracked: Frames in the order of recording; those in an unusual coordinate frame are left
            out.
        model: Gives scene and time step.
        parameters: Parameters of the simulator by name; missing ones have their defaults.
        max_gap_ns: Longest time between frames of a segment [ns].
    """
    overrides = {
        'frame_id': usual_frame_id(tracked),
        'max_spheres': 100_000,
        'match_spheres': True,
    }
    window = window_of(model, {**parameters, **overrides})
    refused: Counter[str] = Counter()
    seen: list[_Matched] = []
    epoch = 0
    for frame, time in zip(tracked.frames, tracked.times.tolist(), strict=True):
        try:
            epoch += window.add(frame, time)
        except RejectedFrame as error:
            refused[error.kind] += 1
            continue
        matched = _Matched.of(window, frame, epoch, model.radius)
        if matched is None:
            refused['reordered' if window.full else 'unseen'] += 1
        else:
            seen.append(matched)
    runs = [
        list(run) for _, run in groupby(seen, key=lambda matched: (matched.epoch, matched.ids))
    ]
    cuts, segments, filled = Counter(set=max(len(runs) - 1, 0)), [], 0
    for run in runs:
        stamps = np.array([matched.stamp_ns for matched in run], dtype=np.int64)
        poses = np.stack([matched.poses for matched in run])
        poses[..., 3:] = whole_rotations(poses[..., 3:])
        filled += fill_short_gaps(stamps, poses, model.scene, window.noise)
        whole = complete(poses)
        refused['unseen'] += len(run) - len(whole)
        frames = [PoseArrayFrame(int(stamps[k]), window.frame_id, poses[k]) for k in whole]
        parts, why = split_at_gaps(frames, max_gap_ns, run[0].ids)
        segments += parts
        cuts += why
    return Segmentation(segments, dict(+refused), dict(+cuts), filled)


class IdentifiedFrames:
    """Tracked frames, with the association of poses and tracks that the node had.

    Args:
        tracked: Frames that the node accepted.
        starts: Starts that it recorded.
        window: New window with the node's parameters.
        model: Model that predicted, or another one with its scene.
        learned: Scenes that took the place of the first.
    """

    def __init__(
        self,
        tracked: DecodedTopic,
        starts: list[Start],
        window: TrackingWindow,
        model: Forecaster,
        learned: Sequence[LearnedScene] = (),
    ) -> None:
        self._tracked, self._window, self._model = tracked, window, model
        self._seen: dict[int, _Matched] = {}
        self._epochs: dict[int, int] = {}  # epoch of the window by the index of a start
        self._cache: dict[tuple[int, tuple[int, ...]], DecodedTopic] = {}
        epoch = 0

        def on_frame(index: int, now: int) -> None:
            nonlocal epoch
            epoch = now
            found = _Matched.of(window, tracked.frames[index], now, model.radius)
            if found is not None:
                self._seen[index] = found

        for start, _ in replay_starts(window, tracked, starts, on_frame, learned):
            self._epochs[start.index] = epoch

    def of(self, start: Start) -> DecodedTopic:
        """Frames with the tracks of a start, in its order.

        Gaps of up to two frames in a track are filled; frames with a longer gap are left out.
        """
        wanted, epoch = start.ids or (), self._epochs[start.index]
        if (epoch, wanted) not in self._cache:
            self._cache[epoch, wanted] = self._gathered(epoch, wanted)
        return self._cache[epoch, wanted]

    def _gathered(self, epoch: int, wanted: tuple[int, ...]) -> DecodedTopic:
        tracked = self._tracked
        chosen = [
            index
            for index, seen in sorted(self._seen.items())
            if seen.epoch == epoch and set(wanted) <= set(seen.ids)
        ]
        if not chosen:
            return DecodedTopic([], tracked.times[:0], tracked.indices[:0], 0)
        stamps = np.array([tracked.frames[index].stamp_ns for index in chosen])
        poses = np.stack([self._columns(index, wanted) for index in chosen])
        poses[..., 3:] = whole_rotations(poses[..., 3:])
        fill_short_gaps(stamps, poses, self._model.scene, self._window.noise)
        whole = complete(poses)
        frame_id = self._window.frame_id
        frames = [PoseArrayFrame(int(stamps[k]), frame_id, poses[k]) for k in whole]
        kept = np.array(chosen)[whole]
        return DecodedTopic(frames, tracked.times[kept], tracked.indices[kept], 0)

    def _columns(self, index: int, wanted: tuple[int, ...]) -> Array:
        seen = self._seen[index]
        return seen.poses[[seen.ids.index(sphere) for sphere in wanted]]


def assign_poses(positions: Array, poses: Array, radius: float) -> Array:
    """Pose of each track, shape (n, 7), NaN where none is within a radius [m].

    Args:
        positions: Position of each track [m], shape (n, 3).
        poses: Poses of a frame in any order, shape (k, 7).
        radius: Largest distance of a pose from its track [m].
    """
    found = np.full((len(positions), 7), np.nan)
    if len(poses):
        apart = np.linalg.norm(positions[:, None] - poses[None, :, :3], axis=-1)
        rows, columns = linear_sum_assignment(np.minimum(apart, 10.0 * radius))
        near = apart[rows, columns] <= radius
        found[rows[near]] = poses[columns[near]]
    return found
