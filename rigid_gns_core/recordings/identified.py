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

import numpy as np
from scipy.optimize import linear_sum_assignment

from .alignment import Decoded
from .forecast_starts import Start
from .replay import replayed
from .short_gaps import fill_short_gaps
from ..forecasts.forecaster import Forecaster
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array
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
        model: The one that predicted, or another of its scene.
    """

    def __init__(
        self, tracked: Decoded, starts: list[Start], window: TrackingWindow, model: Forecaster
    ) -> None:
        self._tracked, self._window, self._model = tracked, window, model
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
                poses = assigned(places, frame.poses, model.radius)
                self._seen[index] = _Seen(now, window.ids, poses)

        for start, _ in replayed(window, tracked, starts, on_frame):
            self._lives[start.place] = life

    def of(self, start: Start) -> Decoded:
        """Frames with the spheres of a start, in its order.

        A sphere that was not seen for up to three intervals is put in where its motion leads;
        frames with one that was not seen for longer are left out.
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
        fill_short_gaps(stamps, poses, self._model.scene, self._window.noise)
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
