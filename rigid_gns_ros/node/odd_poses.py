# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses that are accepted and still cannot be right: said, since nothing else would tell."""

from __future__ import annotations

from collections.abc import Callable

from rigid_gns_core.forecasts.live_units import LiveUnits
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.tracking.window import TrackingWindow

TRACKLESS = 20  # frames in a row that give no track, after which it is said


class OddPoses:
    """Warns of poses in other units or axes than the scene, and of poses that give no tracks.

    Args:
        scene: Gives gravity and radius.
        window: What the frames were added to.
        warn: Called with a kind and a sentence.
    """

    def __init__(
        self, scene: Scene, window: TrackingWindow, warn: Callable[[str, str], None]
    ) -> None:
        self._window, self._warn = window, warn
        self._units = LiveUnits(scene, matched=window.settings.matched)
        self._trackless = 0  # frames in a row

    def clear(self) -> None:
        """Begin anew, as with another tracker."""
        self._units.clear()
        self._trackless = 0

    def take(self, frame: PoseArrayFrame) -> None:
        """Look at the next frame that was accepted."""
        if misfit := self._units.take(frame, lambda: self._window.noise):
            self._warn('units', misfit)
        self._trackless = 0 if self._window.count else self._trackless + 1
        if self._trackless > TRACKLESS:
            self._warn(
                'tracks',
                f'{self._trackless} frames in a row show no sphere that moves on from one to the '
                f'next with at most {self._window.settings.max_speed:.3g} m/s (parameter '
                'max_speed): nothing is predicted; are positions in metres, and stamps those of '
                'the measurements?',
            )
