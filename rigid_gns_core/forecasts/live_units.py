# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether tracked poses that arrive one by one are in the units and axes of the scene.

The rule is that of import and evaluation (`data/free_fall.py`). It looks at blocks of frames, and
at one sphere with each frame, so that no frame waits for it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from ..data.free_fall import misfit_of_fall, misfit_of_speed, parabolas, step_speeds
from ..messages.poses import PoseArrayFrame
from ..scenes.scene import Scene
from ..scenes.state import Array
from ..tracking.lost_spheres import measured

# a block is so long [s], and has so many frames
_BLOCK, _FRAMES = 0.5, 11
# spheres of a block that are looked at, one with each frame
_SPHERES = 16
# newest parabolas and speeds that count
_KEPT = 400
# so many parabolas that fit end the search
_ENOUGH = 100


class LiveUnits:
    """Watches poses of a tracker.

    Args:
        scene: Gives gravity and radius.
        matched: Whether poses come in any order, so that steps between them tell no speed.
    """

    def __init__(self, scene: Scene, *, matched: bool) -> None:
        self._scene, self._matched = scene, matched
        self.clear()

    def clear(self) -> None:
        """Begin anew, as with another tracker."""
        self._frames: list[PoseArrayFrame] = []
        self._left: list[tuple[Array, Array]] = []  # times and places of spheres of a block
        self._falls: deque[Array] = deque(maxlen=_KEPT)
        self._speeds: deque[float] = deque(maxlen=_KEPT)
        self._fits = False

    def take(self, frame: PoseArrayFrame, noise: Callable[[], float]) -> str:
        """Look at the next frame that was accepted.

        Args:
            frame: The frame.
            noise: Gives the standard deviation of each coordinate [m].

        Returns:
            What does not fit the scene, and the remedy; empty: nothing is known to.
        """
        if self._fits:
            return ''
        frames = self._frames
        if frames and len(frame.poses) != len(frames[-1].poses):
            frames.clear()
        if not frames or frame.stamp_ns > frames[-1].stamp_ns:
            frames.append(frame)
        if len(frames) >= _FRAMES and frame.stamp_ns - frames[0].stamp_ns >= _BLOCK * 1e9:
            self._begin_block()
        return self._look(*self._left.pop(), noise()) if self._left else ''

    def _begin_block(self) -> None:
        frames, self._frames = self._frames, []
        poses = np.stack([frame.poses for frame in frames])
        stamps = np.array([frame.stamp_ns for frame in frames], dtype=np.int64)
        times = (stamps - stamps[0]) * 1e-9
        count = poses.shape[1]
        chosen = np.linspace(0, count - 1, min(count, _SPHERES)).round().astype(np.int64)
        for sphere in chosen.tolist():
            seen = measured(poses[:, sphere])
            self._left.append((times[seen], poses[seen, sphere, :3]))

    def _look(self, times: Array, places: Array, noise: float) -> str:
        self._falls.extend(parabolas(times, places, noise))
        if not self._matched:
            self._speeds.extend(step_speeds(times, places).tolist())
        falls = np.array(self._falls).reshape(-1, 2, 3)
        misfit = misfit_of_fall(falls, self._scene)
        misfit = misfit or misfit_of_speed(np.array(self._speeds), self._scene)
        if misfit is None:
            self._fits = len(falls) >= _ENOUGH
            return ''
        remedy = misfit.advice or 'publish metres with z up'
        return (
            f'{misfit.text}; {remedy}: predictions from these poses are wrong '
            '(`rigid-gns import` has --scale and --up for recordings)'
        )
