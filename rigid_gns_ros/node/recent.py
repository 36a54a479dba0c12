# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics over a sliding window of time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import time

import numpy as np

SPAN = 10.0  # length of the window [s]


class Recent:
    """Values of the last `SPAN` seconds.

    Args:
        clock: Monotonic clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._begun = self._last = clock()
        self._values: deque[tuple[float, float]] = deque()

    def add(self, value: float = 1.0) -> None:
        """Add a value."""
        self._last = self._clock()
        self._values.append((self._last, value))
        self._trim()

    def __len__(self) -> int:
        self._trim()
        return len(self._values)

    @property
    def sum(self) -> float:
        """Sum of the values."""
        self._trim()
        return sum(value for _, value in self._values)

    @property
    def rate(self) -> float:
        """Values per second, over the time since creation where that is shorter [Hz]."""
        return len(self) / min(SPAN, max(self._clock() - self._begun, 1e-9))

    @property
    def since_last(self) -> float:
        """Time since the last value, or since creation [s]."""
        return self._clock() - self._last

    def quantiles(self, *shares: float) -> list[float]:
        """Quantiles of the values, `shares` from 0 to 1; NaN without values."""
        if not len(self):
            return [float('nan')] * len(shares)
        values = np.quantile([value for _, value in self._values], shares)
        return [float(value) for value in values]

    def _trim(self) -> None:
        oldest = self._clock() - SPAN
        while self._values and self._values[0][0] < oldest:
            self._values.popleft()
