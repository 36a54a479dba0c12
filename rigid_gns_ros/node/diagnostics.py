# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator's /diagnostics: statistics of the last 10 s, and levels by docs/node.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TYPE_CHECKING

from rigid_gns_core.forecasts.schedule import OVERLOAD_COUNT
from rigid_gns_core.forecasts.window_setup import longest_gap
from rigid_gns_core.messages.diagnostics import ERROR, OK, Status, WARN
from rigid_gns_core.tracking.usable_frames import seconds
from rigid_gns_core.tracking.window import TrackingWindow

from .recent import Recent, SPAN

if TYPE_CHECKING:
    from rigid_gns_core.bags.writer import BagWriter
    from rigid_gns_core.forecasts.forecaster import Forecaster
    from rigid_gns_core.forecasts.predictor import Predictor

LATE_SHARE = 0.5  # 99th percentile of lateness that is a warning [periods]


class Diagnostics:
    """Counts events and reports them as diagnostic statuses.

    Args:
        name: Name of the node.
        model: Makes the forecasts.
        predictor: Gives errors, starts and counts.
        window: Gives counts of tracked frames and spheres.
    """

    def __init__(
        self, name: str, model: Forecaster, predictor: Predictor, window: TrackingWindow
    ) -> None:
        self._name, self._model, self._predictor, self._window = name, model, predictor, window
        self.rejected = 0
        self._last_rejection = ''
        self._starts = 0
        self.lost = 0
        self._frames, self._rejections, self._losses = Recent(), Recent(), Recent()
        self._lateness, self._late, self._steps = Recent(), Recent(), Recent()
        self._futures, self._superseded, self._failed = Recent(), Recent(), Recent()
        self._shortened = self._failure = self._crossings = ''

    def frame_accepted(self) -> None:
        """Count an accepted tracked frame."""
        self._frames.add()

    def frame_rejected(self, why: str) -> None:
        """Count a rejected tracked message, with the reason."""
        self.rejected += 1
        self._last_rejection = why
        self._rejections.add()

    def frames_lost(self, count: int) -> None:
        """Count tracked messages that were lost before the node took them."""
        self.lost += count
        self._losses.add(count)

    def started(self) -> None:
        """Count a start of a forecast."""
        self._starts += 1

    def stepped(self, times: Sequence[float]) -> None:
        """Note the wall-clock times of model steps [s]."""
        for step_time in times:
            self._steps.add(step_time)

    def due(self, late: float) -> None:
        """Note the lateness [s] of a prediction that was published or skipped."""
        self._lateness.add(late)
        if late > self._predictor.period_ns * 1e-9:
            self._late.add()

    def future_computed(self, took: float, error: str) -> None:
        """Note the time that a future took [s], and why it ends early; empty: it does not."""
        self._futures.add(took)
        self._shortened = error

    def crossings_told(self, planes: Mapping[str, Sequence[Mapping[str, Any]]]) -> None:
        """Note the newest crossings of each plane, see `forecasts.spread`."""
        self._crossings = '; '.join(
            f'sphere {one["sphere"]} crosses {name} in {one["time"]:.3f} s '
            f'(probability {one["probability"]:.2f})'
            for name, found in planes.items()
            for one in found
        )

    def future_failed(self, why: str) -> None:
        """Count a frame without a future, with the reason."""
        self._failed.add()
        self._failure = why

    def future_superseded(self) -> None:
        """Count a frame whose future was dropped for that of a newer frame."""
        self._superseded.add()

    def report(
        self,
        *,
        paused: bool,
        horizon: float,
        heard: bool,
        bag: BagWriter | None,
        size: int,
        others: Sequence[Status] = (),
    ) -> list[Status]:
        """Present statuses.

        Args:
            paused: Whether predictions are paused.
            horizon: Length of futures [s]; 0: none.
            heard: Whether anybody hears of them, or a bag records them.
            bag: The recording; None: there is none.
            size: Bytes passed to it.
            others: Of other parts of the node.
        """
        statuses = [self._tracking(), self._prediction(paused), _recording(bag, size)]
        if horizon:
            statuses.append(self._horizon(horizon, heard))
        statuses += others
        return [Status(s.level, f'{self._name}: {s.name}', s.message, s.values) for s in statuses]

    def _tracking(self) -> Status:
        silence = self._frames.since_last
        level, message = OK, 'tracked frames come in'
        if len(self._rejections) and not len(self._frames):
            level = ERROR
            message = f'all tracked messages of the last {SPAN:g} s were rejected'
        elif silence > longest_gap(self._model):
            level = WARN
            message = f'no tracked frame for {silence:.1f} s'
        elif len(self._rejections):
            level = WARN
            message = f'{len(self._rejections)} tracked messages rejected in the last {SPAN:g} s'
        elif len(self._losses):
            level = WARN
            lost = self._losses.sum
            message = f'{lost:g} tracked messages were lost in the last {SPAN:g} s'
        values = {
            'rate [Hz]': f'{self._frames.rate:.3g}',
            'since the newest frame [s]': f'{silence:.3g}',
            'spheres': str(self._window.count or 0),
            'noise [m]': f'{self._window.noise:.3g}'
            + ('' if self._window.knows_noise else ', a guess: too few frames tell it'),
            'lost': str(self.lost),
            'rejected': str(self.rejected),
            'last rejection': self._last_rejection,
            **{name: str(count) for name, count in self._window.counts.items()},
        }
        return Status(level, 'tracking', message, values)

    def _prediction(self, paused: bool) -> Status:
        predictor, lateness, late = self._predictor, self._lateness, len(self._late)
        period = predictor.period_ns * 1e-9
        level, message = OK, 'predictions are in time'
        if paused:
            message = 'paused'
        elif predictor.forecast is None:
            level, message = WARN, 'waiting for tracked frames to start from'
        elif late >= OVERLOAD_COUNT and late == len(lateness):
            level, message = ERROR, f'all predictions of the last {SPAN:g} s were late by a period'
        elif late:
            level, message = (
                WARN,
                f'{late} predictions were late by a period in the last {SPAN:g} s',
            )
        elif lateness.quantiles(0.99)[0] > LATE_SHARE * period:
            level, message = WARN, 'predictions are late by half a period'
        elif predictor.beyond_bound:
            level, message = WARN, 'the prediction is off by more than resync_error'
        values = {
            'model': self._model.simulator.name,
            'scene': self._model.scene_name,
            'rate [Hz]': f'{lateness.rate:.3g}',
            'period [s]': f'{period:.6g}',
            **{name: str(count) for name, count in predictor.counts.items()},
            **_milliseconds('lateness', lateness, p50=0.5, p99=0.99, worst=1.0),
            **_milliseconds('step time', self._steps, p50=0.5, p99=0.99, worst=1.0),
            **self._error(),
            **self._start(),
        }
        return Status(level, 'prediction', message, values)

    def _error(self) -> dict[str, str]:
        error = self._predictor.last_error
        if error is None:
            return {'error mean [m]': '', 'error worst [m]': '', 'error worst [radii]': ''}
        return {
            'error mean [m]': f'{error.mean:.4g}',
            'error worst [m]': f'{error.worst:.4g}',
            'error worst [radii]': f'{error.worst / self._model.radius:.4g}',
        }

    def _start(self) -> dict[str, str]:
        start = self._predictor.last_start
        return {
            'starts': str(self._starts),
            'last start: reason': start.reason if start else '',
            'last start: stamp [s]': seconds(start.stamp_ns) if start else '',
        }

    def _horizon(self, horizon: float, heard: bool) -> Status:
        level, message = OK, 'every tracked frame has its future'
        if len(self._failed):
            level, message = WARN, self._failure
        elif self._shortened and len(self._futures):
            level, message = WARN, f'the last future ends early: {self._shortened}'
        elif dropped := len(self._superseded):
            level = WARN
            message = f'{dropped} frames of the last {SPAN:g} s got no future: it takes too long'
        elif not heard:
            message = 'nobody hears of futures, so none is computed'
        values = {
            'horizon [s]': f'{horizon:g}',
            'rate [Hz]': f'{self._futures.rate:.3g}',
            **_milliseconds('time', self._futures, p50=0.5, worst=1.0),
            'frames without': str(len(self._superseded) + len(self._failed)),
            'crossings': self._crossings,
        }
        return Status(level, 'horizon', message, values)


def _recording(bag: BagWriter | None, size: int) -> Status:
    if bag is None:
        return Status(OK, 'recording', 'not recording', {'bytes': '0', 'lost': '0'})
    level, message = OK, f'recording into {bag.folder}'
    if bag.error:
        level, message = ERROR, bag.error
    elif bag.lost:
        level, message = WARN, f'{bag.lost} messages were not recorded'
    return Status(level, 'recording', message, {'bytes': str(size), 'lost': str(bag.lost)})


def _milliseconds(name: str, times: Recent, **shares: float) -> dict[str, str]:
    """Quantiles of times for the statuses, by their names; empty texts without any."""
    found = times.quantiles(*shares.values())
    texts = [f'{1e3 * value:.3f}' if len(times) else '' for value in found]
    return {f'{name} {which} [ms]': text for which, text in zip(shares, texts, strict=True)}
