# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses that are repeated with a new stamp, as by a publisher that is faster than its camera.

Measurements never repeat to the bit while spheres move. The speed is that between the last two
poses that differ, so that it is known as soon as there are two. Spheres may stop at once, as in a
simulation: after a few repeats they are believed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from .rejected_frame import RejectedFrame
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array

# repeats are refused this many times in a row, where spheres move by so many radii meanwhile
REPEATS, _STILL = 8, 0.01


class Repeats:
    """Checks whether a frame repeats the poses of the frame before.

    Args:
        radius: Radius of the largest sphere [m].
    """

    def __init__(self, radius: float) -> None:
        self._still = _STILL * radius
        self.clear()

    def clear(self) -> None:
        """Forget all frames."""
        self._newest: PoseArrayFrame | None = None
        self._before: PoseArrayFrame | None = None
        self._count = 0  # of repeats refused in a row

    def check(self, frame: PoseArrayFrame, speed: float = 0.0) -> None:
        """Check a frame that is newer than all before.

        Args:
            frame: The frame.
            speed: Largest speed of a sphere, as far as it is known otherwise [m/s].

        Raises:
            RejectedFrame: It repeats the poses of the frame before.
        """
        newest = self._newest
        if newest is None or not _same(newest, frame):
            self._count = 0
            return
        time = (frame.stamp_ns - newest.stamp_ns) * 1e-9
        if self._count >= REPEATS or max(speed, self._speed()) * time <= self._still:
            return
        self._count += 1
        raise RejectedFrame(
            'content',
            f'its poses are those of the frame {time:.3g} s before, in which spheres moved; '
            'expected each measurement once',
        )

    def took(self, frame: PoseArrayFrame) -> None:
        """Note an accepted frame that is newer than all before."""
        self._before, self._newest = self._newest, frame

    def _speed(self) -> float:
        """Speed between the last two frames [m/s]; 0 where they are the same."""
        before, newest = self._before, self._newest
        if before is None or newest is None or _same(before, newest):
            return 0.0
        return _way(before.poses, newest.poses) / ((newest.stamp_ns - before.stamp_ns) * 1e-9)

    def belie(self, frames: Sequence[PoseArrayFrame], frame: PoseArrayFrame) -> bool:
        """Whether a frame shows that the first frames were repeats, not spheres at rest.

        Args:
            frames: All frames so far.
            frame: The next one.
        """
        if not 1 < len(frames) <= REPEATS + 1 or frame.stamp_ns <= frames[-1].stamp_ns:
            return False
        if not all(_same(frames[0], other) for other in frames[1:]) or _same(frames[0], frame):
            return False
        return _way(frames[0].poses, frame.poses) > self._still


def _same(before: PoseArrayFrame, after: PoseArrayFrame) -> bool:
    a, b = before.poses, after.poses
    if len(b) == 0 or a.shape != b.shape or abs(a.item(0) - b.item(0)) > 0.0:
        return False  # as nearly always
    return bool(((a == b) | (np.isnan(a) & np.isnan(b))).all())


def _way(before: Array, after: Array) -> float:
    """How far spheres moved at most [m], whether poses keep their order or not."""
    fewer, more = sorted(
        (poses[np.isfinite(poses).all(axis=1), :3] for poses in (before, after)), key=len
    )
    if not len(fewer):
        return 0.0
    # of each the nearest: in another order it is not the one at the same place
    return float(cKDTree(more).query(fewer)[0].max())
