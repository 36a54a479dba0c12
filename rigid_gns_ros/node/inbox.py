# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages that were taken from the middleware and wait to be processed.

A message that comes alone finds the processor's caches cold and takes three times as long as one
that follows another. So those that nothing follows from yet are processed together, before the
executor calls anything else.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

MOST = 8  # messages that wait


class Inbox:
    """Processes messages of all topics in the order in which they were taken."""

    def __init__(self) -> None:
        # whether messages may wait for what the executor calls next
        self.may_wait: Callable[[], bool] = lambda: False
        self._waiting: deque[Callable[[], None]] = deque()

    def __len__(self) -> int:
        """Number of messages that come after the one that is processed."""
        return len(self._waiting)

    def put(self, process: Callable[[], None]) -> None:
        """Take a message, which `process` processes; `settle` is called after the last one."""
        self._waiting.append(process)

    def settle(self, *, now: bool = True) -> None:
        """Process all messages; if not `now`, only where they may not wait."""
        if now or len(self._waiting) >= MOST or not self.may_wait():
            while self._waiting:
                self._waiting.popleft()()
