# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Repeated log messages: one of each kind per period, and how many there were."""

from __future__ import annotations

import math
import time
from typing import Any

LOG_PERIOD = 5.0
"""Least time between warnings of one kind [s]."""


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


class Warner:
    """Logs a warning, unless one of the same kind was logged within `LOG_PERIOD`.

    Args:
        log: Logger of the node.
    """

    def __init__(self, log: Any) -> None:
        self._log, self._throttle = log, Throttle(LOG_PERIOD)

    def __call__(self, kind: str, text: str) -> None:
        """Warn by `text`; `kind` tells which warnings are alike."""
        held = self._throttle.admit(kind, time.monotonic())
        if held is not None:
            more = f' ({held} more since the last line)' if held else ''
            self._log.warning(text + more)
