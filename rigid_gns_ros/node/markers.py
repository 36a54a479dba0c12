# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers of surfaces, of tracked and predicted spheres, and of predicted paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rigid_gns_core.messages.markers import (
    Color,
    ellipsoid_markers,
    encode_markers,
    Marker,
    path_markers,
    sphere_markers,
    surface_markers,
)
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.show.surfaces import visible_quads

if TYPE_CHECKING:
    from rclpy.publisher import Publisher
    from rigid_gns_core.forecasts.forecaster import Forecaster
    from rigid_gns_core.forecasts.horizon import Future
    from rigid_gns_core.forecasts.spread import Spread
    from rigid_gns_core.scenes.plane import Plane
    from rigid_gns_core.tracking.window import TrackingWindow


TRACKED: Color = (0.25, 0.65, 0.30, 1.0)
PREDICTED: Color = (0.95, 0.55, 0.10, 0.5)
PATH: Color = (0.20, 0.45, 0.85, 0.9)
SPREAD: Color = (0.20, 0.45, 0.85, 0.25)
BRANCH: tuple[float, float, float] = (0.85, 0.30, 0.25)
SIZE, EVERY = 2.0, 0.1  # of an ellipsoid [deviations], time between two [s]
SURFACE: Color = (0.60, 0.60, 0.65, 0.4)
PATH_WIDTH = 0.1  # [radii]
REACH = 20.0  # of an endless surface around the points of all [radii]
LIFETIME = 3.0  # [periods]; at least half a second and the longest gap of the tracker


def encode_surfaces(scene: Scene, frame_id: str) -> bytes:
    """CDR bytes of markers of all surfaces and obstacles, which stay; endless ones are cut."""
    return encode_markers(0, frame_id, 0, _markers_of('surfaces', scene))


def _markers_of(namespace: str, scene: Scene) -> list[Marker]:
    """Markers of what does not change place in a scene."""
    points = np.array([plane.point for plane in scene.surfaces] or np.zeros((1, 3)))
    reach = REACH * float(np.max(scene.radius))
    quads = visible_quads(scene, points.min(axis=0) - reach, points.max(axis=0) + reach)
    return surface_markers(namespace, [quad.corners for quad in quads], SURFACE)


class MarkerPublisher:
    """Publisher of markers of spheres, which repeat other topics and are not recorded.

    Args:
        publisher: Publisher of visualization_msgs/MarkerArray.
        model: Gives the largest radius and the period.
        window: Gives the radius of each sphere.
        gap: Longest time between tracked frames [s].
    """

    def __init__(
        self, publisher: Publisher, model: Forecaster, window: TrackingWindow, gap: float
    ) -> None:
        self._publisher, self._model, self._window = publisher, model, window
        self._lifetime_ns = round(max(LIFETIME * model.period, gap, 0.5) * 1e9)

    def tracked(self, stamp_ns: int, positions: Array, ids: Sequence[int]) -> None:
        """Publish tracked spheres at their centres [m], shape (n, 3)."""
        self._spheres('tracked', stamp_ns, positions, ids, TRACKED)

    def predicted(self, stamp_ns: int, positions: Array, ids: Sequence[int]) -> None:
        """Publish predicted spheres at their centres [m], shape (n, 3)."""
        self._spheres('predicted', stamp_ns, positions, ids, PREDICTED)

    def carried(self, stamp_ns: int, surfaces: Mapping[int, Plane]) -> None:
        """Publish surfaces that bodies carry, by their indices in the scene, where they are."""
        if self.watched and surfaces:
            planes = tuple(plane.at_rest() for plane in surfaces.values())
            scene = Scene(surfaces=planes, radius=self._model.radius)
            self._send(stamp_ns, _markers_of('carried', scene))

    def future(self, future: Future) -> None:
        """Publish the paths of a predicted trajectory."""
        if self.watched and len(future.positions) > 1:
            width = PATH_WIDTH * self._model.radius
            ids = future.job.ids
            markers = path_markers('path', ids, future.positions, width, PATH)
            if future.spread is not None:
                markers += self._spread(future, future.spread, width)
            self._send(future.job.stamp_ns, markers)

    def _spread(self, future: Future, spread: Spread, width: float) -> list[Marker]:
        """Ellipsoids along the paths, and the branches of spheres that have several."""
        markers: list[Marker] = []
        if spread.covariance is not None:
            step = max(round(EVERY / future.job.rollout.dt), 1)
            places, spreads = future.positions[step::step], spread.covariance[step::step]
            known = np.isfinite(spreads).all(axis=(2, 3))
            markers = ellipsoid_markers('spread', places[known], spreads[known], SIZE, SPREAD)
        for index, (path, probability) in enumerate(spread.paths):
            color = (*BRANCH, max(probability, 0.1))
            markers += path_markers('branch', [index], path[:, None], width, color)
        return markers

    @property
    def watched(self) -> bool:
        """Whether anybody subscribes."""
        return self._publisher.get_subscription_count() > 0

    def _spheres(
        self, namespace: str, stamp_ns: int, positions: Array, ids: Sequence[int], color: Color
    ) -> None:
        if self.watched:
            radii = self._window.settings.environment.radii(np.array(ids, dtype=np.int64))
            self._send(stamp_ns, sphere_markers(namespace, positions, radii, color))

    def _send(self, stamp_ns: int, markers: list[Marker]) -> None:
        cdr = encode_markers(stamp_ns, self._window.frame_id, self._lifetime_ns, markers)
        self._publisher.publish(cdr)
