# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator at work: tracked poses in, predictions out, each when it is due."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TYPE_CHECKING

from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.learned_scene import LearnedScene
from rigid_gns_core.forecasts.moving_surfaces import MovingSurfaces
from rigid_gns_core.forecasts.predictor import PredictionError, Predictor, Resync
from rigid_gns_core.forecasts.starts import Reason, Start
from rigid_gns_core.forecasts.tracker_kinds import balls_of
from rigid_gns_core.forecasts.window_setup import longest_gap, window_of
from rigid_gns_core.messages.diagnostics import encode_diagnostics
from rigid_gns_core.messages.poses import encode_string
from rigid_gns_core.tracking.usable_frames import seconds

from .alarm import Alarm
from .clock_jumps import ClockWatch, simulated
from .diagnostics import Diagnostics
from .executor import Quick
from .futures import Futures
from .inputs import Convert, inputs_of
from .intake import Intake
from .learning import Learning
from .markers import MarkerPublisher
from .moving_surfaces import Bodies
from .odd_parameters import odd_parameters
from .predictions import Predictions
from .residual_range import ResidualRange
from .silence import Silence, too_slow
from .throttle import Warner
from .topics import NodeTopics

if TYPE_CHECKING:
    from rclpy.node import Node

# the alarm rings so long after a queue of frames is taken, at least: to process it takes half [s]
_BEFORE = 4e-3


class Simulation:
    """Predicts on behalf of a node, from its executor alone.

    Args:
        node: Gives clock, log and topics.
        model: Makes the forecasts.
        parameters: Parameters of the node by name.
        surfaces: Surfaces that bodies carry.

    Raises:
        OSError: The bag cannot be created.
        UserError: A parameter cannot be used.
    """

    def __init__(
        self,
        node: Node,
        model: Forecaster,
        parameters: Mapping[str, Any],
        surfaces: MovingSurfaces,
    ) -> None:
        self._node, self._model = node, model
        self.warn = Warner(node.get_logger())
        gap = longest_gap(model)
        self.window = window_of(model, parameters, check=self._check_count, on_gap=self._warn_gap)
        self.predictor = Predictor(
            model,
            self.window,
            resync=Resync(
                str(parameters['start']),
                float(parameters['resync_error']),
                str(parameters['resync_over']),
            ),
            on_start=self._on_start,
            warn=self.warn,
            error=node.get_logger().error,
            surfaces=surfaces.at,
        )
        self.surfaces = surfaces
        frame_id = str(parameters['frame_id'])
        self._bodies = Bodies(surfaces, frame_id, self._now, self.warn)
        self.learning = Learning(
            model, self.window, self._take_scene, node.get_logger(), on=bool(parameters['learn'])
        )
        name = node.get_fully_qualified_name().lstrip('/')
        self.diagnostics = Diagnostics(name, model, self.predictor, self.window)
        self.residual = ResidualRange(model, self.predictor)
        self.silence = Silence(node.get_logger(), float(parameters['tracker_timeout']))
        self._reason: Reason = 'first'  # of the next start from an empty window
        self._generation = self.window.generation  # of the tracks of the present forecast
        self._alarm, self._clock = Alarm(node, self._on_due), ClockWatch(node)
        balls = balls_of(str(parameters['balls']), str(parameters['tracker']))
        self._intake = Intake(
            node,
            model.scene,
            self.window,
            parameters,
            diagnostics=self.diagnostics,
            warn=self.warn,
            before=self.learning.before,
            accepted=self._on_accepted,
        )
        if parameters['tracker'] == 'tf':
            self._intake.transforms.follow(balls, self.on_tracked)
        self._bodies.follow(self._intake.transforms)
        self.topics = NodeTopics(
            node,
            self.on_tracked,
            self._intake.lost,
            str(parameters['record']),
            max_size=float(parameters['record_max_size']),
            max_duration=float(parameters['record_max_duration']),
            inputs=inputs_of(str(parameters['tracker']), balls),
            listeners=self._bodies.listeners,
        )
        self._intake.record = self.topics.received
        self._markers = MarkerPublisher(self.topics.markers, model, self.window, gap)
        self.predictions = Predictions(
            node,
            self.predictor,
            self._alarm,
            self.topics,
            self._markers,
            diagnostics=self.diagnostics,
            residual=self.residual,
            frame_id=frame_id,
            failed=self._give_up,
        )
        self.futures = Futures(
            node,
            model,
            self.window,
            topics=self.topics,
            markers=self._markers,
            diagnostics=self.diagnostics,
            warn=self.warn,
            surfaces=surfaces.at,
            left=lambda: self._alarm.left,
            parameters=parameters,
        )
        for text in odd_parameters(parameters):
            node.get_logger().warning(text)

    @property
    def paused(self) -> bool:
        """Whether predictions are paused."""
        return self.predictions.paused

    @property
    def quick(self) -> Quick:
        """See `executor`."""
        return {**self._alarm.quick, **self.topics.quick, **self.futures.quick}

    def close(self) -> str:
        """Stop and finish the bag; a line of counts, for the log."""
        self._alarm.cancel()
        self.topics.drain()
        self.futures.cancel()
        self.learning.close()
        bag = self.topics.close()
        self.futures.close()  # last: draws take many seconds, in which a supervisor may kill
        counts = {**self.predictor.counts, 'rejected': self.diagnostics.rejected}
        text = ', '.join(f'{count} {name}' for name, count in counts.items())
        return text + (f'; {bag}' if bag else '')

    # --- tracked frames ---

    def on_tracked(
        self, cdr: bytes, convert: Convert = lambda cdr: cdr, arrival: int | None = None
    ) -> None:
        """Process a message of a tracker, which `convert` makes a PoseArray.

        `arrival`: when it came, by the node's clock [ns]; None: now.
        """
        if self._intake.active:
            now = self._now()
            self._check_clock(now)
            self._intake.take(cdr, convert, now if arrival is None else arrival)

    @property
    def lull(self) -> float:
        """How long frames may lie in the middleware's queues [s], as nothing follows from them.

        They are taken before the alarm rings. With `every`, the last one before a computation is
        taken when it comes, to be fitted ahead.
        """
        predictor, futures, interval = self.predictor, self.futures, self.window.interval
        if (
            predictor.forecast is None
            or predictor.resync.start == 'diverged'
            or (self.paused or self.learning.on or self._markers.watched)
            or (futures.seconds and futures.heard)
            or self._bodies.listeners
            or simulated(self._node)
        ):
            return 0.0
        lull = min(self.topics.patience * interval, self._alarm.left - _BEFORE)
        return min(lull, self.predictions.left - interval) if predictor.every else lull

    @property
    def _another_comes(self) -> bool:
        """Whether, with `every`, a newer frame is expected before the next computation."""
        return self.predictor.every and 0 < self.window.interval < self.predictions.left

    def _on_accepted(self, now: int, restarted: bool) -> None:
        """Go on with the newest frame of the window."""
        if not self._node.context.ok():
            return  # those that a signal found waiting are only recorded
        self.silence.broken()
        if restarted:
            self._stop('restart')
        self.learning.after()
        if self.window.full:
            self._follow(now)
        elif self.window.count is None and self.predictor.forecast is not None:
            self._stop('spheres')

    def _take_scene(self, learned: LearnedScene) -> None:
        """Go on in a learned scene; what was recorded before the event is of the one before."""
        self._model.take_scene(learned.scene)
        self.window.take_scene(learned.scene)
        self.topics.send(self.topics.learned, encode_string(learned.json))
        self.forget('learned')

    def _tracker_is_gone(self, now: int) -> bool:
        """Say that no tracked frames come; whether the predictions were stopped for it."""
        if self.predictor.forecast is None or self.paused or not now:
            return False
        silence = (now - self.window.arrival_ns) * 1e-9
        gone = self.silence.check(silence, self.window.max_gap_ns * 1e-9)
        if gone:
            self.forget('restart')
        return gone

    def _follow(self, now: int) -> None:
        """Start, restart or continue the forecast with the newest frame."""
        window, predictor = self.window, self.predictor
        ready = self._bodies.ready(window.stamp_ns or 0)
        if self._markers.watched:
            carried = self.surfaces.at(window.stamp_ns or 0) if ready else {}
            stamp_ns, state = window.start(tuple(carried.values()))
            self._markers.tracked(stamp_ns, state.positions, window.ids)
            if ready:
                self._markers.carried(stamp_ns, carried)
        if not ready:
            return
        if predictor.forecast is None:
            self._start(now)
        elif self.paused:
            return
        elif window.generation != self._generation:
            self._restart(now, 'spheres')
        elif not (self.topics.overtaken or self._another_comes) and predictor.has_diverged():
            self._restart(now, 'diverged')
        if predictor.forecast is not None and not self.paused:
            self.futures.request()

    def _check_count(self, count: int) -> None:
        for text in self._model.check(count):
            self.warn(text, text)

    def _warn_gap(self, gap: float) -> None:
        if self.predictor.forecast is None or self.predictor.every:
            self.warn('gap', too_slow(gap, self.window))

    # --- predictions ---

    def _start(self, now: int) -> None:
        try:
            self.predictor.start(now, self._reason)
        except PredictionError as error:
            self._give_up(error)
            return
        self._node.get_logger().info(
            f'started from stamp {seconds(self.window.stamp_ns or 0)} s: {self.window.count} '
            f'spheres, velocities from {self.window.length} frames'
        )
        self.predictions.compute()

    def _restart(self, now: int, reason: Reason) -> None:
        try:
            self.predictor.restart(now, reason)
        except PredictionError as error:
            self._give_up(error)
            return
        self.predictions.renewed()

    def _on_start(self, start: Start) -> None:
        self._reason, self._generation = 'restart', self.window.generation
        self.diagnostics.started()
        self.topics.send(self.topics.start, encode_string(start.json))

    def _on_due(self) -> None:
        self._check_clock(self._now())
        predictor = self.predictor
        if predictor.forecast is None:
            return
        if predictor.pending is None:  # with `every`, half a period before the next is due
            with self.futures.held():
                self.topics.drain()
                if predictor.forecast is not None and predictor.pending is None:
                    predictor.has_diverged()  # so that the error is known, if no frame told it
                    self.predictions.compute()
        elif not self._tracker_is_gone(now := self._now()):
            self.predictions.publish_due(now)

    def _give_up(self, error: PredictionError) -> None:
        self.forget('restart')
        self.warn(error.kind, str(error))

    # --- control ---

    def activate(self) -> None:
        """Take frames, and predict from them."""
        self.topics.hear(True)
        self._intake.active = True

    def deactivate(self) -> None:
        """Drop frames and predictions, and say nothing until `activate`; the bag stays open."""
        self._intake.active = False
        self.topics.hear(False)
        self.forget('restart')

    def pause(self, wanted: bool) -> bool:
        """Pause or resume predictions; whether that changed anything."""
        if wanted == self.paused:
            return False
        self.predictions.paused = wanted
        predictor = self.predictor
        if wanted:
            self._alarm.cancel()
            self.futures.cancel()
        elif predictor.resync.start != 'first':
            self.forget('restart')  # the spheres have moved on meanwhile
        elif predictor.forecast is not None:
            self.predictions.resume()
        return True

    def forget(self, reason: Reason) -> None:
        """Drop all frames and predictions; `reason` is that of the next start."""
        self.window.clear()
        self._intake.clear()
        self._stop(reason)

    def on_clock_jump(self, ahead_ns: int) -> None:
        """Start again after a jump of the clock [ns]."""
        self._intake.transforms.clear()
        if self.window.stamp_ns is None:
            return
        self.forget('restart')
        ahead = ahead_ns * 1e-9
        way = 'backwards' if ahead < 0 else f'forward by {ahead:.3f} s at once'
        self._node.get_logger().info(f'the clock went {way}: waiting for new tracked frames')

    def _check_clock(self, now: int) -> None:
        if ahead_ns := self._clock.jump_ns(now):
            self.on_clock_jump(ahead_ns)

    def _stop(self, reason: Reason) -> None:
        self._alarm.cancel()
        self.futures.cancel()
        self.predictor.stop()
        if self.predictor.last_start is not None:  # else the next start is the first
            self._reason = reason

    def report(self) -> None:
        """Publish diagnostics."""
        if not self._intake.active:
            return
        self._intake.transforms.resolve()
        self._tracker_is_gone(self._now())
        bag, size = self.topics.bag, self.topics.recorded_bytes
        statuses = self.diagnostics.report(
            paused=self.paused,
            horizon=self.futures.seconds,
            heard=self.futures.heard,
            bag=bag,
            size=size,
            others=[
                *self._bodies.status(self.window.stamp_ns),
                *self.learning.status(),
                *self.residual.status(),
            ],
        )
        cdr = encode_diagnostics(self._now(), statuses)
        self.topics.send(self.topics.diagnostics, cdr)

    def _now(self) -> int:
        return self._node.get_clock().now().nanoseconds
