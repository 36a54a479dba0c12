# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames of a bag heard again by a window, so that it stands where the node's stood."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np

from .tracked_frames import Decoded
from ..forecasts.starts import Start
from ..tracking.usable_frames import RejectedFrame, seconds
from ..tracking.window import TrackingWindow

# reasons of starts before which the node had forgotten all frames
_FROM_NOTHING = ('first', 'reset', 'restart')
_MOST_TRIED = 20  # frames before the window from which such a start is tried


def replayed(
    window: TrackingWindow,
    tracked: Decoded,
    starts: list[Start],
    on_frame: Callable[[int, int], None] = lambda _frame, _life: None,
) -> Iterator[tuple[Start, str]]:
    """Each start once the window has heard what the node had heard; and why it cannot be had.

    Args:
        window: As the node's; nothing heard yet.
        tracked: Frames that the node accepted.
        starts: Recorded ones.
        on_frame: Called with the index of each frame that was heard, and which life of the window
            it was: a new one begins where all was forgotten. A frame that is heard again, as it
            turns out to be of another life, is told again.
    """
    order = np.argsort(tracked.places, kind='stable')
    frames = [tracked.frames[index] for index in order]
    places, times = tracked.places[order], tracked.times[order]

    def hear(begin: int, end: int) -> None:
        for index in range(begin, end):
            # refused now, but not then: where the clock of the node was set meanwhile
            with suppress(RejectedFrame):
                window.add(frames[index], int(times[index]))
                on_frame(int(order[index]), life)

    there: dict[int, int] = {}  # index of the newest frame of each stamp
    heard = life = 0
    for start in starts:
        end = int(np.searchsorted(places, start.place))
        there |= {frames[index].stamp_ns: index for index in range(heard, end)}
        missing = [stamp for stamp in start.window_ns if stamp not in there]
        if missing:
            error = (
                f'{len(missing)} of its {len(start.window_ns)} tracked frames are not in the bag, '
                f'the first of stamp {seconds(missing[0])} s'
            )
        else:
            error = 'the tracked frames in the bag give no such start'
        anew = start.reason in _FROM_NOTHING
        latest = there.get(start.window_ns[0], end) if start.window_ns else end
        hear(heard, max(heard, latest) if anew else end)
        if start.window_ns and (anew or not _is_at(window, start)):
            # what was heard before was forgotten, at the latest at the first frame of the window;
            # earlier where no sphere was found in the first frames after that
            life += 1
            for begin in range(latest, max(0, latest - _MOST_TRIED) - 1, -1):
                window.clear()
                hear(begin, end)
                if _is_at(window, start):
                    break
        heard = max(heard, end)
        yield start, '' if not missing and _is_at(window, start) else error
    hear(heard, len(frames))


def _is_at(window: TrackingWindow, start: Start) -> bool:
    """Whether a window gives this start."""
    return (
        window.full
        and window.start()[0] == start.stamp_ns
        and start.ids in (None, window.ids)
        and start.noise in (None, window.noise)
    )
