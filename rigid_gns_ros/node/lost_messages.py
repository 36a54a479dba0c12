# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages that a subscription never took, told by the sequence numbers of their publishers.

A queue of limited depth drops the oldest message without a word, and best effort drops what the
network loses. Fast DDS numbers the messages of each publisher; rclpy tells the number, but not the
publisher.
"""

from __future__ import annotations

from collections.abc import Callable

_MOST = 100  # publishers that are told apart


class LostMessages:
    """Counts gaps in the sequence numbers of one topic.

    Args:
        publishers: Number of publishers of the topic, asked where a number is not the next one.
    """

    def __init__(self, publishers: Callable[[], int]) -> None:
        self._publishers = publishers
        self._newest: list[int] = []  # number of the newest message by publisher, latest used last
        self.total = 0

    def take(self, number: int | None) -> int:
        """Note a message that came; how many were lost before it.

        Args:
            number: Its sequence number; None: the middleware has none.
        """
        if number is None:
            return 0
        if self._newest and self._newest[-1] + 1 == number:  # as nearly always
            self._newest[-1] = number
            return 0
        before = max((newest for newest in self._newest if newest < number), default=None)
        if before is not None and before + 1 < number:
            known = self._publishers()
            del self._newest[: max(len(self._newest) - known, 0)]  # of publishers that have gone
            # a publisher that is not known yet may have sent before this node was there
            if len(self._newest) < known or before not in self._newest:
                before = None
        if before is not None:
            self._newest.remove(before)
        self._newest.append(number)
        del self._newest[:-_MOST]  # some make a new publisher for each message
        lost = 0 if before is None else number - before - 1
        self.total += lost
        return lost


def lost_text(topic: str, depth: int, total: int) -> str:
    """What to do about messages that were lost, `total` so far, with a queue of `depth`."""
    return (
        f'tracked messages were lost on the way or in the queue, {total} so far; where the node '
        f'is too busy to take them in time, give it a longer queue than {depth}: '
        f'-p qos_overrides.{topic}.subscription.depth:=100'
    )
