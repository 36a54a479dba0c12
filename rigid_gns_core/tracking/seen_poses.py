# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which poses of the next frame are measurements, by the tracks before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .lost_spheres import measured
from .tracker_settings import TrackerSettings
from .tracks import Tracks
from ..scenes.state import Array


def seen_in(
    poses: Array, newest: Array | None, tracks: Tracks, settings: TrackerSettings
) -> NDArray[np.bool_]:
    """Whether each pose of the next frame is a measurement, shape (n,), see `lost_at_origin`.

    Args:
        poses: Of the frame, shape (n, 7).
        newest: Those of the newest frame before; None: there is none.
        tracks: Tracks before it.
        settings: Of the filter.
    """
    seen = measured(poses)
    there = (poses[:, :3] == 0.0).all(axis=1)
    if not there.any():
        return seen
    if not len(tracks.ids):
        new = newest if newest is not None and settings.matched else poses[there]
        stays = bool((new[:, :3] == 0.0).all(axis=1).any())
        return seen & ~(there & (settings.environment.overlaps_origin() or not stays))
    last = len(tracks.seen) - 1 - np.argmax(tracks.seen[::-1], axis=0)
    at_origin = (tracks.poses[last, np.arange(len(last)), :3] == 0.0).all(axis=1)
    if settings.matched:
        return seen & ~(there & (not at_origin.any()))
    # a frame with another number of spheres is refused anyway
    return seen & ~(there & ~at_origin) if len(last) == len(there) else seen
