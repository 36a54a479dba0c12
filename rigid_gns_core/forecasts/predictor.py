# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which prediction is next, from which frame it starts, and when it is due."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from .forecaster import Forecast, Forecaster, Prediction
from .schedule import Grid, Pacer
from .starts import Reason, Start
from ..errors import UserError
from ..messages.cdr import split_stamp
from ..scenes.plane import Plane
from ..tracking.usable_frames import seconds
from ..tracking.window import TrackingWindow

# where the tracker's clock differs by more from the node's, predictions follow the tracker's [ns]
CLOCK_TOLERANCE_NS = 1_000_000_000


class PredictionError(UserError):
    """There is no start, or no next prediction; `kind` says which."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


@dataclass
class Resync:
    """When a forecast restarts from the newest frame; may change at any time.

    Args:
        start: first: never; every: for each prediction; diverged: when its error exceeds the
            bound.
        bound: Largest error of a forecast that has not diverged, in radii of the largest sphere.
        over: Statistic of that error over the spheres: max or mean.
    """

    start: str = 'first'
    bound: float = 0.5
    over: str = 'max'


@dataclass(frozen=True)
class TrackingError:
    """Position error of a forecast at a tracked frame [m]: mean over spheres, and the worst."""

    stamp_ns: int
    mean: float
    worst: float


class Predictor:
    """Computes one prediction after the other ahead of time, and holds it until it is due.

    `now` and due times are on the node's clock, stamps on the tracker's [ns].

    Args:
        model: Makes the forecasts.
        window: Tracked frames.
        resync: When a forecast restarts.
        on_start: Called with each start of a forecast, before its first prediction.
        warn: Called with a kind and a sentence, possibly often.
        error: Called with a sentence, once.
        surfaces: Gives the surfaces that bodies carry, at a stamp [ns].
    """

    def __init__(
        self,
        model: Forecaster,
        window: TrackingWindow,
        *,
        resync: Resync,
        on_start: Callable[[Start], None],
        warn: Callable[[str, str], None],
        error: Callable[[str], None],
        surfaces: Callable[[int], Mapping[int, Plane]] = lambda _: {},
    ) -> None:
        self._model, self._window, self.resync = model, window, resync
        self._surfaces = surfaces
        self._on_start, self._warn, self._error = on_start, warn, error
        self.period_ns = round(model.period * 1e9)
        self.forecast: Forecast | None = None
        self.pending: Prediction | None = None  # computed, not yet published
        self.last_start: Start | None = None
        self._error_seen: TrackingError | None = None  # last one of the present forecast
        self._compared = False  # whether a frame was compared since the last `compute`
        self.counts = {'published': 0, 'late': 0, 'skipped': 0}
        self._grid = Grid(0, model.period)
        self._pacer = Pacer(self.period_ns)
        self._overload_reported = False
        self._restart_reason: Reason | None = None  # of a restart by the next `compute`
        self._offset_ns = 0  # node's clock minus tracker's clock, 0 where they agree
        self._delay_ns = 0  # delay of all predictions by pauses

    @property
    def every(self) -> bool:
        """Whether each prediction starts from the newest frame."""
        return self.resync.start == 'every'

    @property
    def due_ns(self) -> int:
        """When the present prediction is due, on the node's clock [ns]."""
        return self._grid.stamp_ns + self._offset_ns + self._delay_ns

    @property
    def index(self) -> int:
        """Number of periods since the frame from which stamps are counted."""
        return self._grid.index

    def start(self, now: int, reason: Reason) -> None:
        """Start a forecast from the newest frame; `compute` is called next.

        Raises:
            PredictionError: The frames give no start.
        """
        self.forecast = self._new_forecast(reason)
        self._offset_ns, self._delay_ns = self._clock_offset(self.forecast.start_ns, now), 0
        self._grid = Grid(self.forecast.start_ns, self._model.period)
        self._pacer.clear()

    def stop(self) -> None:
        """Drop the forecast and its pending prediction."""
        self.forecast = self.pending = self._error_seen = self._restart_reason = None

    def restart(self, now: int, reason: Reason) -> None:
        """Restart from the newest frame, keep the stamps, and replace the pending prediction.

        Raises:
            PredictionError: The frames give no start, or the rollout diverged.
        """
        if self.pending is None:
            self._restart_reason = reason  # by the next `compute`
        else:
            self.forecast = self._renewed(now, reason)
            self.pending = self._advance()

    def has_diverged(self) -> bool:
        """Whether the forecast must restart with `start: diverged`; called with each new frame.

        Only that mode compares every frame, since fitting takes milliseconds. With `every`, the
        first frame of a period is fitted here, ahead of the prediction that needs it.
        """
        forecast, newest, window = self.forecast, self._newest, self._window
        if forecast is None or self.resync.start == 'first' or (self.every and self._compared):
            return False
        before, self._compared = self._error_seen, True
        self._compare()
        if self.every or not window.full or newest <= forecast.start_ns:
            return False
        if forecast.recall(newest) is None:
            # out of memory, or not reached yet because computing has fallen behind
            return newest > self._grid.stamp_ns + self.period_ns
        return self._error_seen is not before and self.beyond_bound

    @property
    def last_error(self) -> TrackingError | None:
        """Error of the present forecast at the newest comparable frame; None: there is none."""
        self._compare()
        return self._error_seen

    def _compare(self) -> None:
        """Compare the forecast with the newest frame, unless it was compared before."""
        forecast, newest, window, known = (
            self.forecast,
            self._newest,
            self._window,
            self.last_start,
        )
        if forecast is None or not window.full or newest <= forecast.start_ns:
            return
        if self._error_seen and newest == self._error_seen.stamp_ns:
            return
        predicted = forecast.recall(newest)
        if predicted is None or known is None or known.ids != window.ids:
            return
        state = window.start(tuple(self._surfaces(newest).values()))[1]
        distances = np.linalg.norm(predicted - state.positions, axis=1)
        self._error_seen = TrackingError(newest, float(distances.mean()), float(distances.max()))

    @property
    def beyond_bound(self) -> bool:
        """Whether the last error exceeds the bound of `resync`."""
        error = self.last_error
        if error is None:
            return False
        value = error.mean if self.resync.over == 'mean' else error.worst
        return not value <= self.resync.bound * self._model.radius

    def compute(self, now: int, *, paused: bool = False) -> Prediction:
        """Compute the next prediction, before it is due.

        Args:
            now: Time of the node's clock [ns].
            paused: Whether it is stepped by hand, so that stamps passed over do not count as
                skipped.

        Raises:
            PredictionError: The rollout diverged, or the newest frames give no start.
        """
        assert self.forecast is not None
        self._compared = False
        self._grid.advance()
        # without a newer frame it advances period by period, however late: a slow machine would
        # fall further behind if it computed several at once
        newer = self._window.full and self._newest > self.forecast.start_ns
        reason = self._restart_reason
        if self.every and newer and not reason and (paused or not self._catches_up(now)):
            reason = 'every'
        if reason:
            self._restart_reason = None
            self.forecast = self._renewed(now, reason, paused=paused)
        self.pending = self._advance()
        return self.pending

    def _catches_up(self, now: int) -> bool:
        """Whether the last forecast goes on, as a new one would leave out a stamp of a stall."""
        late = now - self.due_ns
        left_out = late > self.period_ns or self._newest >= self._grid.stamp_ns
        return left_out and self._pacer.catches_up(late, now)

    def _advance(self) -> Prediction:
        assert self.forecast is not None
        try:
            split_stamp(self._grid.stamp_ns)  # that of its frame may fit where this does not
            return self.forecast.advance_to(self._grid.stamp_ns)
        except (UserError, FloatingPointError) as error:
            raise PredictionError(
                'diverged',
                f'prediction for {seconds(self._grid.stamp_ns)} s failed: {error}; starting again',
            ) from error

    def resume(self, now: int) -> None:
        """Delay the schedule by the length of a pause; the next prediction is due in a period."""
        self._delay_ns += now + self.period_ns - self.due_ns

    def take(self) -> Prediction:
        """Take the pending prediction, to publish it now."""
        assert self.pending is not None
        prediction, self.pending = self.pending, None
        return prediction

    def take_in_time(self, now: int) -> Prediction | None:
        """Take the pending prediction; None where it is so late that it is skipped."""
        assert self.pending is not None
        late, took = now - self.due_ns, sum(self.pending.step_times)
        admitted = self._pacer.admits(late, now)
        if late > self.period_ns:
            self.counts['late' if admitted else 'skipped'] += 1
            self._note_late(late * 1e-9, took)
        if admitted:
            return self.take()
        self.pending = None
        return None

    def _note_late(self, late: float, took: float) -> None:
        period = f'{self._model.period:.4g} s'
        self._warn(
            'late',
            f'a prediction is {late:.3f} s late, more than the period of {period}; so far '
            f'{self.counts["late"]} published late and {self.counts["skipped"]} not published; '
            f'this one took {took:.4g} s to compute',
        )
        self._note_overload()

    def _note_overload(self) -> None:
        if self._pacer.overloaded and not self._overload_reported:
            self._overload_reported = True
            self._error(
                f'this machine cannot keep up with a prediction every {self._model.period:.4g} s: '
                'they come late or never; lower the rate, or track fewer spheres'
            )

    @property
    def _newest(self) -> int:
        """Stamp of the newest frame [ns]; -1 before the first."""
        newest = self._window.stamp_ns
        return -1 if newest is None else newest

    def _renewed(self, now: int, reason: Reason, *, paused: bool = False) -> Forecast:
        """Forecast from the newest frame, with the schedule moved on to a stamp not yet past."""
        newest, self._delay_ns = self._newest, 0
        if self._window.lead_ns + self._offset_ns < -CLOCK_TOLERANCE_NS:
            # even the fastest frame is late: the tracker's clock has stopped, or runs slower
            self._offset_ns = self._clock_offset(newest, now)
            self._grid = Grid(newest, self._model.period)
            self._grid.advance()
            self._pacer.clear()
            return self._new_forecast(reason)
        # a frame that arrives before its stamp shows that the tracker's clock is ahead
        lead = newest + self._offset_ns - self._window.arrival_ns
        if lead > self.period_ns // 2:
            self._offset_ns -= lead
        skipped = 0
        if now - self.due_ns > self.period_ns:
            skipped = self._grid.skip_to(now - self._offset_ns)
        skipped += self._grid.skip_to(newest + 1)
        if skipped and not paused:
            self.counts['skipped'] += skipped
            self._pacer.skip(skipped, now)
            self._note_overload()
        if reason == 'every':
            self._grid.snap(newest)
        return self._new_forecast(reason)

    def _new_forecast(self, reason: Reason) -> Forecast:
        window = self._window
        try:
            surfaces = self._surfaces(self._newest)
            stamp, state = window.start(tuple(surfaces.values()))
            forecast = self._model.forecast(state, stamp, window.ids, surfaces)
        except UserError as error:
            raise PredictionError(
                'start', f'no start from these tracked frames: {error}'
            ) from error
        self.last_start = Start(
            stamp, window.window_ns, reason, window.ids, window.noise, surfaces=surfaces
        )
        if reason != 'every':
            self._error_seen = None
        self._on_start(self.last_start)
        return forecast

    def _clock_offset(self, stamp: int, now: int) -> int:
        for known in (0, self._offset_ns):
            if abs(now - stamp - known) <= CLOCK_TOLERANCE_NS:
                return known
        self._warn(
            'offset',
            f'tracked stamp {seconds(stamp)} s is {(now - stamp) * 1e-9:+.3f} s off the '
            "node's clock, expected at most 1 s: predictions follow the tracker's stamps, in time "
            'with their arrival; does use_sim_time fit?',
        )
        return now - stamp
