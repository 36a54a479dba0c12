# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise of the newest frames of balls whose stamps jitter, at the speed that balls have there.

`stamp_noise` tells the noise of a whole window, over slow and fast parts. A velocity from the last
frames, of which two may have stamps close to each other, is off by more where the ball is fast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .stamp_noise import noise_with_stamps
from ..scenes.state import Array

# frames of a third difference, and third differences of the newest frames
_FRAMES, _NEWEST = 4, 3
# standard deviation of a normal distribution by its median absolute value
_MAD = 1.4826


def newest_noise(times: Array, positions: Array, seen: NDArray[np.bool_], noise: float) -> float:
    """Standard deviation of a coordinate of the newest frames [m], the largest of all balls.

    Args:
        times: Rising times [s], shape (m,).
        positions: Centres [m], shape (m, n, 3).
        seen: Whether a ball was seen, shape (m, n).
        noise: Standard deviation of a coordinate of the tracker [m].
    """
    own = noise_with_stamps(times, positions, seen, noise)
    if own <= noise:
        return noise
    each = [_at_end(times[one], positions[one, ball]) for ball, one in enumerate(seen.T)]
    return max(own, *each)


def _at_end(times: Array, positions: Array) -> float:
    """Jitter [s] times the speed of the newest frames [m]; 0 of a ball that few frames show."""
    if len(times) < _FRAMES + _NEWEST:
        return 0.0
    t = np.lib.stride_tricks.sliding_window_view(times, _FRAMES)
    p = np.lib.stride_tricks.sliding_window_view(positions, _FRAMES, axis=0).swapaxes(1, 2)
    factors = 1.0 / (t[:, :, None] - t[:, None, :] + np.eye(_FRAMES)).prod(axis=2)
    steps = p[:, -1] - p[:, 0]
    lengths = np.linalg.norm(steps, axis=1)
    off = np.einsum('kf,kfc,kc->k', factors, p - p[:, :1], steps)
    speeds = lengths / (t[:, -1] - t[:, 0])
    scale = np.linalg.norm(factors, axis=1) * lengths * speeds
    moving = scale > 0.0
    if not moving.any():
        return 0.0
    jitter = _MAD * float(np.median(np.abs(off[moving]) / scale[moving]))
    return jitter * float(speeds[-_NEWEST:].max())
