# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether the spheres of tracked frames keep their places in the message.

Two that change places there make a step that no motion makes: neither goes on from where it was,
and each is where the other was, or where the other was going. Fast spheres go on from where they
were, however long their steps are; spheres that strike each other stay two radii apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from ..tracked_frames import Segment
from ...scenes.state import Array

# a step goes on from the one before up to so many radii; two that touch are two apart
_SUDDEN = 1.5
# the place of another sphere is that where this one was going, up to so many radii
_ONWARD = 0.5
# with places given back, steps are so many times shorter
_SHORTER = 3.0
# poses in any order: in so many frames at least, and so large a part of what is sudden
_FRAMES, _PART = 3, 0.2
# where so many of all steps are sudden, no motion is seen
_BLIND = 0.5


@dataclass(frozen=True)
class PlacesKept:
    """What was found in the frames of one or several segments.

    Args:
        steps: Number of steps of a sphere that have one before them.
        sudden: Number of those that do not go on from it.
        exchanged: Number of those that do, or are far shorter, with the places of others.
        stamps: Of the frames with such [ns].
    """

    steps: int = 0
    sudden: int = 0
    exchanged: int = 0
    stamps: tuple[int, ...] = ()

    def __add__(self, other: PlacesKept) -> PlacesKept:
        """Of the frames of both."""
        return PlacesKept(
            self.steps + other.steps,
            self.sudden + other.sudden,
            self.exchanged + other.exchanged,
            self.stamps + other.stamps,
        )

    @property
    def lost(self) -> bool:
        """Whether poses come in any order."""
        return len(self.stamps) >= _FRAMES and self.exchanged >= _PART * self.sudden

    @property
    def blind(self) -> bool:
        """Whether hardly a step goes on from the one before, so that no motion is seen."""
        return self.sudden > _BLIND * self.steps


def places_kept(part: Segment, radii: Array, gravity: Array) -> PlacesKept:
    """Look for spheres that change places in the message.

    Args:
        part: Frames in a row.
        radii: Of its spheres [m], shape (n,).
        gravity: Acceleration of free flight [m/s^2], shape (3,).
    """
    positions, spans = part.poses[..., :3], np.diff(part.times)[:, None, None]
    if len(spans) < 2:
        return PlacesKept()
    now, after = positions[1:-1], positions[2:]
    carried = now + np.diff(positions, axis=0)[:-1] * (spans[1:] / spans[:-1])
    flying = carried + 0.5 * gravity * spans[1:] * (spans[1:] + spans[:-1])
    off = np.minimum(
        np.linalg.norm(after - carried, axis=-1), np.linalg.norm(after - flying, axis=-1)
    )
    sudden = off > _SUDDEN * radii
    exchanged, stamps = 0, []
    for frame in np.flatnonzero(sudden.sum(axis=1) > 1):
        who = np.flatnonzero(sudden[frame])
        found = after[frame, who]
        onward = np.minimum(cdist(carried[frame, who], found), cdist(flying[frame, who], found))
        moved = max(_nearer(cdist(now[frame, who], found)), _onward(onward, radii[who]))
        if moved:
            exchanged += moved
            stamps.append(int(part.stamps[frame + 2]))
    return PlacesKept(sudden.size, int(sudden.sum()), exchanged, tuple(stamps))


def _nearer(apart: Array) -> int:
    """Return how many spheres other places bring far nearer to where they were.

    Args:
        apart: Of each sphere from each place in the next frame [m], shape (n, n).
    """
    moved, places = _moved(apart**2)
    shorter = apart[moved, places].sum() * _SHORTER < apart[moved, moved].sum()
    return len(moved) if shorter else 0


def _onward(apart: Array, radii: Array) -> int:
    """Return how many spheres go on in each other's places.

    Args:
        apart: Of where each sphere was going from each place [m], shape (n, n).
        radii: [m], shape (n,).
    """
    fits = apart <= _ONWARD * radii[:, None]
    moved, places = _moved(np.where(fits, 0.0, 1.0))
    kept = fits[moved, places]
    closed = np.intersect1d(moved[kept], places[kept])
    return len(closed) if len(closed) == kept.sum() else 0


def _moved(cost: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return who is elsewhere in the best assignment, and where, shapes (m,)."""
    rows, columns = linear_sum_assignment(cost)
    elsewhere = rows != columns
    return rows[elsewhere], columns[elsewhere]
