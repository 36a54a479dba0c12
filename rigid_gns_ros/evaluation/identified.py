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

"""Tracked poses by sphere, where the simulator matched poses to spheres."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from rigid_gns_core.state import Array
from scipy.optimize import linear_sum_assignment

from .alignment import Decoded, MAX_GAP
from .forecast_starts import Start
from .replay import replayed
from ..messages import PoseArrayFrame
from ..pose_interpolation import interpolate, Stamps
from ..tracking.window import TrackingWindow


@dataclass(frozen=True)
class _Seen:
    """The spheres of a frame: ids, and poses, shape (n, 7), NaN where a sphere was not seen."""

    life: int
    ids: tuple[int, ...]
    poses: Array


class IdentifiedFrames:
    """Tracked frames, and which of their poses is which sphere, as the window of the node had it.

    Args:
        tracked: Frames that the node accepted.
        starts: Starts that it recorded.
        window: As the node's, new.
        radius: A pose so far from where the window has a sphere is not of it [m].
    """

    def __init__(
        self, tracked: Decoded, starts: list[Start], window: TrackingWindow, radius: float
    ) -> None:
        self._tracked = tracked
        self._seen: dict[int, _Seen] = {}
        self._lives: dict[int, int] = {}  # of the window, by the place of a start
        self._cache: dict[tuple[int, tuple[int, ...]], Decoded] = {}
        life = 0

        def on_frame(index: int, now: int) -> None:
            nonlocal life
            life = now
            frame = tracked.frames[index]
            if window.full and window.stamp_ns == frame.stamp_ns:
                places = window.start()[1].positions
                self._seen[index] = _Seen(now, window.ids, assigned(places, frame.poses, radius))

        for start, _ in replayed(window, tracked, starts, on_frame):
            self._lives[start.place] = life

    def of(self, start: Start) -> Decoded:
        """Frames with the spheres of a start, in its order.

        Poses of a sphere that was not seen for up to three intervals are interpolated; frames with
        one that was not seen for longer are left out.
        """
        wanted, life = start.ids or (), self._lives[start.place]
        if (life, wanted) not in self._cache:
            self._cache[life, wanted] = self._gathered(life, wanted)
        return self._cache[life, wanted]

    def _gathered(self, life: int, wanted: tuple[int, ...]) -> Decoded:
        chosen = [
            index
            for index, seen in sorted(self._seen.items())
            if seen.life == life and set(wanted) <= set(seen.ids)
        ]
        if not chosen:
            return Decoded([], self._tracked.times[:0], self._tracked.places[:0], 0)
        stamps = np.array([self._tracked.frames[index].stamp_ns for index in chosen])
        poses = np.stack([self._columns(index, wanted) for index in chosen])
        for sphere in range(poses.shape[1]):
            fill(stamps, poses[:, sphere])
        whole = np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
        frame_id = self._tracked.frames[chosen[0]].frame_id
        frames = [PoseArrayFrame(int(stamps[k]), frame_id, poses[k]) for k in whole]
        kept = np.array(chosen)[whole]
        return Decoded(frames, self._tracked.times[kept], self._tracked.places[kept], 0)

    def _columns(self, index: int, wanted: tuple[int, ...]) -> Array:
        seen = self._seen[index]
        return seen.poses[[seen.ids.index(one) for one in wanted]]


def assigned(places: Array, poses: Array, radius: float) -> Array:
    """Return the pose of each sphere, shape (n, 7), NaN where none is near."""
    found = np.full((len(places), 7), np.nan)
    if len(poses):
        apart = np.linalg.norm(places[:, None] - poses[None, :, :3], axis=-1)
        rows, columns = linear_sum_assignment(np.minimum(apart, 10.0 * radius))
        near = apart[rows, columns] <= radius
        found[rows[near]] = poses[columns[near]]
    return found


def fill(stamps: Stamps, poses: Array) -> None:
    """Interpolate the poses of a sphere, shape (k, 7), where it was not seen for a short time."""
    for gap in short_gaps(stamps, poses):
        ends = gap[[0, -1]] + [-1, 1]
        poses[gap] = interpolate(stamps[ends], poses[ends][:, None], stamps[gap])[:, 0]


def short_gaps(stamps: Stamps, poses: Array) -> list[NDArray[np.int64]]:
    """Frames in a row in which a sphere was not seen, of gaps of up to three intervals.

    Args:
        stamps: Of the frames [ns], shape (k,).
        poses: Of the sphere, shape (k, 7), NaN where it was not seen.
    """
    seen = np.flatnonzero(np.isfinite(poses).all(axis=1))
    if len(seen) < 2:
        return []
    longest = MAX_GAP * float(np.median(np.diff(stamps)))
    return [
        np.arange(before + 1, after)
        for before, after in pairwise(seen)
        if after - before > 1 and stamps[after] - stamps[before] <= longest
    ]
