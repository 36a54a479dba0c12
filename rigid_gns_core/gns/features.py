# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inputs of the network from the motion of spheres (thesis sections 3.2.1 to 3.2.3).

Which bodies are connected is found on the CPU and has no gradient; features are on the device of
the motion, with gradients through the positions and velocities of the bodies that are connected.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .config import GNSConfig
from .graph import build_graph, Graph
from .motion import Motion
from ..scenes.scene import Scene


class Edges(NamedTuple):
    """`Graph` as tensors, of one scene or of a batch.

    senders, receivers, reverse: shape (edges,); surface_receivers: shape (surface_edges,);
    surface_points, surface_normals: of the surface of each edge, shape (surface_edges, 3).
    """

    senders: Tensor
    receivers: Tensor
    reverse: Tensor
    surface_receivers: Tensor
    surface_points: Tensor
    surface_normals: Tensor


class Features(NamedTuple):
    """Features, float32, and edges of one graph, or of a batch.

    nodes: shape (n, node_size); edges: r^pp, shape (edges, 4); surface_edges: r^ps,
    shape (surface_edges, 10); motion: current [v, omega], shape (n, 6), the base of accelerations.
    """

    nodes: Tensor
    edges: Tensor
    surface_edges: Tensor
    senders: Tensor
    receivers: Tensor
    reverse: Tensor
    surface_receivers: Tensor
    motion: Tensor


class GraphBatch:
    """A batch of scenes as one graph: the spheres of all are its nodes.

    Args:
        scenes: Surfaces and sphere properties of each.
        counts: Spheres of each.
        config: The network's.
        dt: Time step [s].
        device: Where features are computed.
    """

    def __init__(
        self,
        scenes: Sequence[Scene],
        counts: Sequence[int],
        config: GNSConfig,
        dt: float,
        device: torch.device,
    ) -> None:
        self.scenes, self.counts, self.config = tuple(scenes), tuple(counts), config
        self.dt, self.device = dt, device
        owner = np.repeat(np.arange(len(self.counts)), self.counts)
        self.owner = torch.from_numpy(owner).to(device)
        """Scene of each sphere, shape (n,)."""
        properties = [
            np.stack([scene.per_sphere(name, count) for name in ('radius', 'mass')], axis=1)
            for scene, count in zip(scenes, counts, strict=True)
        ]
        self.properties = torch.from_numpy(np.concatenate(properties)).to(device)
        """Radius [m] and mass [kg] of each sphere, shape (n, 2)."""

    def features(self, motion: Motion) -> Features:
        """Features for the step that starts now; spheres are connected scene by scene."""
        return features_of(self.config, motion, self.connect(motion), self.properties)

    def connect(self, motion: Motion) -> Edges:
        """Edges of the step that starts now."""
        positions = motion.positions.detach().cpu().numpy()
        velocities = motion.velocities[0].detach().cpu().numpy()
        spheres = [slice(*ends) for ends in pairwise(np.cumsum([0, *self.counts]))]
        graphs = [
            build_graph(
                positions[part],
                velocities[part],
                scene,
                self.dt,
                self.config.reach(float(np.max(scene.radius))),
            )
            for scene, part in zip(self.scenes, spheres, strict=True)
        ]
        return self._joined(graphs)

    def _joined(self, graphs: Sequence[Graph]) -> Edges:
        spheres = np.cumsum([0, *self.counts])
        edges = np.cumsum([0, *(len(graph.senders) for graph in graphs)])

        def shifted(name: str, offsets: np.ndarray) -> np.ndarray:
            parts = [getattr(g, name) + o for g, o in zip(graphs, offsets[:-1], strict=True)]
            return np.concatenate(parts)

        arrays = (
            shifted('senders', spheres),
            shifted('receivers', spheres),
            shifted('reverse', edges),
            shifted('surface_receivers', spheres),
            np.concatenate([graph.surface_points for graph in graphs]),
            np.concatenate([graph.surface_normals for graph in graphs]),
        )
        return Edges(*(torch.from_numpy(array).to(self.device) for array in arrays))


def features_of(config: GNSConfig, motion: Motion, edges: Edges, properties: Tensor) -> Features:
    """Features of a graph with these edges (thesis section 3.2.2).

    Args:
        config: The network's.
        motion: What the network sees of the spheres.
        edges: Connections of the step.
        properties: Radius and mass of each sphere, shape (n, 2).
    """
    positions, velocity = motion.positions, motion.velocities[0]
    columns = [*motion.velocities, *motion.angular_velocities]
    if not config.mask_pose:
        columns += [positions, motion.quaternions]
    if config.sphere_properties:
        columns.append(properties)
    # displacement of the receiver from the sender: r_ij = p_i - p_j at node i
    displacement = positions[edges.receivers] - positions[edges.senders]
    distance = torch.linalg.vector_norm(displacement, dim=1, keepdim=True)
    normal, spheres = edges.surface_normals, edges.surface_receivers
    # the closest point moves along the surface only: a constant here, and the gradient still exact
    height = ((positions[spheres] - edges.surface_points) * normal).sum(1, keepdim=True)
    surface = [velocity[spheres], normal, height * normal, height.abs()]
    return Features(
        nodes=torch.cat(columns, dim=1).float(),  # after differences, which are taken in float64
        edges=torch.cat([displacement, distance], dim=1).float(),
        surface_edges=torch.cat(surface, dim=1).float(),
        senders=edges.senders,
        receivers=edges.receivers,
        reverse=edges.reverse,
        surface_receivers=spheres,
        motion=torch.cat([velocity, motion.angular_velocities[0]], dim=1).float(),
    )
