# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Schedule of predictions: their stamps, and which late ones are published."""

from __future__ import annotations

from collections import deque

# the grid of a tracked frame replaces the present one where they differ by less [periods]
SNAP = 0.05
# lateness that lasts this long without shrinking is overload, not a stall; so are skips that make
# up half of a span of at least this time, in at least so many events
OVERLOAD_NS = 3_000_000_000
OVERLOAD_COUNT = 5
# a stall up to so many periods long is caught up with, and so many of them in `OVERLOAD_NS`
CATCH_UP = STALLS = 3


class Grid:
    """Stamps of predictions: origin + index * period, in whole nanoseconds and without drift.

    Args:
        origin_ns: Stamp of the frame from which periods are counted [ns].
        period: Time between predictions [s].
    """

    def __init__(self, origin_ns: int, period: float) -> None:
        self.origin_ns, self.period = origin_ns, period
        self.index = 0

    @property
    def stamp_ns(self) -> int:
        """Stamp of the present prediction [ns]."""
        return self._stamp(self.index)

    def advance(self) -> None:
        """Advance to the next prediction."""
        self.index += 1

    def skip_to(self, earliest_ns: int) -> int:
        """Advance until the stamp is `earliest_ns` or later; the number of periods skipped."""
        before = self.index
        self.index = max(before, int((earliest_ns - self.origin_ns) / (self.period * 1e9)) - 1)
        while self.stamp_ns < earliest_ns:
            self.index += 1
        return self.index - before

    def snap(self, frame_ns: int) -> None:
        """Count periods from a tracked frame, where that moves the stamp by at most 5 % of one."""
        periods = max(1, round((self.stamp_ns - frame_ns) * 1e-9 / self.period))
        own = Grid(frame_ns, self.period)
        own.index = periods
        if abs(own.stamp_ns - self.stamp_ns) * 1e-9 <= SNAP * self.period:
            self.origin_ns, self.index = frame_ns, periods

    def _stamp(self, index: int) -> int:
        return self.origin_ns + round(index * self.period * 1e9)


class Pacer:
    """Decides whether a late prediction is published, and distinguishes overload from a stall.

    Up to one period late, it is published, and after a short stall up to `CATCH_UP`; later, only
    if the last one was published at least a period ago. So in overload every computed prediction
    is published, but no burst after a long stall.

    Args:
        period_ns: Time between predictions [ns].
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = period_ns
        self.overloaded = False  # whether computing ever failed to keep up
        self.clear()

    def clear(self) -> None:
        """Forget the history, after a clock jump or a new start."""
        self._published_ns: int | None = None
        self._stalls: deque[int] = deque(maxlen=STALLS)  # when the last short ones were met
        self._late_count = 0
        self._late_since: tuple[int, int] = (
            0,
            0,
        )  # first of the late ones in a row: when, by what
        self._skips: deque[tuple[int, int]] = deque()  # when, and how many periods

    def skip(self, count: int, now_ns: int) -> None:
        """Note that `count` predictions were skipped, as computing had fallen behind."""
        skips, span = self._skips, max(OVERLOAD_NS, 3 * OVERLOAD_COUNT * self.period_ns)
        skips.append((now_ns, count))
        while skips[0][0] < now_ns - span:
            skips.popleft()
        # a stall is one long gap, or a few close together; overload lasts
        spread = now_ns - skips[0][0] >= span // 2 and len(skips) >= OVERLOAD_COUNT
        left_out = sum(each for _, each in skips) * self.period_ns
        self.overloaded |= spread and left_out >= span // 2

    def catches_up(self, late_ns: int, now_ns: int) -> bool:
        """Whether a prediction `late_ns` late at `now_ns` is one of those due in a short stall."""
        longest = CATCH_UP * self.period_ns
        long = self._late_count > 0 and self._late_since[1] > longest
        if long or not 0 < late_ns <= longest:
            return False
        stalls = self._stalls
        if stalls and now_ns - stalls[-1] <= longest:
            return True
        if len(stalls) == STALLS and now_ns - stalls[0] <= OVERLOAD_NS:
            return False
        stalls.append(now_ns)
        return True

    def admits(self, late_ns: int, now_ns: int) -> bool:
        """Whether to publish, at `now_ns`, a prediction that is `late_ns` late."""
        if late_ns <= self.period_ns:
            self._late_count = 0
        else:
            self._late_count += 1
            if self._late_count == 1:
                self._late_since = now_ns, late_ns
            since, by = self._late_since
            if self._late_count >= OVERLOAD_COUNT and now_ns - since >= OVERLOAD_NS:
                self.overloaded |= late_ns >= by
            last = self._published_ns
            apart = self.period_ns if last is None else now_ns - last
            if apart < self.period_ns and not self.catches_up(late_ns, now_ns):
                return False
        self._published_ns = now_ns
        return True
