# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node goes on learning: its scene is fitted to its own tracks, beside what else it does."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from rigid_gns_core.errors import UserError
from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.learned_scene import LearnedScene, write_learned
from rigid_gns_core.messages.diagnostics import OK, Status, WARN
from rigid_gns_core.prediction.laws import LawsSimulator
from rigid_gns_core.relearning.background import Background
from rigid_gns_core.relearning.kept_tracks import KeptTracks, MOST_BALLS
from rigid_gns_core.relearning.relearn import FEWEST
from rigid_gns_core.tracking.warm import warm_up_laws
from rigid_gns_core.tracking.window import TrackingWindow

from .throttle import Warner

EVERY = 10  # new tracks between two fits
PATIENCE_NS = 5_000_000_000  # a better scene waits so long for the end of a track [ns]


class Learning:
    """Keeps tracks, fits a scene to them at times, and tells when it is to be taken.

    Args:
        model: Gives the scene.
        window: Gives tracked spheres.
        take: Called with a scene that is better than the present one.
        log: Logger of the node.
        on: Whether to learn; if not, all methods do nothing.

    Raises:
        UserError: The model is not the laws, or a surface of the scene moves.
    """

    def __init__(
        self,
        model: Forecaster,
        window: TrackingWindow,
        take: Callable[[LearnedScene], object],
        log: Any,
        *,
        on: bool,
    ) -> None:
        self.on = on
        if not on:
            return
        kind, scene = model.simulator.kind, model.scene
        if kind != LawsSimulator.kind:
            raise UserError(
                f'learn is set, but the model is of kind {kind}, and only the laws are fitted; '
                'leave the parameter model empty'
            )
        if any(surface.changes_place for surface in scene.surfaces):
            raise UserError(
                'learn is set, but a surface of the scene moves, and tracks do not say where it '
                'was; leave it out of the scene, or bind it to a topic by moving_surfaces'
            )
        warm_up_laws()  # not in the middle of a run
        self._model, self._window, self._given = model, window, scene
        self._take, self._log, self._warn = take, log, Warner(log)
        self._kept, self._background = KeptTracks(scene), Background()
        self._fitted_at = 0  # number of tracks at the last fit
        self._fits = self._taken = 0
        self._waiting: LearnedScene | None = None
        self._since_ns = 0  # when it came
        self.newest: LearnedScene | None = None  # of those that were taken
        self._last = 'none'  # what came of the last fit

    def before(self, stamp_ns: int, now: int) -> None:
        """Take a better scene, where it is time for it: between tracks, or after some patience.

        Args:
            stamp_ns: Stamp of the next frame [ns].
            now: Time of the node's clock [ns].
        """
        if not self.on:
            return
        self._look(now)
        if self._waiting is None:
            return
        if not self._kept.ends(stamp_ns) and abs(now - self._since_ns) < PATIENCE_NS:
            return
        self.newest, self._waiting = self._waiting, None
        self._taken += 1
        self._log.info(f'a learned scene is taken: {self.newest.text}')
        self._take(self.newest)

    def after(self) -> None:
        """Keep the newest frame; begin a fit where there are enough new tracks."""
        if not self.on or not self._window.count:
            return
        ids = self._window.ids
        if len(ids) > MOST_BALLS:
            self._warn(
                'learn',
                f'nothing is learned from {len(ids)} spheres at once, at most {MOST_BALLS} count',
            )
        stamp, centres = self._window.newest()
        self._kept.take(stamp, ids, centres)
        new = self._kept.finished - self._fitted_at
        if new < (EVERY if self._fits else FEWEST) or self._background.busy or self._waiting:
            return
        self._fits, self._fitted_at = self._fits + 1, self._kept.finished
        self._background.start(self._kept.tracks, self._given, self._model.scene)

    def save(self, path: str) -> str:
        """Write the scene that was taken last to a file; a sentence.

        Raises:
            UserError: There is none, or no file is named.
            OSError: The file cannot be written, or is not of this node.
        """
        if not self.on:
            raise UserError('the parameter learn is not set')
        if self.newest is None:
            raise UserError(f'nothing better than the given scene has been learned; {self._last}')
        if not path:
            raise UserError('the parameter learned_scene is empty; set it to a YAML file')
        file = Path(path).expanduser()
        write_learned(file, self.newest)
        return f'wrote {file}: {self.newest.text}'

    def status(self) -> list[Status]:
        """Diagnostics; none where nothing is learned."""
        if not self.on:
            return []
        failed = self._last.startswith('failed')
        values = {
            'tracks': str(self._kept.finished),
            'fits': str(self._fits),
            'fit running': str(self._background.busy),
            'scenes taken': str(self._taken),
            'last fit': self._last,
            'scene': self.newest.text if self.newest else 'as given',
        }
        message = self._last if failed else 'learning from tracks'
        return [Status(WARN if failed else OK, 'learning', message, values)]

    def close(self) -> None:
        """End a fit that runs."""
        if self.on:
            self._background.close()

    def _look(self, now: int) -> None:
        """Take the result of a fit, where it is there."""
        try:
            found = self._background.take()
        except UserError as error:
            self._last = f'failed: {error}'
            self._warn('learn', f'nothing learned: {error}')
            return
        if found is None:
            return
        self._last = f'{"better" if found.better else "not better"}: {found.text}'
        if found.better:
            self._waiting, self._since_ns = found, now
        else:
            self._log.info(f'the scene stays, as another is not better: {found.text}')
