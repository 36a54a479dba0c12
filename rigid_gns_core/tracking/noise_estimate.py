# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measurement noise from third differences, which vanish for any motion between contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .jit import entry, plain
from .pose_noise import normal_spread
from ..scenes.state import Array

# frames of one third difference
NOISE_FRAMES = 4
# third differences kept, the newest ones: enough for the noise within some per cent
MAX_DIFFERENCES = 1200
# fewer give no estimate
MIN_DIFFERENCES = 24


@dataclass(frozen=True)
class NoiseEstimate:
    """Estimate of the measurement noise from the third differences so far.

    Args:
        values: Newest third differences [m], shape (m,).
    """

    values: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def spread(self) -> float | None:
        """Standard deviation of a coordinate [m], contacts left out; None from too few values."""
        return normal_spread(self.values) if len(self.values) >= MIN_DIFFERENCES else None

    def updated(self, values: Array, limit: int) -> NoiseEstimate:
        """Estimate with newer third differences [m], shape (k,), from at most `limit` values."""
        both = np.concatenate([self.values, values])
        return NoiseEstimate(both[len(both) - min(limit, len(both)) :])


def third_differences(times: Array, positions: Array, seen: NDArray[np.bool_]) -> Array:
    """Third differences of four frames, scaled to the noise of one coordinate [m], shape (m,).

    Args:
        times: Times of the frames [s], shape (4,), at any intervals.
        positions: Centres [m], and what is tracked besides, shape (4, n, 3 or more).
        seen: Whether a sphere was seen, shape (4, n); those not seen in all four are left out.
    """
    differences = np.empty(3 * seen.shape[1])
    count = _differences(plain(times), plain(positions), np.ascontiguousarray(seen), differences)
    return differences[:count]


@entry
def _differences(
    times: Array, positions: Array, seen: NDArray[np.bool_], differences_out: Array
) -> int:
    factors = np.empty(4)
    total = 0.0
    for f in range(4):
        product = 1.0
        for other in range(4):
            if other != f:
                product *= times[f] - times[other]
        factors[f] = 1.0 / product
        total += factors[f] * factors[f]
    size, count = np.sqrt(total), 0
    for i in range(seen.shape[1]):
        if not (seen[0, i] and seen[1, i] and seen[2, i] and seen[3, i]):
            continue
        for k in range(3):
            sum_ = 0.0
            for f in range(3):
                # differences first: they are small where positions are not
                sum_ += factors[f] / size * (positions[f, i, k] - positions[3, i, k])
            differences_out[count] = sum_
            count += 1
    return count
