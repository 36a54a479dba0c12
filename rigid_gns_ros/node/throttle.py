# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Throttling of repeated log messages."""

from __future__ import annotations

import math


class Throttle:
    """Admits one message of each kind per period, and counts those suppressed.

    Args:
        period: Least time between two messages of one kind [s].
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self._next: dict[str, float] = {}
        self._held: dict[str, int] = {}

    def admit(self, kind: str, now: float) -> int | None:
        """Number of messages of the kind suppressed since the last one; None: suppress this one.

        Args:
            kind: Kind of message.
            now: Time of a monotonic clock [s].
        """
        if now < self._next.get(kind, -math.inf):
            self._held[kind] = self._held.get(kind, 0) + 1
            return None
        self._next[kind] = now + self.period
        return self._held.pop(kind, 0)
