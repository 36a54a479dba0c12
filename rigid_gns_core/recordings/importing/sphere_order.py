# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether the spheres of tracked frames keep their order in the message.

Two that change places there jump as no motion does: neither continues its own motion, and each is
where the other was, or where the other was going. Fast spheres continue their motion, however long
their steps are; spheres that collide stay two radii apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from ..tracked_frames import Segment
from ...scenes.state import Array

# a step that deviates from the motion before it by more is a jump [radii]; touching centres are
# two radii apart
_JUMP = 1.5
# two spheres were exchanged where each is this close to the other's continued motion [radii]
_CONTINUES = 0.5
# or where undoing the exchange makes the steps shorter by this factor
_SHORTER = 3.0
# poses are unordered where exchanges are in at least this many frames and segment of the jumps
_FRAMES, _PART = 3, 0.2
# segment of jumps in all steps above which no motion can be followed
_NO_MOTION = 0.5


@dataclass(frozen=True)
class OrderCheck:
    """Counts of jumps and exchanges in one or several segments.

    Args:
        steps: Number of steps of a sphere that follow another one.
        jumps: Number of these that do not continue the motion before them.
        exchanged: Number of jumps that an exchange of spheres explains.
        stamps: Stamps of the frames with exchanges [ns].
    """

    steps: int = 0
    jumps: int = 0
    exchanged: int = 0
    stamps: tuple[int, ...] = ()

    def __add__(self, other: OrderCheck) -> OrderCheck:
        """Sum of the counts."""
        return OrderCheck(
            self.steps + other.steps,
            self.jumps + other.jumps,
            self.exchanged + other.exchanged,
            self.stamps + other.stamps,
        )

    @property
    def unordered(self) -> bool:
        """Whether poses are in no fixed order."""
        return len(self.stamps) >= _FRAMES and self.exchanged >= _PART * self.jumps

    @property
    def no_motion(self) -> bool:
        """Whether most steps are jumps, so that no motion can be followed."""
        return self.jumps > _NO_MOTION * self.steps


def check_order(segment: Segment, radii: Array, gravity: Array) -> OrderCheck:
    """Count jumps and exchanges of spheres in a segment.

    Args:
        segment: Consecutive frames.
        radii: Radii of its spheres [m], shape (n,).
        gravity: Acceleration of free flight [m/s^2], shape (3,).
    """
    positions, spans = segment.poses[..., :3], np.diff(segment.times)[:, None, None]
    if len(spans) < 2:
        return OrderCheck()
    now, after = positions[1:-1], positions[2:]
    continued_straight = now + np.diff(positions, axis=0)[:-1] * (spans[1:] / spans[:-1])
    continued_flight = continued_straight + 0.5 * gravity * spans[1:] * (spans[1:] + spans[:-1])
    off = np.minimum(
        np.linalg.norm(after - continued_straight, axis=-1),
        np.linalg.norm(after - continued_flight, axis=-1),
    )
    jumped = off > _JUMP * radii
    exchanged, stamps = 0, []
    for frame in np.flatnonzero(jumped.sum(axis=1) > 1):
        jumping = np.flatnonzero(jumped[frame])
        new_positions = after[frame, jumping]
        continued = np.minimum(
            cdist(continued_straight[frame, jumping], new_positions),
            cdist(continued_flight[frame, jumping], new_positions),
        )
        moved = max(
            _brought_nearer(cdist(now[frame, jumping], new_positions)),
            _continuing(continued, radii[jumping]),
        )
        if moved:
            exchanged += moved
            stamps.append(int(segment.stamps[frame + 2]))
    return OrderCheck(jumped.size, int(jumped.sum()), exchanged, tuple(stamps))


def _brought_nearer(apart: Array) -> int:
    """Number of spheres that an exchange brings much nearer to their last positions.

    Args:
        apart: Distance of each last position from each new one [m], shape (n, n).
    """
    moved, places = _moved(apart**2)
    shorter = apart[moved, places].sum() * _SHORTER < apart[moved, moved].sum()
    return len(moved) if shorter else 0


def _continuing(apart: Array, radii: Array) -> int:
    """Number of spheres whose motion continues at the positions of others.

    Args:
        apart: Distance of each continued motion from each new position [m], shape (n, n).
        radii: Radii [m], shape (n,).
    """
    fits = apart <= _CONTINUES * radii[:, None]
    moved, places = _moved(np.where(fits, 0.0, 1.0))
    kept = fits[moved, places]
    closed = np.intersect1d(moved[kept], places[kept])
    return len(closed) if len(closed) == kept.sum() else 0


def _moved(cost: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Spheres that the best assignment exchanges, and their positions, shapes (m,)."""
    rows, columns = linear_sum_assignment(cost)
    elsewhere = rows != columns
    return rows[elsewhere], columns[elsewhere]
