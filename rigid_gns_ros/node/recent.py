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

"""Statistics of the last seconds."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import time

import numpy as np

SPAN = 10.0  # [s]


class Recent:
    """Numbers of the last 10 s.

    Args:
        clock: A steady clock [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._begun = self._last = clock()
        self._values: deque[tuple[float, float]] = deque()

    def add(self, value: float = 1.0) -> None:
        """Take the next number."""
        self._last = self._clock()
        self._values.append((self._last, value))
        self._trim()

    def __len__(self) -> int:
        self._trim()
        return len(self._values)

    @property
    def rate(self) -> float:
        """Numbers per second; over the time since the start, where that is shorter [Hz]."""
        return len(self) / min(SPAN, max(self._clock() - self._begun, 1e-9))

    @property
    def since_last(self) -> float:
        """Time since the last number, or since the start [s]."""
        return self._clock() - self._last

    def quantile(self, share: float) -> float:
        """Quantile, 0 to 1; NaN where there are no numbers."""
        if not len(self):
            return float('nan')
        return float(np.quantile([value for _, value in self._values], share))

    def _trim(self) -> None:
        oldest = self._clock() - SPAN
        while self._values and self._values[0][0] < oldest:
            self._values.popleft()
