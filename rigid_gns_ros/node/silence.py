# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A tracker that is slow, gone or restarted: said, and predictions stop where that is wanted."""

from __future__ import annotations

from typing import Any

from rigid_gns_core.tracking.usable_frames import RESTART_FRAMES
from rigid_gns_core.tracking.window import TrackingWindow

RESTARTED = (
    f'the tracker has restarted, or its clock was set: {RESTART_FRAMES} frames in a row have '
    'stamps that rise, but do not follow the earlier ones; starting again from them'
)


class Silence:
    """Watches the time since the newest tracked frame.

    Args:
        log: Logger of the node.
        timeout: Time without a frame after which predictions stop [s]; 0: never. May change.
    """

    def __init__(self, log: Any, timeout: float) -> None:
        self._log, self.timeout, self._told = log, timeout, False

    def broken(self) -> None:
        """Note a tracked frame."""
        if self._told:
            self._told = False
            self._log.info('tracked frames come again')

    def check(self, silence: float, usual: float) -> bool:
        """Say that no frames come, once; whether predictions shall stop.

        Args:
            silence: Time since the newest frame [s].
            usual: Longest time between two frames that is not worth a word [s].
        """
        stop = 0 < self.timeout < silence
        if stop:
            self._told = True
            self._log.warning(
                f'no tracked frame for {silence:.1f} s: predictions stop until frames come again '
                '(parameter tracker_timeout)'
            )
        elif silence > usual and not self._told:
            self._told = True
            remedy = '' if self.timeout else '; parameter tracker_timeout stops them'
            self._log.warning(
                f'no tracked frame for {silence:.1f} s: predictions go on from the last '
                f'start{remedy}'
            )
        return stop


def too_slow(gap: float, window: TrackingWindow) -> str:
    """What is wrong with tracked frames that are so far apart [s]."""
    return (
        f'tracked frames are {gap:.4g} s apart, more than {window.max_gap_ns * 1e-9:.4g} s, and '
        f'are not fitted together: waiting for {window.length} that are closer; where the tracker '
        'is so slow, set velocity_window:=1 (starts at rest)'
    )
