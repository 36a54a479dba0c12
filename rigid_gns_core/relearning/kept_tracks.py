# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The newest tracks of a running tracker, in bounded memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np

from ..data.tracks import Track
from ..scenes.scene import Scene
from ..scenes.state import Array

MOST_BALLS = 8
"""Frames with more spheres are not kept: a heap tells little of one ball, and takes long."""
# tracks kept, and the longest [s]; a gap between two frames that ends one [s]
_MOST, _LONGEST, _GAP = 60, 10.0, 0.25
_FEWEST = 8  # frames of a track


class KeptTracks:
    """Cuts what a tracker sends into tracks, and keeps the newest.

    A track ends where no frame comes for a quarter of a second, where the set of spheres changes,
    and after ten seconds.

    Args:
        scene: Tells whether properties are per sphere: then labels are ids.
        most: Number of tracks kept.
    """

    def __init__(self, scene: Scene, most: int = _MOST) -> None:
        self._by_id = scene.sphere_count is not None
        self._tracks: deque[Track] = deque(maxlen=most)
        self._ids: tuple[int, ...] = ()
        self._stamps: list[int] = []
        self._centres: list[Array] = []
        self.finished = 0  # tracks since the beginning

    @property
    def tracks(self) -> tuple[Track, ...]:
        """The tracks that have ended, the newest last."""
        return tuple(self._tracks)

    def ends(self, stamp_ns: int) -> bool:
        """Whether a frame of this stamp begins another track."""
        return not self._stamps or stamp_ns - self._stamps[-1] > _GAP * 1e9

    def take(self, stamp_ns: int, ids: Sequence[int], centres: Array) -> None:
        """Take the next frame; one that is not later than the one before is left out.

        Args:
            stamp_ns: Its stamp [ns].
            ids: Of the spheres.
            centres: [m], shape (n, 3), NaN where a sphere was not seen.
        """
        if self._stamps and stamp_ns <= self._stamps[-1] and not self.ends(stamp_ns):
            if self._stamps[-1] - stamp_ns < _LONGEST * 1e9:
                return
            self.cut()  # the clock was set back
        long = bool(self._stamps) and stamp_ns - self._stamps[0] > _LONGEST * 1e9
        if self.ends(stamp_ns) or tuple(ids) != self._ids or long:
            self.cut()
        if 0 < len(ids) <= MOST_BALLS:
            self._ids = tuple(ids)
            self._stamps.append(stamp_ns)
            self._centres.append(np.array(centres, dtype=np.float64))

    def cut(self) -> None:
        """End the present track."""
        if len(self._stamps) >= _FEWEST:
            stamps = np.array(self._stamps, dtype=np.int64)
            labels = self._ids if self._by_id else range(len(self._ids))
            self._tracks.append(
                Track(
                    f'{self.finished}',
                    (stamps - stamps[0]) * 1e-9,
                    np.stack(self._centres),
                    None,
                    tuple(str(label) for label in labels),
                    float(stamps[0]) * 1e-9,
                )
            )
            self.finished += 1
        self._stamps, self._centres = [], []
