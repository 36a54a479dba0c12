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

"""Spheres that were not seen for a few frames, put in where their motion leads."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .alignment import MAX_GAP
from .resample import resample
from ..forecasts.interpolation import Stamps
from ..scenes.scene import Scene
from ..scenes.state import Array


def fill_short_gaps(stamps: Stamps, poses: Array, scene: Scene, noise: float) -> int:
    """Put in poses where a sphere was not seen for up to three intervals, see `resample`.

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
        missing = _short_gaps(stamps, seen)
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


def _short_gaps(stamps: Stamps, seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Frames of gaps of up to three intervals, shape (m,)."""
    known = np.flatnonzero(seen)
    longest = MAX_GAP * float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
    gaps = [
        np.arange(before + 1, after)
        for before, after in pairwise(known)
        if after - before > 1 and stamps[after] - stamps[before] <= longest
    ]
    return np.concatenate([np.zeros(0, dtype=np.int64), *gaps])
