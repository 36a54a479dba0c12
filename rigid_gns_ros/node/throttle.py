# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Log lines that could repeat, held back."""

from __future__ import annotations

import math


class Throttle:
    """Admits one message of a kind per period, and counts those held back.

    Args:
        period: Least time between two messages of one kind [s].
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self._next: dict[str, float] = {}
        self._held: dict[str, int] = {}

    def admit(self, kind: str, now: float) -> int | None:
        """Return how many of that kind were held back since the last one; None: hold back this.

        Args:
            kind: What is counted.
            now: Time of any steady clock [s].
        """
        if now < self._next.get(kind, -math.inf):
            self._held[kind] = self._held.get(kind, 0) + 1
            return None
        self._next[kind] = now + self.period
        return self._held.pop(kind, 0)
