# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Depth of intersections, of spheres with each other and with bounded planes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from ..scenes.scene import Plane
from ..scenes.state import Array

TOLERANCE = 1e-9
"""Depths up to this, in diameters, do not count."""


@dataclass(frozen=True)
class Penetration:
    """Intersections of one kind over a rollout.

    Args:
        depth: Mean depth of all intersections in all frames, in diameters; 0 where there are none.
        deepest: Depth of the deepest one, in diameters.
        percentage: Share of the spheres with at least one intersection [%].
        count: Number of intersections, each frame counted.
    """

    depth: float
    deepest: float
    percentage: float
    count: int


def sphere_penetration(
    positions: Array, radius: ArrayLike, tolerance: float = TOLERANCE
) -> Penetration:
    """Intersections of spheres with spheres.

    The depth is r_i + r_j - |p_i - p_j|, over the mean diameter of the two, r_i + r_j. So 0.5
    means for equal spheres that each reaches to the other's centre, and 1 that the centres are
    one.

    Args:
        positions: Centres [m], shape (frames, n, 3).
        radius: Radii [m], one or shape (n,).
        tolerance: Depths up to this, in diameters, do not count.
    """
    count = positions.shape[1]
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (count,))
    touched = np.zeros(count, dtype=bool)
    depths = [np.zeros(0)]
    reach = 2.0 * float(radii.max(initial=0.0))
    for frame in positions:
        if count < 2:
            break
        first, second = cKDTree(frame).query_pairs(reach, output_type='ndarray').T
        diameter = radii[first] + radii[second]
        depth = 1.0 - np.linalg.norm(frame[first] - frame[second], axis=1) / diameter
        hit = depth > tolerance
        touched[first[hit]] = True
        touched[second[hit]] = True
        depths.append(depth[hit])
    return _summary(depths, touched)


def surface_penetration(
    positions: Array,
    radius: ArrayLike,
    surfaces: tuple[Plane, ...],
    tolerance: float = TOLERANCE,
    *,
    limit: float = 1.0,
) -> Penetration:
    """Intersections of spheres with bounded planes.

    The depth is r minus the distance to the closest point of the rectangle, over the sphere's own
    diameter. A sphere whose centre went through the rectangle from the front is still inside it:
    its distance is negative, its depth over 0.5. Deeper than `limit` it has left the surface
    behind and counts no more (`passed_through` counts it). A sphere that came behind a surface
    around an edge has not gone through it: its distance stays positive.

    Args:
        positions: Centres [m], shape (frames, n, 3).
        radius: Radii [m], one or shape (n,).
        surfaces: Planes, scored together.
        tolerance: Depths up to this, in diameters, do not count.
        limit: Largest depth that counts, in diameters; infinite for a ground, which has no other
            side. A plane without bounds has no limit either.
    """
    count = positions.shape[1]
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (count,))
    touched = np.zeros(count, dtype=bool)
    depths = [np.zeros(0)]
    for plane in surfaces:
        unbounded = np.isinf(plane.length_x) and np.isinf(plane.length_y)
        deepest = np.inf if unbounded else limit
        distance = np.empty(positions.shape[:2])
        for part in _sphere_blocks(positions):
            distance[:, part], _ = _signed_distance(
                positions[:, part], radii[part], plane, deepest
            )
        depth = 0.5 * (1.0 - distance / radii)
        hit = (depth > tolerance) & (depth <= deepest)
        touched |= hit.any(axis=0)
        depths.append(depth[hit])
    return _summary(depths, touched)


def passed_through(
    positions: Array, radius: ArrayLike, surfaces: tuple[Plane, ...]
) -> NDArray[np.bool_]:
    """Whether each sphere's centre ever went through a rectangle, front to back, shape (n,)."""
    count = positions.shape[1]
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (count,))
    through = np.zeros(count, dtype=bool)
    for plane in surfaces:
        for part in _sphere_blocks(positions):
            _, passes = _signed_distance(positions[:, part], radii[part], plane, np.inf)
            through[part] |= passes
    return through


def _signed_distance(
    positions: Array, radii: Array, plane: Plane, limit: float
) -> tuple[Array, NDArray[np.bool_]]:
    """Distance of each centre to the rectangle [m], negative: it went through; and which did."""
    local = (positions - plane.point) @ plane.axes.T
    height = local[..., 2]
    half = np.array([plane.length_x, plane.length_y]) / 2
    within: NDArray[np.bool_] = np.all(np.abs(local[..., :2]) <= half, axis=-1)
    outside = local[..., :2] - np.clip(local[..., :2], -half, half)
    distance = np.sqrt(np.sum(outside**2, axis=-1) + height**2)

    # a centre behind the plane is inside the surface if its last way there led through the
    # rectangle; at the start, if it lies behind the rectangle and no deeper than the limit
    behind = height < 0
    entered = np.zeros(behind.shape, dtype=bool)
    shallow: NDArray[np.bool_] = radii - height[0] <= 2.0 * radii * limit
    entered[0] = behind[0] & within[0] & shallow
    crossed = ~behind[:-1] & behind[1:]
    frame, sphere = np.nonzero(crossed)
    before, after = local[frame, sphere], local[frame + 1, sphere]
    share = before[:, 2] / (before[:, 2] - after[:, 2])
    crossing = before[:, :2] + share[:, None] * (after[:, :2] - before[:, :2])
    passes = (np.abs(crossing) <= half).all(axis=-1)
    entered[frame[passes] + 1, sphere[passes]] = True
    last = np.zeros(behind.shape, dtype=np.int64)
    last[1:] = np.where(crossed, np.arange(1, len(positions))[:, None], 0)
    np.maximum.accumulate(last, axis=0, out=last)
    inside = behind & within & np.take_along_axis(entered, last, axis=0)
    went_through = np.zeros(positions.shape[1], dtype=bool)
    went_through[sphere[passes]] = True
    return np.where(inside, -distance, distance), went_through


def _sphere_blocks(positions: Array) -> Iterator[slice]:
    # each sphere is scored alone, so blocks of spheres bound the memory and change nothing
    size = max(1, 2_000_000 // max(1, len(positions)))
    return (slice(start, start + size) for start in range(0, positions.shape[1], size))


def _summary(depths: list[Array], touched: NDArray[np.bool_]) -> Penetration:
    depth = np.concatenate(depths)
    return Penetration(
        depth=float(depth.mean()) if len(depth) else 0.0,
        deepest=float(depth.max(initial=0.0)),
        percentage=100.0 * float(touched.mean()) if len(touched) else 0.0,
        count=len(depth),
    )
