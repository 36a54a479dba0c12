# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages that were taken from the middleware together, each processed in its turn."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable


class Inbox:
    """Processes messages of all topics in the order in which they were taken."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()

    def __len__(self) -> int:
        """Number of messages that come after the one that is processed."""
        return len(self._waiting)

    def put(self, process: Callable[[], None]) -> None:
        """Take a message, which `process` processes."""
        self._waiting.append(process)

    def settle(self) -> None:
        """Process all messages."""
        while self._waiting:
            self._waiting.popleft()()
