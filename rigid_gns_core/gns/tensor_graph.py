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

"""Graphs of scenes side by side, found on a device: those of `graph.build_graph` as tensors.

All pairs of a scene are looked at, n x n numbers each: right for the hundreds of spheres of
training scenes on a device made for it.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .device_graph import DeviceScenes, near_spheres, near_surfaces
from .graph import Reach
from .tensor_features import TensorGraph


class Spheres(NamedTuple):
    """Where the spheres of all scenes, one after the other, stand in tensors of fixed shape.

    owner: scene of each, shape (n,); place: its number there, shape (n,); first: first sphere of
    each scene, shape (scenes,).
    """

    owner: Tensor
    place: Tensor
    first: Tensor

    def padded(self, values: Tensor, scenes: DeviceScenes) -> Tensor:
        """Values of all spheres, shape (n, 3), by scene, shape (b, most, 3)."""
        result = values.new_zeros(*scenes.present.shape, 3)
        result[self.owner, self.place] = values
        return result


def connect(
    scenes: DeviceScenes,
    spheres: Spheres,
    positions: Tensor,
    velocities: Tensor,
    dt: float,
    reach: Reach,
) -> TensorGraph:
    """Graph of the step that starts now; positions, velocities: shape (n, 3)."""
    p, v = spheres.padded(positions, scenes), spheres.padded(velocities, scenes)
    travel = torch.linalg.vector_norm(v, dim=-1) * dt
    near, _ = near_spheres(scenes, p, v, travel, dt, reach)
    owner, one, other = torch.triu(near, 1).nonzero(as_tuple=True)
    low, high = spheres.first[owner] + one, spheres.first[owner] + other
    surface_near, points = near_surfaces(scenes, p, v, travel, dt, reach)
    at = surface_near.nonzero(as_tuple=True)
    pairs = torch.arange(len(low), device=low.device)
    return TensorGraph(
        senders=torch.cat([low, high]),
        receivers=torch.cat([high, low]),
        reverse=torch.cat([pairs + len(low), pairs]),
        surface_receivers=spheres.first[at[0]] + at[1],
        surface_points=points[at],
        surface_normals=scenes.axes[at[0], at[2], 2],
    )
