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

"""Tracked poses at the times that were predicted for."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .prediction_runs import AlignmentError, longest_run, Run
from ..bags.reader import Topic
from ..forecasts.interpolation import interpolate, Stamps
from ..messages.poses import decode_pose_array, MessageError, PoseArrayFrame
from ..scenes.state import Trajectory
from ..tracking.window import RESTART_FRAMES

__all__ = [
    'AlignmentError',
    'Decoded',
    'Run',
    'align',
    'covered',
    'decode_topic',
    'interpolate',
    'longest_run',
    'usable_frames',
    'usable_passes',
]

# tracked frames further apart than this many of their median intervals are a gap
MAX_GAP = 3.0


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


def usable_frames(
    tracked: Decoded, frame_id: str, count: int, places: Stamps
) -> tuple[list[PoseArrayFrame], dict[str, int]]:
    """Tracked frames that can be a reference, and the number of others by reason.

    Where the tracker began anew (its stamps went back, for good), the frames before or after it
    are left out: those that were recorded with fewer of the predictions.

    Args:
        tracked: All tracked frames.
        frame_id: Coordinate frame of the predictions.
        count: Number of spheres of the predictions.
        places: Places of the predictions in the recording.
    """
    return usable_passes(tracked, frame_id, count).beside(places)


@dataclass(frozen=True)
class Passes:
    """Usable tracked frames, cut where the tracker began anew.

    Args:
        frames: Of each pass, at least one.
        starts: Places in the recording where the second and later ones begin.
        dropped: Number of other frames, by reason.
    """

    frames: list[list[PoseArrayFrame]]
    starts: Stamps
    dropped: dict[str, int]

    def beside(self, places: Stamps) -> tuple[list[PoseArrayFrame], dict[str, int]]:
        """Frames of the pass with most of these places, and the number of all others."""
        shares = np.bincount(
            np.searchsorted(self.starts, places, side='right'), minlength=len(self.frames)
        )
        chosen = self.frames[int(np.argmax(shares))]
        others = sum(map(len, self.frames)) - len(chosen)
        return chosen, {**self.dropped, **({'pass': others} if others else {})}


def usable_passes(tracked: Decoded, frame_id: str, count: int) -> Passes:
    """Tracked frames that can be a reference; arguments as of `usable_frames`."""
    passes: list[list[tuple[int, PoseArrayFrame]]] = [[]]
    back: list[tuple[int, PoseArrayFrame]] = []
    dropped: Counter[str] = Counter()
    for place, frame in zip(tracked.places, tracked.frames, strict=True):
        item = (int(place), frame)
        if frame.frame_id != frame_id:
            dropped['frame'] += 1
        elif len(frame.poses) != count:
            dropped['count'] += 1
        elif not np.isfinite(frame.poses).all():
            dropped['not finite'] += 1
        elif (np.linalg.norm(frame.poses[:, 3:], axis=1) < 1e-6).any():
            dropped['quaternion'] += 1
        elif passes[-1] and frame.stamp_ns <= passes[-1][-1][1].stamp_ns:
            if back and frame.stamp_ns <= back[-1][1].stamp_ns:
                back = []
            back.append(item)
            dropped['stamp'] += 1
            if len(back) == RESTART_FRAMES:  # as the simulator takes it
                passes.append(back)
                dropped['stamp'] -= len(back)
                back = []
        else:
            passes[-1].append(item)
            back = []
    starts = np.array([part[0][0] for part in passes[1:]], dtype=np.int64)
    frames = [[frame for _, frame in part] for part in passes]
    return Passes(frames, starts, {key: number for key, number in dropped.items() if number})


def align(
    run: Run, tracked: list[PoseArrayFrame]
) -> tuple[Trajectory, Trajectory, dict[str, float]]:
    """Predicted and tracked poses at the same times, as trajectories.

    Velocities are backward differences of the poses, in both.

    Args:
        run: Predictions.
        tracked: Usable frames, see `usable_frames`.

    Returns:
        Predicted, tracked, and how they were aligned: `interpolated` frames (no tracked frame has
        their stamp), `tracked_interval_s`, the longest time between two tracked frames used, and
        `untracked` predictions that are left out, as they lie in a gap of the tracked frames, or
        on the shorter side of one.

    Raises:
        AlignmentError: Fewer than two predictions lie within the tracked time.
    """
    stamps = np.array([frame.stamp_ns for frame in tracked], dtype=np.int64)
    inside = (run.stamps >= stamps[0]) & (run.stamps <= stamps[-1])
    if inside.sum() < 2:
        raise AlignmentError(
            'predicted and tracked times do not overlap: predictions are for '
            f'{_span(run.stamps)}, tracked frames are of {_span(stamps)}'
        )
    within = np.flatnonzero(inside)
    kept = within[_longest_tracked(run.stamps[within], stamps)]
    if len(kept) < 2:
        raise AlignmentError('no two predictions in a row lie between tracked frames without gap')
    wanted = run.stamps[kept]
    first = int(np.searchsorted(stamps, wanted[0], side='right')) - 1
    last = int(np.searchsorted(stamps, wanted[-1], side='left'))
    stamps = stamps[first : last + 1]
    poses = np.stack([frame.poses for frame in tracked[first : last + 1]])
    reference = interpolate(stamps, poses, wanted)
    information = {
        'interpolated': int((~np.isin(wanted, stamps)).sum()),
        'tracked_interval_s': float(np.diff(stamps).max()) * 1e-9,
        'untracked': len(within) - len(kept),
    }
    predicted = run.poses[kept]
    return (
        Trajectory.from_poses(predicted[..., :3], predicted[..., 3:], run.dt),
        Trajectory.from_poses(reference[..., :3], reference[..., 3:], run.dt),
        information,
    )


def covered(wanted: Stamps, stamps: Stamps) -> NDArray[np.bool_]:
    """Which times lie on or between frames without a gap, shape (m,).

    Args:
        wanted: Times [ns], shape (m,).
        stamps: Times of the frames [ns], rising, shape (k,).
    """
    gap = MAX_GAP * float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
    inside = (wanted >= stamps[0]) & (wanted <= stamps[-1])
    after = np.minimum(np.searchsorted(stamps, wanted, side='left'), len(stamps) - 1)
    exact = stamps[after] == wanted
    bridged = stamps[after] - stamps[np.maximum(after - 1, 0)] <= gap
    found: NDArray[np.bool_] = exact | inside & bridged
    return found


def _longest_tracked(wanted: Stamps, stamps: Stamps) -> slice:
    """Return the longest part of `wanted` without one that lies in a gap between `stamps`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], covered(wanted, stamps), [0]])))
    if not len(edges):
        return slice(0, 0)
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    return slice(int(starts[longest]), int(stops[longest]))


def _span(stamps: Stamps) -> str:
    return f'{stamps[0] * 1e-9:.3f} to {stamps[-1] * 1e-9:.3f} s'
