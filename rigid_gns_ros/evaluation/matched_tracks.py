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

"""Tracked frames of a bag in which nobody says who is who: poses matched from frame to frame."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np

from .alignment import Decoded
from .identified import assigned, fill
from .recorded_model import tracking_window
from ..learning.tracked_segments import Cut, cut
from ..messages import PoseArrayFrame
from ..prediction.forecast import Forecaster
from ..tracking.window import RejectedFrame, TrackingWindow


def cut_matched(tracked: Decoded, model: Forecaster, length: int, max_gap_ns: float) -> Cut:
    """Frames in segments of one set of spheres each, see `matched_tracks`.

    Args:
        tracked: Frames in the order of recording; those in another coordinate frame than most are
            left out.
        model: Gives scene and time step.
        length: Frames from which velocities are fitted.
        max_gap_ns: Two frames further apart are not joined [ns].
    """
    names = Counter(frame.frame_id for frame in tracked.frames)
    given = {
        'frame_id': names.most_common(1)[0][0],
        'velocity_window': length,
        'max_spheres': 100_000,
        'match_spheres': True,
    }
    runs, left_out = matched_tracks(tracked, tracking_window(model, given), model.radius)
    parts = [cut(run, max_gap_ns) for run in runs]
    cuts = Counter({'set': len(runs) - 1})
    for part in parts:
        cuts.update(part.cuts)
    return Cut([one for part in parts for one in part.segments], dict(left_out), dict(+cuts))


def matched_tracks(
    tracked: Decoded, window: TrackingWindow, radius: float
) -> tuple[list[list[PoseArrayFrame]], Counter[str]]:
    """Stretches of frames with the same spheres in the same order, and frames left out by reason.

    A sphere that was not seen for up to three intervals is interpolated; frames with one that was
    not seen for longer, and those before all spheres are found, are left out (`unseen`).

    Args:
        tracked: Frames in the order of recording.
        window: One that matches poses; nothing heard yet.
        radius: A pose so far from where the window has a sphere is not of it [m].
    """
    runs: list[list[PoseArrayFrame]] = []
    left_out: Counter[str] = Counter()
    life, known = 0, None
    for frame, time in zip(tracked.frames, tracked.times.tolist(), strict=True):
        try:
            life += window.add(frame, time)
        except RejectedFrame as error:
            left_out[error.kind] += 1
            continue
        if not window.full or window.stamp_ns != frame.stamp_ns:
            left_out['reordered' if window.full else 'unseen'] += 1
            continue
        if known != (life, window.ids):
            known = life, window.ids
            runs.append([])
        places = window.start()[1].positions
        runs[-1].append(replace(frame, poses=assigned(places, frame.poses, radius)))
    whole = [_filled(run) for run in runs]
    left_out['unseen'] += sum(map(len, runs)) - sum(map(len, whole))
    return [run for run in whole if run], +left_out


def _filled(run: list[PoseArrayFrame]) -> list[PoseArrayFrame]:
    """Return the frames in which all spheres are known, some by interpolation."""
    stamps = np.array([frame.stamp_ns for frame in run], dtype=np.int64)
    poses = np.stack([frame.poses for frame in run])
    for sphere in range(poses.shape[1]):
        fill(stamps, poses[:, sphere])
    known = np.isfinite(poses).all(axis=(1, 2))
    return [replace(run[k], poses=poses[k]) for k in np.flatnonzero(known)]
