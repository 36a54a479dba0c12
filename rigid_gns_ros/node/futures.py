# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Futures: the predicted trajectory from each tracked frame, published when it is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TYPE_CHECKING

from rigid_gns_core.errors import UserError
from rigid_gns_core.forecasts.crossing_planes import planes_of
from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.horizon import Future, Horizon, Job
from rigid_gns_core.forecasts.spread import Spread, SpreadJob, text_of
from rigid_gns_core.messages.poses import encode_string
from rigid_gns_core.rollout.rollout import steps_of
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.tracking.window import TrackingWindow

from .diagnostics import Diagnostics
from .executor import Quick
from .markers import MarkerPublisher
from .topics import NodeTopics

if TYPE_CHECKING:
    from rclpy.node import Node

SIZE = 104  # pose and twist of a sphere at one time in the message [bytes]
MOST = 100_000_000  # largest message, as it is copied several times [bytes]
MOST_DRAWN = 1_000_000_000  # states of all samples, which are in memory at once [bytes]


class Futures:
    """Publisher of the trajectory from the newest frame, computed beside the executor.

    Args:
        node: Its executor publishes.
        model: Makes the forecasts.
        window: Tracked frames.
        topics: Topics of the node.
        markers: Publishes the paths.
        diagnostics: Counts results and failures.
        warn: Called with a kind and a sentence, possibly often.
        surfaces: Gives the surfaces that bodies carry, at a stamp [ns], for a horizon [s].
        left: Gives how long the executor has nothing else to do at a given time [s].
        parameters: Parameters of the node by name.
    """

    def __init__(
        self,
        node: Node,
        model: Forecaster,
        window: TrackingWindow,
        *,
        topics: NodeTopics,
        markers: MarkerPublisher,
        diagnostics: Diagnostics,
        warn: Callable[[str, str], None],
        surfaces: Callable[[int, float], Mapping[int, Plane]],
        left: Callable[[], float],
        parameters: Mapping[str, Any],
    ) -> None:
        self._model, self._window, self._surfaces = model, window, surfaces
        self._topics, self._markers, self._diagnostics = topics, markers, diagnostics
        self._warn, self._left = warn, left
        self._held = self._owed = False
        self._seconds = float(parameters['horizon'])
        self.samples = int(parameters['samples'])
        self.planes: Mapping[str, Plane] = planes_of(str(parameters['crossing_planes']))
        self._ready = node.create_guard_condition(self._on_ready)
        self._horizon = Horizon(self._ready.trigger)

    @property
    def quick(self) -> Quick:
        """See `executor`."""
        return {self._ready: self._on_ready}

    @property
    def seconds(self) -> float:
        """How far ahead trajectories are predicted [s]; 0: none."""
        return self._seconds

    @seconds.setter
    def seconds(self, seconds: float) -> None:
        self._seconds = seconds
        self.cancel()

    @property
    def heard(self) -> bool:
        """Whether anybody hears what follows from a future; if not, none is computed."""
        topics = self._topics
        told = topics.diagnostics if self.planes else topics.trajectory
        return topics.futures_heard or told.get_subscription_count() > 0

    def cancel(self) -> None:
        """Drop all requests."""
        self._owed = False
        self._horizon.cancel()

    def close(self) -> None:
        """End the computing thread."""
        self._horizon.close()

    @contextmanager
    def held(self) -> Iterator[None]:
        """Compute none until the end of the context, then that of the newest frame requested."""
        self._held, self._owed = True, False
        try:
            yield
        finally:
            self._held = False
        if self._owed:
            self.request()

    def request(self) -> None:
        """Request the trajectory from the newest frame."""
        if not (self._seconds and self.heard):
            return
        if self._topics.overtaken:  # the next frame is here, and this one's future would be late
            self._diagnostics.future_superseded()
            return
        if self._held:
            self._owed = True
            return
        if not self._horizon.request(self._begin, left=self._left()):
            self._diagnostics.future_superseded()
        self._on_ready()  # a short one is there, without a wake-up of the executor

    def _begin(self) -> Job | None:
        """Job from the newest frame; None: no start, or the message would be too large."""
        window = self._window
        if not window.full:
            return None  # the tracker paused, and there are too few frames again
        uncertain = self.samples > 0 or self.planes
        try:
            surfaces = self._surfaces(window.stamp_ns or 0, self._seconds)
            carried = tuple(surfaces.values())
            if uncertain:
                stamp_ns, estimate = window.estimate(carried)
                state = estimate.state
            else:
                stamp_ns, state = window.start(carried)
            rollout = self._model.forecast(state, stamp_ns, window.ids, surfaces).rollout
        except UserError as error:
            self._none(f'no future from these tracked frames: {error}')
            return None
        steps = steps_of(self._seconds, rollout.dt)
        size = (steps + 1) * len(state) * SIZE
        if size > MOST:
            self._none(
                f'a future of {steps} steps of {len(state)} spheres would be a message of '
                f'{size / 1e6:.0f} MB, the bound is {MOST / 1e6:.0f} MB; lower horizon'
            )
            return None
        if self.samples and (drawn := (1 + self.samples) * size) > MOST_DRAWN:
            self._none(
                f'{self.samples} samples of {steps} steps of {len(state)} spheres would take '
                f'{drawn / 1e9:.3g} GB, the bound is {MOST_DRAWN / 1e9:g} GB; lower samples or '
                'horizon'
            )
            return None
        spread = None
        if uncertain:
            spread = SpreadJob(
                simulator=self._model.simulator,
                scene=self._model.scene_at(window.ids, surfaces),
                estimate=estimate,
                samples=self.samples,
                planes=self.planes,
                ids=window.ids,
                stamp_ns=stamp_ns,
                frame_id=window.frame_id,
            )
        return Job(rollout, stamp_ns, steps, window.frame_id, window.ids, spread)

    def _on_ready(self) -> None:
        while True:
            try:
                future = self._horizon.take(self._left())
            except Exception as error:  # of the thread: it must not end the node
                self._none(f'no future: {type(error).__name__}: {error}')
                continue
            if future is None:
                return
            self._publish(future)

    def _none(self, why: str) -> None:
        self._diagnostics.future_failed(why)
        self._warn('horizon', why)

    def _publish(self, future: Future) -> None:
        self._diagnostics.future_computed(future.took, future.error)
        if future.error:
            self._warn('horizon', f'a future ends early: {future.error}')
        if future.spread is not None:
            self._publish_spread(future.spread)
        self._topics.send(self._topics.trajectory, future.cdr)
        self._markers.future(future)

    def _publish_spread(self, spread: Spread) -> None:
        """Publish crossings first: who catches a ball waits for them."""
        topics = self._topics
        for pose, twist in spread.crossings:
            topics.crossing.publish(pose)
            topics.crossing_velocity.publish(twist)
        if spread.told is not None:
            topics.send(topics.crossings, encode_string(text_of(spread.told)))
            self._diagnostics.crossings_told(spread.told['planes'])
        if spread.deviations is not None:
            topics.send(topics.deviations, spread.deviations)
        if spread.branches is not None:
            topics.send(topics.branches, encode_string(text_of(spread.branches)))
