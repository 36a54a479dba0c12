# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames in which nobody says who is who: poses matched to spheres, as in the node."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from .replay import replayed
from .resample import resample
from .tracked_frames import Cut, Decoded, usual_frame_id, without_gaps
from ..forecasts.forecaster import Forecaster
from ..forecasts.starts import Start
from ..forecasts.window_setup import window_of
from ..messages.poses import PoseArrayFrame
from ..scenes.scene import Scene
from ..scenes.state import Array
from ..tracking.usable_frames import RejectedFrame, short_gaps, Stamps
from ..tracking.window import TrackingWindow


@dataclass(frozen=True)
class _Matched:
    """The spheres of a frame.

    Args:
        stamp_ns: Of the frame [ns].
        life: Number of times that the window forgot all before.
        ids: Of the spheres, in this life.
        poses: Shape (n, 7), NaN where a sphere was not seen.
    """

    stamp_ns: int
    life: int
    ids: tuple[int, ...]
    poses: Array

    @classmethod
    def of(
        cls, window: TrackingWindow, frame: PoseArrayFrame, life: int, radius: float
    ) -> _Matched | None:
        """Spheres of the frame that a window took last; None where it gives no start.

        A pose further than a radius [m] from where the window has a sphere is not of it.
        """
        if not window.full or window.stamp_ns != frame.stamp_ns:
            return None
        poses = assigned(window.start()[1].positions, frame.poses, radius)
        return cls(frame.stamp_ns, life, window.ids, poses)


def cut_matched(
    tracked: Decoded, model: Forecaster, parameters: Mapping[str, Any], max_gap_ns: float
) -> Cut:
    """Cut frames into segments of one set of spheres each.

    A sphere that was not seen for up to two frames is put in where its motion before and after
    leads, see `fill_short_gaps`; frames with one that was not seen for longer, and those before
    all spheres are found, are left out (`unseen`).

    Args:
        tracked: Frames in the order of recording; those in another coordinate frame than most are
            left out.
        model: Gives scene and time step.
        parameters: Of the simulator that followed these spheres; others have their defaults.
        max_gap_ns: Two frames further apart are not joined [ns].
    """
    given = {'frame_id': usual_frame_id(tracked), 'max_spheres': 100_000, 'match_spheres': True}
    window = window_of(model, {**parameters, **given})
    refused: Counter[str] = Counter()
    seen: list[_Matched] = []
    life = 0
    for frame, time in zip(tracked.frames, tracked.times.tolist(), strict=True):
        try:
            life += window.add(frame, time)
        except RejectedFrame as error:
            refused[error.kind] += 1
            continue
        one = _Matched.of(window, frame, life, model.radius)
        if one is None:
            refused['reordered' if window.full else 'unseen'] += 1
        else:
            seen.append(one)
    runs = [list(run) for _, run in groupby(seen, key=lambda one: (one.life, one.ids))]
    cuts, segments, filled = Counter(set=max(len(runs) - 1, 0)), [], 0
    for run in runs:
        stamps = np.array([one.stamp_ns for one in run], dtype=np.int64)
        poses = np.stack([one.poses for one in run])
        filled += fill_short_gaps(stamps, poses, model.scene, window.noise)
        whole = _whole(poses)
        refused['unseen'] += len(run) - len(whole)
        frames = [PoseArrayFrame(int(stamps[k]), window.frame_id, poses[k]) for k in whole]
        parts, why = without_gaps(frames, max_gap_ns, run[0].ids)
        segments += parts
        cuts += why
    return Cut(segments, dict(+refused), dict(+cuts), filled)


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
        self._seen: dict[int, _Matched] = {}
        self._lives: dict[int, int] = {}  # of the window, by the place of a start
        self._cache: dict[tuple[int, tuple[int, ...]], Decoded] = {}
        life = 0

        def on_frame(index: int, now: int) -> None:
            nonlocal life
            life = now
            found = _Matched.of(window, tracked.frames[index], now, model.radius)
            if found is not None:
                self._seen[index] = found

        for start, _ in replayed(window, tracked, starts, on_frame):
            self._lives[start.place] = life

    def of(self, start: Start) -> Decoded:
        """Frames with the spheres of a start, in its order.

        A sphere that was not seen for up to two frames is put in where its motion leads; frames
        with one that was not seen for longer are left out.
        """
        wanted, life = start.ids or (), self._lives[start.place]
        if (life, wanted) not in self._cache:
            self._cache[life, wanted] = self._gathered(life, wanted)
        return self._cache[life, wanted]

    def _gathered(self, life: int, wanted: tuple[int, ...]) -> Decoded:
        tracked = self._tracked
        chosen = [
            index
            for index, seen in sorted(self._seen.items())
            if seen.life == life and set(wanted) <= set(seen.ids)
        ]
        if not chosen:
            return Decoded([], tracked.times[:0], tracked.places[:0], 0)
        stamps = np.array([tracked.frames[index].stamp_ns for index in chosen])
        poses = np.stack([self._columns(index, wanted) for index in chosen])
        fill_short_gaps(stamps, poses, self._model.scene, self._window.noise)
        whole = _whole(poses)
        frame_id = self._window.frame_id
        frames = [PoseArrayFrame(int(stamps[k]), frame_id, poses[k]) for k in whole]
        kept = np.array(chosen)[whole]
        return Decoded(frames, tracked.times[kept], tracked.places[kept], 0)

    def _columns(self, index: int, wanted: tuple[int, ...]) -> Array:
        seen = self._seen[index]
        return seen.poses[[seen.ids.index(one) for one in wanted]]


def assigned(places: Array, poses: Array, radius: float) -> Array:
    """Return the pose of each sphere, shape (n, 7), NaN where none is within a radius [m]."""
    found = np.full((len(places), 7), np.nan)
    if len(poses):
        apart = np.linalg.norm(places[:, None] - poses[None, :, :3], axis=-1)
        rows, columns = linear_sum_assignment(np.minimum(apart, 10.0 * radius))
        near = apart[rows, columns] <= radius
        found[rows[near]] = poses[columns[near]]
    return found


def fill_short_gaps(stamps: Stamps, poses: Array, scene: Scene, noise: float) -> int:
    """Put in poses where a sphere was not seen for up to two frames, see `resample`.

    Args:
        stamps: Of the frames [ns], shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7), NaN where a sphere was
            not seen; filled in place.
        scene: Gives gravity and radii.
        noise: Standard deviation of each coordinate of a position [m].

    Returns:
        Number of poses put in.
    """
    times = (stamps - stamps[0]) * 1e-9  # differences first: stamps do not fit into a float64
    filled = 0
    for own in np.moveaxis(poses, 1, 0):
        seen = np.isfinite(own).all(axis=1)
        missing = short_gaps(stamps, seen)
        if len(missing):
            turns = own[seen, None, 3:]
            found = resample(
                times[seen],
                own[seen, None, :3],
                turns / np.linalg.norm(turns, axis=-1, keepdims=True),
                times[missing],
                scene=scene,
                noise=noise,
            )
            own[missing] = np.concatenate([found.positions, found.quaternions], axis=-1)[:, 0]
            filled += len(missing)
    return filled


def _whole(poses: Array) -> NDArray[np.int64]:
    """Return indices of the frames in which all spheres are known, of poses of shape (k, n, 7)."""
    return np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
