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

"""The graphs of a step on a device: the edges of `gns.graph` in tensors of fixed shape.

Every sphere has room for the same number of neighbours and for every surface, and masks say which
of them it is connected with. So nothing in a step has to wait for the device to tell a size.
"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .graph import Reach
from ..scenes.scene import Scene
from ..scenes.state import Array


class DeviceScenes(NamedTuple):
    """What does not move, b scenes side by side, float64; n spheres and s planes are the most.

    present: which spheres are there, shape (b, n); radius, mass: shape (b, n); gravity: shape
    (b, 3); point: of planes, shape (b, s, 3); axes: rows direction, normal x direction, normal,
    shape (b, s, 3, 3); half: half lengths, may be infinite, shape (b, s, 2); endless: planes
    without an end, shape (b, s); real: which planes are there, shape (b, s); ground: those with a
    permanent edge to every sphere, shape (b, s).
    """

    present: Tensor
    radius: Tensor
    mass: Tensor
    gravity: Tensor
    point: Tensor
    axes: Tensor
    half: Tensor
    endless: Tensor
    real: Tensor
    ground: Tensor

    @classmethod
    def of(
        cls, scenes: Sequence[Scene], counts: Sequence[int], device: torch.device
    ) -> DeviceScenes:
        """Scenes with `counts` spheres each."""
        n = max(1, *counts)
        s = max(1, *(len(scene.surfaces) for scene in scenes))
        planes = [scene.surfaces for scene in scenes]
        halves = [[(p.length_x / 2, p.length_y / 2) for p in some] for some in planes]
        flags = [
            [(np.isinf([p.length_x, p.length_y]).any(), True, i == scene.ground)
             for i, p in enumerate(scene.surfaces)]
            for scene in scenes
        ]  # fmt: skip
        endless, real, ground = padded(flags, s, (3,), 0.0).astype(bool).transpose(2, 0, 1)
        arrays = (
            padded([np.ones(count) for count in counts], n, (), 0.0).astype(bool),
            *(
                padded(
                    [scene.per_sphere(name, c) for scene, c in zip(scenes, counts, strict=True)],
                    n, (), 1.0,
                )
                for name in ('radius', 'mass')
            ),
            np.array([scene.gravity for scene in scenes]),
            padded([[p.point for p in some] for some in planes], s, (3,), 0.0),
            padded([[p.axes for p in some] for some in planes], s, (3, 3), 0.0),
            padded(halves, s, (2,), 0.0),
            endless,
            real,
            ground,
        )  # fmt: skip
        return cls(*(torch.from_numpy(np.ascontiguousarray(a)).to(device) for a in arrays))


def padded(values: Sequence[object], size: int, shape: tuple[int, ...], filling: float) -> Array:
    """Arrays of shape (k, *shape), k up to `size`, side by side; shape (b, size, *shape)."""
    result = np.full((len(values), size, *shape), filling)
    for row, value in zip(result, values, strict=True):
        array = np.asarray(value, dtype=np.float64).reshape(-1, *shape)
        row[: len(array)] = array
    return result


class Links(NamedTuple):
    """Edges of a step; k neighbours per sphere at most.

    neighbour: index of the sender in its scene, shape (b, n, k); linked: which of them are edges,
    shape (b, n, k); most: neighbours of the sphere that has the most, which may be more than k,
    shape (); surface_linked: shape (b, n, s); surface_points: closest points [m], shape
    (b, n, s, 3).
    """

    neighbour: Tensor
    linked: Tensor
    most: Tensor
    surface_linked: Tensor
    surface_points: Tensor


def links_of(
    scenes: DeviceScenes, positions: Tensor, velocities: Tensor, dt: float, reach: Reach, room: int
) -> Links:
    """Connect spheres with spheres and with surfaces; positions, velocities: shape (b, n, 3)."""
    travel = torch.linalg.vector_norm(velocities, dim=-1) * dt
    near, distance = near_spheres(scenes, positions, velocities, travel, dt, reach)
    nearest, neighbour = torch.topk(
        torch.where(near, distance, math.inf), room, dim=-1, largest=False
    )
    surface_near, points = near_surfaces(scenes, positions, velocities, travel, dt, reach)
    return Links(neighbour, nearest < math.inf, near.sum(dim=-1).amax(), surface_near, points)


def near_spheres(
    scenes: DeviceScenes,
    positions: Tensor,
    velocities: Tensor,
    travel: Tensor,
    dt: float,
    reach: Reach,
) -> tuple[Tensor, Tensor]:
    """Which spheres are connected, and distances of centres [m]; shapes (b, n, n)."""
    offset = positions[:, None] - positions[:, :, None]
    distance = torch.linalg.vector_norm(offset, dim=-1)
    touching = scenes.radius[:, None] + scenes.radius[:, :, None]
    gap = distance - touching
    if reach.connectivity == 'epsilon':
        near = gap <= reach.epsilon
    elif reach.connectivity == 'vmax':
        near = gap <= travel.amax(dim=-1)[:, None, None] + reach.margin
    elif reach.connectivity == 'vi':
        near = gap <= torch.maximum(travel[:, None], travel[:, :, None]) + reach.margin
    else:
        moved = (velocities[:, None] - velocities[:, :, None]) * dt
        square = moved.square().sum(dim=-1)
        along = -(offset * moved).sum(dim=-1) / square.clamp(min=1e-300)
        nearest = offset + along.clamp(0.0, 1.0)[..., None] * moved
        near = torch.linalg.vector_norm(nearest, dim=-1) - touching <= reach.margin
    other = ~torch.eye(positions.shape[1], dtype=torch.bool, device=positions.device)
    return near & other & scenes.present[:, None] & scenes.present[:, :, None], distance


def near_surfaces(
    scenes: DeviceScenes,
    positions: Tensor,
    velocities: Tensor,
    travel: Tensor,
    dt: float,
    reach: Reach,
) -> tuple[Tensor, Tensor]:
    """Which surfaces are connected, shape (b, n, s), and their closest points, (b, n, s, 3)."""
    here = _local(scenes, positions)
    points = _closest(scenes, here)
    gap = _gap(scenes, positions, points, here)
    if reach.connectivity == 'epsilon':
        near = gap <= reach.epsilon
    elif reach.connectivity == 'vmax':
        near = gap <= travel.amax(dim=-1)[:, None, None] + reach.margin
    elif reach.connectivity == 'vi':
        near = gap <= travel[..., None] + reach.margin
    else:
        ahead = positions + velocities * dt + 0.5 * scenes.gravity[:, None] * dt**2
        there = _local(scenes, ahead)
        ahead_gap = _gap(scenes, ahead, _closest(scenes, there), there)
        near = torch.minimum(gap, ahead_gap) <= reach.margin
        near = near | _crosses(scenes, here, there, reach.margin)
    if reach.ground_edge:
        near = near | scenes.ground[:, None]
    return near & scenes.real[:, None] & scenes.present[..., None], points


def _local(scenes: DeviceScenes, positions: Tensor) -> Tensor:
    """Positions along the axes of each plane, from its centre; shape (b, n, s, 3)."""
    offset = positions[:, :, None] - scenes.point[:, None]
    return (scenes.axes[:, None] * offset[..., None, :]).sum(dim=-1)


def _closest(scenes: DeviceScenes, local: Tensor) -> Tensor:
    half = scenes.half[:, None]
    inside = torch.minimum(torch.maximum(local[..., :2], -half), half)
    on_plane = (inside[..., None] * scenes.axes[:, None, :, :2]).sum(dim=-2)
    return scenes.point[:, None] + on_plane


def _gap(scenes: DeviceScenes, positions: Tensor, points: Tensor, local: Tensor) -> Tensor:
    """Distances of surfaces of spheres; negative behind planes without an end."""
    distance = torch.linalg.vector_norm(positions[:, :, None] - points, dim=-1)
    behind = scenes.endless[:, None] & (local[..., 2] < 0)
    return torch.where(behind, -distance, distance) - scenes.radius[..., None]


def _crosses(scenes: DeviceScenes, here: Tensor, there: Tensor, margin: float) -> Tensor:
    """Whether the straight way crosses a plane within reach of its rectangle."""
    passes = here[..., 2] * there[..., 2] < 0
    share = here[..., 2] / torch.where(passes, here[..., 2] - there[..., 2], 1.0)
    place = here[..., :2] + share[..., None] * (there[..., :2] - here[..., :2])
    within = scenes.half[:, None] + (scenes.radius + margin)[..., None, None]
    return passes & (place.abs() <= within).all(dim=-1)
