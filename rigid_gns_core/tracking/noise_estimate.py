# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A tracker's noise, from what no motion between contacts can do: third differences."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .pose_noise import normal_spread
from ..scenes.state import Array

# newest third differences kept: their number gives the noise within some per cent
KEPT = 1200
# fewer tell too little
LEAST = 24


@dataclass(frozen=True)
class NoiseEstimate:
    """The estimate of the noise so far.

    Args:
        values: Newest third differences [m], shape (m,).
    """

    values: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def spread(self) -> float | None:
        """Standard deviation of their normal part [m]; None where they are too few to tell."""
        return normal_spread(self.values) if len(self.values) >= LEAST else None

    def after(self, values: Array, most: int) -> NoiseEstimate:
        """Return it with newer ones, of which and of the older ones at most so many are kept."""
        both = np.concatenate([self.values, values])
        return NoiseEstimate(both[len(both) - min(most, len(both)) :])


def third_differences(times: Array, positions: Array, seen: NDArray[np.bool_]) -> Array:
    """Those of four frames, each with the standard deviation of one coordinate [m], shape (m,).

    Args:
        times: [s], shape (4,), at any distances.
        positions: Centres [m], shape (4, n, 3).
        seen: Shape (4, n); spheres that were not seen in all are left out.
    """
    gaps = times[:, None] - times + np.eye(4)
    factors = 1.0 / gaps.prod(axis=1)
    factors /= np.linalg.norm(factors)
    whole = positions[:, seen.all(axis=0)]
    # differences first: they are small where positions are not
    differences: Array = np.einsum('f,fnc->nc', factors, whole - whole[-1:])
    return differences.ravel()
