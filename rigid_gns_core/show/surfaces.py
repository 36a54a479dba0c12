# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surfaces of a scene as finite rectangles; infinite sides are cut around the spheres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .obstacles import quads_of
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array, Trajectory

# height of infinite walls, low enough to look over them [length of the ground's longer side]
WALL_HEIGHT = 0.18
# largest height of a start that is in view as a whole [widths of the spheres' range]
START_HEIGHT = 3.0


@dataclass(frozen=True)
class Quad:
    """A rectangle, or another flat quadrangle.

    Args:
        corners: Corners, counter-clockwise seen from the front [m], shape (4, 3).
        endless: Whether the surface extends beyond it.
    """

    corners: Array
    endless: bool


def extent(trajectories: list[Trajectory], scene: Scene) -> tuple[Array, Array]:
    """Corners of the bounding box of all spheres at all times [m], each of shape (3,)."""
    radius = scene.per_sphere('radius', trajectories[0].count)[:, None]
    low = np.min([(t.positions - radius).min(axis=(0, 1)) for t in trajectories], axis=0)
    high = np.max([(t.positions + radius).max(axis=(0, 1)) for t in trajectories], axis=0)
    return low, high


def focus(trajectories: list[Trajectory], scene: Scene) -> tuple[Array, Array]:
    """Corners of the box of most spheres at most times, for the camera [m], each of shape (3,)."""
    places = np.concatenate([t.positions.reshape(-1, 3) for t in trajectories])
    radius = float(np.max(scene.radius))
    low, high = np.quantile(places, (0.03, 0.97), axis=0)
    heights = np.quantile(places @ scene.up, (0.03, 0.85))
    across = (high - low) - ((high - low) @ scene.up) * scene.up
    start = max(float((t.positions[0] @ scene.up).max()) for t in trajectories)
    # spheres from further above come into view later
    if start - heights[0] <= START_HEIGHT * (float(np.abs(across).max()) + 2 * radius):
        heights[1] = max(heights[1], start)
    for point, height in zip((low, high), heights, strict=True):
        point += (height - point @ scene.up) * scene.up
    return low - radius, high + radius


def visible_quads(scene: Scene, low: Array, high: Array) -> list[Quad]:
    """Rectangles of all surfaces but those that change place, and quadrangles of obstacles.

    Infinite sides are cut at the box from `low` to `high` [m], shape (3,), and the finite
    surfaces; upwards, `WALL_HEIGHT` above the lowest point.
    """
    scene = scene.of_fixed_surfaces()
    corners = [c for plane in scene.surfaces for c in _sure_corners(plane)]
    corners += [c for obstacle in scene.obstacles for c in quads_of(obstacle).reshape(-1, 3)]
    points = np.array([low, high, *corners])
    heights = points @ scene.up
    across = points - np.outer(heights, scene.up)
    sides = across.max(axis=0) - across.min(axis=0)
    top = heights.min() + WALL_HEIGHT * float(sides.max())
    # a margin of the ground, so that no sphere stands on its edge
    margin = 0.04 * float(sides.max())
    box = np.array([points.min(axis=0), points.max(axis=0)])
    quads = [_quad(plane, box, margin, scene.up, top) for plane in scene.surfaces]
    solids = [four for obstacle in scene.obstacles for four in quads_of(obstacle)]
    return quads + [Quad(corners, endless=False) for corners in solids]


def _sure_corners(plane: Plane) -> list[Array]:
    """Corners of a plane, with infinite sides reduced to their middle [m], shape (3,) each."""
    half = [0.5 * length if np.isfinite(length) else 0.0 for length in _lengths(plane)]
    centre = np.asarray(plane.point)
    return [
        centre + x * half[0] * plane.axes[0] + y * half[1] * plane.axes[1]
        for x in (-1, 1)
        for y in (-1, 1)
    ]


def _quad(plane: Plane, box: Array, margin: float, up: Array, top: float) -> Quad:
    corners = np.stack(np.meshgrid(*box.T, indexing='ij'), axis=-1).reshape(-1, 3)
    local = (corners - plane.point) @ plane.axes.T
    endless = np.isinf(_lengths(plane))
    half = np.where(endless, 0.0, _lengths(plane)) / 2
    spare = margin if endless.all() else 0.0
    low = np.where(endless, local[:, :2].min(axis=0) - spare, -half)
    high = np.where(endless, local[:, :2].max(axis=0) + spare, half)
    for axis in np.flatnonzero(endless):
        rise = float(plane.axes[axis] @ up)
        if abs(rise) > 0.9:  # upwards
            end = (top - float(np.asarray(plane.point) @ up)) / rise
            low[axis], high[axis] = (low[axis], end) if rise > 0 else (end, high[axis])
    rows = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    places = [np.asarray(plane.point) + np.array(row) @ plane.axes[:2] for row in rows]
    return Quad(np.array(places), bool(endless.any()))


def _lengths(plane: Plane) -> Array:
    return np.array([plane.length_x, plane.length_y])
