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

"""What a network reads, from tensors and with gradients: for training in closed loop.

The same numbers as `features.features_of`, which prediction uses. Which bodies are connected has
no gradient; positions and velocities of those that are do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .config import GNSConfig
from .features import Motion
from .graph import Graph
from .network import GraphInput
from .rotations import rotate_quaternions
from ..scenes.scene import Scene


class TensorMotion(NamedTuple):
    """`Motion` as float64 tensors, of one scene or of several side by side.

    positions: shape (n, 3); quaternions: shape (n, 4); velocities, angular_velocities: newest
    first, shape (H + 1, n, 3).
    """

    positions: Tensor
    quaternions: Tensor
    velocities: Tensor
    angular_velocities: Tensor

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> TensorMotion:
        """Several scenes side by side."""
        return cls(
            torch.from_numpy(np.concatenate([motion.positions for motion in motions])),
            torch.from_numpy(np.concatenate([motion.quaternions for motion in motions])),
            torch.from_numpy(np.concatenate([m.velocities for m in motions], axis=1)),
            torch.from_numpy(np.concatenate([m.angular_velocities for m in motions], axis=1)),
        )

    def advanced(self, predicted: Tensor, dt: float) -> TensorMotion:
        """One step of semi-implicit Euler with the next [v, omega], shape (n, 6)."""
        velocity, angular = predicted[:, :3], predicted[:, 3:]
        return TensorMotion(
            self.positions + dt * velocity,
            rotate_quaternions(self.quaternions, dt * angular),
            torch.cat([velocity[None], self.velocities[:-1]]),
            torch.cat([angular[None], self.angular_velocities[:-1]]),
        )


class TensorGraph(NamedTuple):
    """`Graph` as tensors, of one scene or of several side by side.

    senders, receivers, reverse: shape (edges,); surface_receivers: shape (surface_edges,);
    surface_points, surface_normals: of the surface of each edge, shape (surface_edges, 3).
    """

    senders: Tensor
    receivers: Tensor
    reverse: Tensor
    surface_receivers: Tensor
    surface_points: Tensor
    surface_normals: Tensor

    @classmethod
    def of(
        cls, graphs: Sequence[Graph], scenes: Sequence[Scene], counts: Sequence[int]
    ) -> TensorGraph:
        """Graphs of scenes with `counts` spheres, side by side."""
        first = np.cumsum([0, *counts])
        edges = np.cumsum([0, *(len(graph.senders) for graph in graphs)])
        normals = [
            np.array([plane.normal for plane in scene.surfaces]).reshape(-1, 3)[g.surface_senders]
            for g, scene in zip(graphs, scenes, strict=True)
        ]

        def joined(name: str, offsets: np.ndarray) -> Tensor:
            parts = [getattr(g, name) + o for g, o in zip(graphs, offsets[:-1], strict=True)]
            return torch.from_numpy(np.concatenate(parts))

        return cls(
            senders=joined('senders', first),
            receivers=joined('receivers', first),
            reverse=joined('reverse', edges),
            surface_receivers=joined('surface_receivers', first),
            surface_points=torch.from_numpy(np.concatenate([g.surface_points for g in graphs])),
            surface_normals=torch.from_numpy(np.concatenate(normals)),
        )


def tensor_features(
    config: GNSConfig, motion: TensorMotion, graph: TensorGraph, properties: Tensor
) -> GraphInput:
    """Features of a graph that is given (thesis section 3.2.2).

    Args:
        config: The network's.
        motion: What the network sees of the spheres.
        graph: Who is connected.
        properties: Radius and mass of each sphere, shape (n, 2).
    """
    positions, velocity = motion.positions, motion.velocities[0]
    columns = [*motion.velocities, *motion.angular_velocities]
    if not config.mask_pose:
        columns += [positions, motion.quaternions]
    if config.sphere_properties:
        columns.append(properties)
    displacement = positions[graph.receivers] - positions[graph.senders]
    distance = torch.linalg.vector_norm(displacement, dim=1, keepdim=True)
    normal, spheres = graph.surface_normals, graph.surface_receivers
    # the closest point moves along the surface only: a constant here, and the gradient still exact
    height = ((positions[spheres] - graph.surface_points) * normal).sum(1, keepdim=True)
    surface = [velocity[spheres], normal, height * normal, height.abs()]
    return GraphInput(
        nodes=torch.cat(columns, dim=1).float(),  # after differences, which are taken in float64
        edges=torch.cat([displacement, distance], dim=1).float(),
        surface_edges=torch.cat(surface, dim=1).float(),
        senders=graph.senders,
        receivers=graph.receivers,
        reverse=graph.reverse,
        surface_receivers=spheres,
        motion=torch.cat([velocity, motion.angular_velocities[0]], dim=1).float(),
    )
