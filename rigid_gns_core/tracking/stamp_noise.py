# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Noise of a ball's positions whose stamps jitter: a stamp off by dt is a position off by v dt.

So the noise along the motion is larger than across it. Third differences show it, which vanish for
any motion between contacts, whatever the intervals; true stamps that are irregular show none.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .jit import entry, plain
from ..scenes.state import Array

# frames of a third difference, and the least number of frames that tell the noise of one axis
_FRAMES, _FEWEST = 4, 12
# what is along the motion counts beyond the noise by this over the root of the number of values:
# two deviations of their spread, as those side by side are alike
_BEYOND = 2.0
# standard deviation of a normal distribution by its median absolute value
_MAD = 1.4826


@entry
def with_stamp_noise(times: Array, positions: Array, noise: float) -> float:
    """Noise of a coordinate of one ball, or that along its motion where this is larger [m].

    Args:
        times: Rising times [s], shape (m,).
        positions: Centres [m], shape (m, 3).
        noise: Standard deviation of a coordinate of the tracker [m].
    """
    count = len(times) - _FRAMES + 1
    if len(times) < _FEWEST:
        return noise
    values, factors = np.zeros(count), np.zeros(_FRAMES)
    for k in range(count):
        for i in range(_FRAMES):
            factors[i] = 1.0
            for j in range(_FRAMES):
                if j != i:
                    factors[i] /= times[k + i] - times[k + j]
        total = way = 0.0
        for c in range(3):
            off, step = 0.0, positions[k + _FRAMES - 1, c] - positions[k, c]
            for i in range(_FRAMES):
                off += factors[i] * (positions[k + i, c] - positions[k, c])
            total += off * step
            way += step * step
        norm = math.sqrt((factors**2).sum() * way)
        values[k] = abs(total) / norm if norm > 0.0 else 0.0
    along = _MAD * float(np.median(values))
    return along if along > (1.0 + _BEYOND / math.sqrt(count)) * noise else noise


def noise_with_stamps(
    times: Array, positions: Array, seen: NDArray[np.bool_], noise: float
) -> float:
    """The largest of all balls, see `with_stamp_noise`; positions of shape (m, n, 3)."""
    each = [
        with_stamp_noise(plain(times[own]), plain(positions[own, ball]), noise)
        for ball, own in enumerate(seen.T)
    ]
    return max(each, default=noise)
