# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotations that a tracker does not know: zero quaternions, see `messages.poses`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..scenes.state import Array

_UNTURNED = (0.0, 0.0, 0.0, 1.0)


def whole_rotations(quaternions: Array, seen: NDArray[np.bool_] | None = None) -> Array:
    """Rotations of the spheres that have one in each frame; of the others (0, 0, 0, 1) in all.

    A sphere whose rotation is known in some frames only would seem to turn between these and the
    others, by any angle. A rotation that never changes is taken for none (`rotating`).

    Args:
        quaternions: Rotations (x, y, z, w), zero where unknown, shape (m, n, 4).
        seen: Whether a sphere was seen, shape (m, n); None: a rotation of NaN is that of one that
            was not.
    """
    unknown = np.asarray(~quaternions.any(axis=-1))
    if seen is not None:
        unknown &= seen
    if not unknown.any():
        return quaternions
    return np.where(np.any(unknown, axis=0, keepdims=True).T, _UNTURNED, quaternions)
