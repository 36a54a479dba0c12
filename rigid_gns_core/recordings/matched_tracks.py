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
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .alignment import Decoded
from .identified import assigned
from .recorded_model import tracking_window
from .short_gaps import fill_short_gaps
from .tracked_segments import Cut, cut
from ..forecasts.forecaster import Forecaster
from ..messages.poses import PoseArrayFrame
from ..tracking.window import RejectedFrame, TrackingWindow

Run = tuple[tuple[int, ...], list[PoseArrayFrame]]


def cut_matched(
    tracked: Decoded, model: Forecaster, parameters: Mapping[str, Any], max_gap_ns: float
) -> Cut:
    """Frames in segments of one set of spheres each.

    A sphere that was not seen for up to three intervals is put in where its motion before and
    after leads, see `fill_short_gaps`; frames with one that was not seen for longer, and those
    before all spheres are found, are left out (`unseen`).

    Args:
        tracked: Frames in the order of recording; those in another coordinate frame than most are
            left out.
        model: Gives scene and time step.
        parameters: Of the simulator that followed these spheres; others have their defaults.
        max_gap_ns: Two frames further apart are not joined [ns].
    """
    names = Counter(frame.frame_id for frame in tracked.frames)
    given = {'frame_id': names.most_common(1)[0][0], 'max_spheres': 100_000, 'match_spheres': True}
    window = tracking_window(model, {**parameters, **given})
    runs, left_out = _matched(tracked, window, model.radius)
    refused, cuts = Counter(left_out), Counter({'set': len(runs) - 1})
    segments, filled = [], 0
    for ids, run in runs:
        whole, number = _filled(run, model, window.noise)
        refused['unseen'] += len(run) - len(whole)
        filled += number
        part = cut(whole, max_gap_ns)
        cuts.update(part.cuts)
        segments += [replace(one, ids=ids) for one in part.segments]
    return Cut(segments, dict(+refused), dict(+cuts), filled)


def _matched(
    tracked: Decoded, window: TrackingWindow, radius: float
) -> tuple[list[Run], Counter[str]]:
    """Stretches with the same spheres in the same order, and frames left out by reason.

    Poses of a sphere that was not seen are NaN.

    Args:
        tracked: Frames in the order of recording.
        window: One that matches poses; nothing heard yet.
        radius: A pose so far from where the window has a sphere is not of it [m].
    """
    runs: list[Run] = []
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
            runs.append((window.ids, []))
        places = window.start()[1].positions
        runs[-1][1].append(replace(frame, poses=assigned(places, frame.poses, radius)))
    return runs, left_out


def _filled(
    run: list[PoseArrayFrame], model: Forecaster, noise: float
) -> tuple[list[PoseArrayFrame], int]:
    """Return the frames in which all spheres are known, and how many poses were put in."""
    stamps = np.array([frame.stamp_ns for frame in run], dtype=np.int64)
    poses = np.stack([frame.poses for frame in run])
    filled = fill_short_gaps(stamps, poses, model.scene, noise)
    known = np.isfinite(poses).all(axis=(1, 2))
    return [replace(run[k], poses=poses[k]) for k in np.flatnonzero(known)], filled
