# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Measurement noise from third differences, which vanish for any motion between contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

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
        positions: Centres [m], shape (4, n, 3).
        seen: Whether a sphere was seen, shape (4, n); those not seen in all four are left out.
    """
    gaps = times[:, None] - times + np.eye(4)
    factors = 1.0 / gaps.prod(axis=1)
    factors /= np.linalg.norm(factors)
    whole = positions[:, seen.all(axis=0)]
    # differences first: they are small where positions are not
    differences: Array = np.einsum('f,fnc->nc', factors, whole - whole[-1:])
    return differences.ravel()
