# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compact text of poses: quantised, differences in time, deflated, base64."""

from __future__ import annotations

import base64
from typing import Any
import zlib

import numpy as np

from ...scenes.state import Array

POSITION_LEVELS = 65535
QUATERNION_LEVEL = 127  # half a degree


def pack_positions(positions: Array, low: Array, high: Array) -> dict[str, Any]:
    """Pack positions between `low` and `high` in 65 535 levels.

    Args:
        positions: Centres [m], shape (frames, n, 3).
        low: Minimum of each coordinate [m], shape (3,).
        high: Maximum of each coordinate [m], shape (3,).

    Returns:
        `data` as text, `offset` and `scale` [m], shape (3,): position = offset + scale * integer.
    """
    scale = np.maximum(high - low, 1e-9) / POSITION_LEVELS
    levels = np.rint((positions - low) / scale - POSITION_LEVELS // 2 - 1)
    offset = low + scale * (POSITION_LEVELS // 2 + 1)
    return {'data': _pack(levels, 'i2'), 'offset': offset.tolist(), 'scale': scale.tolist()}


def pack_quaternions(quaternions: Array) -> dict[str, Any]:
    """Pack rotations (x, y, z, w), shape (frames, n, 4), to half a degree, not normalised."""
    return {'data': _pack(np.rint(quaternions * QUATERNION_LEVEL), 'i1')}


def _pack(levels: Array, dtype: str) -> str:
    """Pack sphere by sphere; differences in time wrap around, as do the sums of the reader."""
    rows = np.moveaxis(levels.astype(f'<{dtype}'), 0, 2)
    differences = rows.copy()
    with np.errstate(over='ignore'):
        differences[..., 1:] = rows[..., 1:] - rows[..., :-1]
    packed = zlib.compress(np.ascontiguousarray(differences).tobytes(), 9)
    return base64.b64encode(packed).decode('ascii')
