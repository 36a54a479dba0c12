# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Replay of recorded frames into a window, which brings it into the state of the node's."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

import numpy as np

from .decoded_topic import DecodedTopic
from ..forecasts.learned_scene import LearnedScene
from ..forecasts.starts import Start
from ..tracking.usable_frames import RejectedFrame, seconds
from ..tracking.window import TrackingWindow

# reasons of starts before which the node had emptied its window
_FROM_NOTHING = ('first', 'reset', 'restart', 'learned')
_MOST_TRIED = 20  # frames before the window from which such a start is attempted


def replay_starts(
    window: TrackingWindow,
    tracked: DecodedTopic,
    starts: list[Start],
    on_frame: Callable[[int, int], None] = lambda _frame, _epoch: None,
    learned: Sequence[LearnedScene] = (),
    on_learned: Callable[[LearnedScene], None] = lambda _: None,
) -> Iterator[tuple[Start, str]]:
    """Replay the frames up to each start in turn, and yield it with the window in its state.

    Args:
        window: Empty window with the node's parameters.
        tracked: Frames that the node accepted.
        starts: Recorded starts.
        on_frame: Called with the index of each replayed frame and the epoch of the window; a new
            epoch begins where the window was emptied. A frame that turns out to be of another
            epoch is replayed, and passed, again.
        learned: Scenes that took the place of the first, in the order of recording.
        on_learned: Called with each of them where it comes.

    Yields:
            The start, and why the window does not give it; empty: it does.
    """
    order = np.argsort(tracked.indices, kind='stable')
    frames = [tracked.frames[index] for index in order]
    indices, times = tracked.indices[order], tracked.times[order]

    def replay(begin: int, end: int) -> None:
        for index in range(begin, end):
            # refused here, but not in the node: where the node's clock was set meanwhile
            with suppress(RejectedFrame):
                window.add(frames[index], int(times[index]))
                on_frame(int(order[index]), epoch)

    newest_of: dict[int, int] = {}  # index of the newest frame with each stamp
    replayed = epoch = 0
    changes = list(learned)
    for start in starts:
        while changes and changes[0].index < start.index:
            end = int(np.searchsorted(indices, changes[0].index))
            replay(replayed, end)
            replayed = max(replayed, end)
            window.take_scene(changes[0].scene)
            on_learned(changes.pop(0))
        end = int(np.searchsorted(indices, start.index))
        newest_of |= {frames[index].stamp_ns: index for index in range(replayed, end)}
        missing = [stamp for stamp in start.window_ns if stamp not in newest_of]
        if missing:
            error = (
                f'{len(missing)} of its {len(start.window_ns)} tracked frames are not in the bag, '
                f'the first of stamp {seconds(missing[0])} s'
            )
        else:
            error = 'the tracked frames in the bag give no such start'
        anew = start.reason in _FROM_NOTHING
        latest = newest_of.get(start.window_ns[0], end) if start.window_ns else end
        replay(replayed, max(replayed, latest) if anew else end)
        if start.window_ns and (anew or not _is_at(window, start)):
            # the node's window was emptied at the first frame of the start's window at the latest,
            # earlier where no track was initiated in the first frames after that
            epoch += 1
            for begin in range(latest, max(0, latest - _MOST_TRIED) - 1, -1):
                window.clear()
                replay(begin, end)
                if _is_at(window, start):
                    break
        replayed = max(replayed, end)
        yield start, '' if not missing and _is_at(window, start) else error
    replay(replayed, len(frames))


def _is_at(window: TrackingWindow, start: Start) -> bool:
    """Whether the window gives this start."""
    return (
        window.full
        and window.start()[0] == start.stamp_ns
        and start.ids in (None, window.ids)
        and start.noise in (None, window.noise)
    )
