# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Which spheres and planes might touch in a frame, whatever happens to them in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...scenes.plane import Plane
from ...scenes.state import Array

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Candidates:
    """Pairs of spheres (i < j), and spheres with planes; sorted.

    Args:
        first, second: Spheres of the pairs, shape (pairs,).
        sphere, plane: Sphere and plane of the rest, shape (others,).
        side: Side of the plane that the sphere is on, -1 behind a plate (a plane with an end on
            all sides), else 1, shape (others,).
    """

    first: Indices
    second: Indices
    sphere: Indices
    plane: Indices
    side: Array

    def __len__(self) -> int:
        return len(self.first) + len(self.sphere)

    def around(self, spheres: NDArray[np.bool_]) -> Candidates:
        """Those of the flagged spheres; flags of shape (n,) or longer."""
        pairs, others = spheres[self.first] | spheres[self.second], spheres[self.sphere]
        return Candidates(
            self.first[pairs],
            self.second[pairs],
            self.sphere[others],
            self.plane[others],
            self.side[others],
        )

    def shifted(self, spheres: int, planes: int) -> Candidates:
        """Return the same with numbers raised, for scenes side by side."""
        return Candidates(
            self.first + spheres,
            self.second + spheres,
            self.sphere + spheres,
            self.plane + planes,
            self.side,
        )


def join(parts: list[Candidates]) -> Candidates:
    """Candidates of several scenes as one."""
    names = ('first', 'second', 'sphere', 'plane', 'side')
    return Candidates(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def find_candidates(
    positions: Array,
    velocities: Array,
    radius: Array,
    surfaces: tuple[Plane, ...],
    gravity: Array,
    dt: float,
    awake: NDArray[np.bool_] | None = None,
    before: Array | None = None,
) -> Candidates:
    """All contacts that this frame may bring.

    A sphere can be deflected to any direction, so its reach is the way it could go at its speed,
    not the way it is going: V dt + g dt^2. One that is struck may get faster; what it then reaches
    within the same frame is found in the next one.

    Args:
        positions: Centres, shape (n, 3).
        velocities: Shape (n, 3).
        radius: Shape (n,).
        surfaces: Planes.
        gravity: Shape (3,).
        dt: Length of the frame.
        awake: Spheres that take part; a pair needs one. None: all.
        before: Centres when the frame began, shape (n, 3); None: it begins now. A sphere that a
            substep took through a plate is still on the side it was.
    """
    count = len(positions)
    awake = np.ones(count, dtype=bool) if awake is None else awake
    fall = float(np.linalg.norm(gravity)) * dt**2
    reach = np.linalg.norm(velocities, axis=1) * dt + np.where(awake, fall, 0.0) + 0.01 * radius
    first, second = _pairs(positions, radius, reach, awake)
    sphere, plane, side = [], [], []
    for index, surface in enumerate(surfaces):
        local = (positions - surface.point) @ surface.axes.T
        half = np.array([surface.length_x, surface.length_y]) / 2
        outside = np.maximum(np.abs(local[:, :2]) - half, 0.0)
        height = local[:, 2]
        front = np.ones(count)
        if np.isfinite(half).all():
            was = local if before is None else (before - surface.point) @ surface.axes.T
            front = np.where(was[:, 2] < 0, -1.0, 1.0)
            height = np.abs(height)
        near = (height <= radius + reach) & (outside <= (radius + reach)[:, None]).all(axis=1)
        found = np.flatnonzero(near & awake)
        sphere.append(found)
        plane.append(np.full(len(found), index))
        side.append(front[found])
    empty = np.zeros(0, dtype=np.int64)
    spheres = np.concatenate([empty, *sphere]).astype(np.int64)
    planes = np.concatenate([empty, *plane]).astype(np.int64)
    order = np.lexsort((planes, spheres))
    sides = np.concatenate([np.zeros(0), *side])
    return Candidates(first, second, spheres[order], planes[order], sides[order])


def _pairs(
    positions: Array, radius: Array, reach: Array, awake: NDArray[np.bool_]
) -> tuple[Indices, Indices]:
    count = len(positions)
    empty = np.zeros(0, dtype=np.int64)
    if count < 2 or not awake.any():
        return empty, empty
    # the sphere that reaches farther looks for the other: one fast sphere has a wide look around,
    # all others keep theirs
    extent = radius + reach
    tree = cKDTree(positions)
    if extent.max() < 2.0 * np.median(extent) + 1e-12:
        pairs = tree.query_pairs(2.0 * extent.max(), output_type='ndarray').astype(np.int64)
        low, high = pairs[:, 0], pairs[:, 1]
    else:
        found = tree.query_ball_point(positions, 2.0 * extent, return_sorted=False)
        lengths = np.fromiter(map(len, found), dtype=np.int64, count=count)
        one = np.repeat(np.arange(count), lengths)
        other = np.concatenate([np.asarray(part, dtype=np.int64) for part in found])
        # ties by number, so that a pair is found once
        mine = (extent[one] > extent[other]) | ((extent[one] == extent[other]) & (one < other))
        low, high = np.minimum(one, other)[mine], np.maximum(one, other)[mine]
    apart = np.linalg.norm(positions[high] - positions[low], axis=1)
    near = (apart <= extent[low] + extent[high]) & (awake[low] | awake[high])
    low, high = low[near], high[near]
    order = np.lexsort((high, low))
    return low[order], high[order]
