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
    diameter. A sphere whose centre went through a face is still inside the surface: its distance
    is negative, its depth over 0.5. All centres behind a half-space are. A strip or a plate has
    two faces: a sphere is on its right side at the start, and may go through from either. One
    that came to the other side around an edge has not gone through: its distance stays positive.

    Args:
        positions: Centres [m], shape (frames, n, 3).
        radius: Radii [m], one or shape (n,).
        surfaces: Planes, scored together.
        tolerance: Depths up to this, in diameters, do not count.
        limit: Largest depth in a strip or a plate that counts, in diameters: a deeper sphere has
            left it behind (`passed_through` counts it). A half-space has no other side.
    """
    count = positions.shape[1]
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), (count,))
    touched = np.zeros(count, dtype=bool)
    depths = [np.zeros(0)]
    for plane in surfaces:
        distance = np.empty(positions.shape[:2])
        for part in _sphere_blocks(positions):
            distance[:, part] = _signed_distance(positions[:, part], plane)
        depth = 0.5 * (1.0 - distance / radii)
        hit = (depth > tolerance) & (depth <= (np.inf if plane.is_half_space else limit))
        touched |= hit.any(axis=0)
        depths.append(depth[hit])
    return _summary(depths, touched)


def passed_through(positions: Array, surfaces: tuple[Plane, ...]) -> NDArray[np.bool_]:
    """Whether each sphere's centre ever went through a face, shape (n,)."""
    through = np.zeros(positions.shape[1], dtype=bool)
    for plane in surfaces:
        for part in _sphere_blocks(positions):
            through[part] |= _passages(_local(positions[:, part], plane), plane)[0].any(axis=0)
    return through


def lost_behind(positions: Array, surfaces: tuple[Plane, ...]) -> NDArray[np.bool_]:
    """Whether each sphere's centre went through a face and is beyond it at the end, shape (n,)."""
    lost = np.zeros(positions.shape[1], dtype=bool)
    for plane in surfaces:
        for part in _sphere_blocks(positions):
            through, beyond = _passages(_local(positions[:, part], plane), plane)
            lost[part] |= through.any(axis=0) & beyond[-1]
    return lost


def _local(positions: Array, plane: Plane) -> Array:
    """Positions in the plane's axes, from its middle [m], shape (frames, n, 3)."""
    local: Array = (positions - plane.point) @ plane.axes.T
    return local


def _signed_distance(positions: Array, plane: Plane) -> Array:
    """Distance of each centre to the rectangle [m], negative: it went through; (frames, n)."""
    local = _local(positions, plane)
    outside = local[..., :2] - np.clip(local[..., :2], -plane.half_lengths, plane.half_lengths)
    distance: Array = np.sqrt(np.sum(outside**2, axis=-1) + local[..., 2] ** 2)
    inside = _passages(local, plane)[1] & (outside == 0).all(axis=-1)
    return np.where(inside, -distance, distance)


def _passages(local: Array, plane: Plane) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Passages of centres through a surface.

    Args:
        local: Centres in the plane's axes [m], shape (frames, n, 3).
        plane: The surface.

    Returns:
        Whether each went through a face on its way to each frame but the first, shape
        (frames - 1, n), and whether it is on the wrong side for that, shape (frames, n).
    """
    behind: NDArray[np.bool_] = local[..., 2] < 0
    if plane.is_half_space:
        return behind[1:] & ~behind[:-1], behind
    crosses = behind[1:] != behind[:-1]
    before, after = local[:-1], local[1:]
    share = before[..., 2] / np.where(crosses, before[..., 2] - after[..., 2], 1.0)
    place = before[..., :2] + share[..., None] * (after[..., :2] - before[..., :2])
    through = crosses & (np.abs(place) <= plane.half_lengths).all(axis=-1)
    # a way around an edge leads to the right side, each way through a face to the other one
    passages = np.zeros(behind.shape, dtype=np.int64)
    np.cumsum(through, axis=0, out=passages[1:])
    frames = np.arange(1, len(local))[:, None]
    around = np.zeros(behind.shape, dtype=np.int64)  # frame after the last way around
    np.maximum.accumulate(np.where(crosses & ~through, frames, 0), axis=0, out=around[1:])
    since = passages - np.take_along_axis(passages, around, axis=0)
    return through, since % 2 == 1


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
