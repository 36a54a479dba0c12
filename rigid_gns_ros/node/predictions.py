# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Predictions on their way out: computed ahead, and published when they are due."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from rigid_gns_core.forecasts.forecaster import Prediction
from rigid_gns_core.forecasts.predictor import PredictionError, Predictor
from rigid_gns_core.messages.poses import encode_float64, PoseArrayCodec

from .alarm import Alarm
from .diagnostics import Diagnostics
from .markers import MarkerPublisher
from .residual_range import ResidualRange
from .topics import NodeTopics

if TYPE_CHECKING:
    from rclpy.node import Node


class Predictions:
    """Computes and publishes what a predictor predicts; `alarm` rings for each.

    `paused`: whether the alarm is not set, so that predictions are computed by hand.

    Args:
        node: Gives the clock.
        predictor: Predicts.
        alarm: Rings when a prediction is due; with `every`, also half a period before that, when
            the next one is to be computed.
        topics: Topics of the node.
        markers: Shows the spheres.
        diagnostics: Counts.
        residual: Watches the states that a learned part is given.
        failed: Called where there is no prediction from these frames.
    """

    def __init__(
        self,
        node: Node,
        predictor: Predictor,
        alarm: Alarm,
        topics: NodeTopics,
        markers: MarkerPublisher,
        *,
        diagnostics: Diagnostics,
        residual: ResidualRange,
        frame_id: str,
        failed: Callable[[PredictionError], None],
    ) -> None:
        self._clock, self._predictor, self._alarm = node.get_clock(), predictor, alarm
        self._topics, self._markers, self._diagnostics = topics, markers, diagnostics
        self._residual, self._failed = residual, failed
        self._codec = PoseArrayCodec(frame_id, 0)
        self.paused = False

    def compute(self) -> str:
        """Compute the next prediction, to publish it when due; why it failed, or an empty text."""
        now = self._clock.now().nanoseconds
        try:
            prediction = self._predictor.compute(now, paused=self.paused)
        except PredictionError as error:
            self._failed(error)
            return str(error)
        self._computed(prediction)
        return ''

    def renewed(self) -> None:
        """Take the pending prediction for a new one, of a forecast that has just restarted."""
        if self._predictor.pending is not None:
            self._computed(self._predictor.pending)

    def publish_due(self, now: int) -> None:
        """Publish the pending prediction, or pass over it where it is too late, and go on."""
        predictor = self._predictor
        self._diagnostics.due((now - predictor.due_ns) * 1e-9)
        prediction = predictor.take_in_time(now)
        if prediction is not None:
            self.publish(prediction)
        if predictor.every:
            self._alarm.set(predictor.due_ns + predictor.period_ns // 2, exact=False)
        else:
            self.compute()

    def publish(self, prediction: Prediction) -> None:
        """Publish a prediction now."""
        if self._codec.count != len(prediction.poses):
            self._codec = PoseArrayCodec(self._codec.frame_id, len(prediction.poses))
        cdr = self._codec.encode(prediction.poses, prediction.stamp_ns)
        self._topics.send(self._topics.predicted, cdr)
        # only now: sending fails where ROS was shut down
        self._predictor.counts['published'] += 1
        start = self._predictor.last_start
        if start is not None and start.ids is not None:
            positions = prediction.poses[:, :3]
            self._markers.predicted(prediction.stamp_ns, positions, start.ids)

    def resume(self) -> None:
        """Go on with the forecast of before a pause; the next prediction is due in a period."""
        predictor = self._predictor
        if predictor.pending is None:
            self.compute()
        predictor.resume(self._clock.now().nanoseconds)
        if predictor.pending is not None:
            self._alarm.set(predictor.due_ns)

    @property
    def left(self) -> float:
        """With `every`, the time until the next one is computed [s]."""
        half = 0 if self._predictor.pending is None else self._predictor.period_ns // 2
        return self._alarm.left + half * 1e-9

    def _computed(self, prediction: Prediction) -> None:
        self._report_steps(prediction.step_times)
        if not self.paused:
            self._alarm.set(self._predictor.due_ns)

    def _report_steps(self, step_times: Sequence[float]) -> None:
        self._diagnostics.stepped(step_times)
        self._residual.note()
        if self._topics.bag is None and not self._topics.step_time.get_subscription_count():
            return
        for step_time in step_times:
            self._topics.send(self._topics.step_time, encode_float64(step_time))
