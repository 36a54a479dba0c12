# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spheres that were not seen in a frame or two, filled in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .resample import resample
from ..scenes.scene import Scene
from ..scenes.state import Array
from ..tracking.usable_frames import short_gaps, Stamps


def fill_short_gaps(stamps: Stamps, poses: Array, scene: Scene, noise: float) -> int:
    """Fill gaps of up to two frames in a track, see `resample`.

    Args:
        stamps: Stamps of the frames [ns], shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7), NaN where a sphere was
            not seen; overwritten there.
        scene: Gives gravity and radii.
        noise: Standard deviation of each coordinate of a position [m].

    Returns:
        Number of poses filled in.
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


def complete(poses: Array) -> NDArray[np.int64]:
    """Indices of the frames in which all poses, shape (k, n, 7), are known."""
    return np.flatnonzero(np.isfinite(poses).all(axis=(1, 2)))
