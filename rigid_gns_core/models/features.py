"""From arrays of one step to the network's input (thesis section 3.2.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ..graph import Graph, build_graph
from ..scene import Scene
from ..state import Array
from .gns import GNSConfig, GraphInput


@dataclass(frozen=True)
class Motion:
    """What the thesis' GNS sees of the spheres at t_k.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        velocities: v[k], v[k-1], ..., v[k-H] by backward differences [m/s], shape (H + 1, n, 3).
        angular_velocities: Likewise [rad/s], shape (H + 1, n, 3).
    """

    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array


def graph_input(
    config: GNSConfig, motion: Motion, scene: Scene, dt: float, graph: Graph | None = None
) -> GraphInput:
    """Build the graph (unless given) and its features; lengths in the model's units."""
    positions, velocity = motion.positions, motion.velocities[0]
    if graph is None:
        radius = float(np.max(scene.radius))
        graph = build_graph(positions, velocity, scene, dt, config.reach(radius))
    count = len(positions)
    history = np.concatenate([*motion.velocities, *motion.angular_velocities], axis=1)
    columns = [history]
    if not config.mask_pose:
        columns += [positions, motion.quaternions]
    if config.sphere_properties:
        columns += [scene.per_sphere(name, count)[:, None] for name in ('radius', 'mass')]
    # displacement of the receiver from the sender: r_ij = p_i - p_j at node i
    displacement = positions[graph.receivers] - positions[graph.senders]
    distance = np.linalg.norm(displacement, axis=1, keepdims=True)
    normals = np.array([plane.normal for plane in scene.surfaces]).reshape(-1, 3)
    normal = normals[graph.surface_senders]
    receivers = graph.surface_receivers
    height = np.einsum('ij,ij->i', positions[receivers] - graph.surface_points, normal)[:, None]
    surface = np.concatenate([velocity[receivers], normal, height * normal, np.abs(height)], axis=1)
    return GraphInput(
        nodes=_tensor(np.concatenate(columns, axis=1)),
        edges=_tensor(np.concatenate([displacement, distance], axis=1)),
        surface_edges=_tensor(surface),
        senders=torch.from_numpy(graph.senders),
        receivers=torch.from_numpy(graph.receivers),
        reverse=torch.from_numpy(graph.reverse),
        surface_receivers=torch.from_numpy(receivers),
        motion=_tensor(np.concatenate([velocity, motion.angular_velocities[0]], axis=1)),
    )


def side_by_side(inputs: Sequence[GraphInput]) -> GraphInput:
    """Several graphs as one graph without edges between them."""
    nodes = np.cumsum([0] + [len(graph.nodes) for graph in inputs])
    edges = np.cumsum([0] + [len(graph.edges) for graph in inputs])

    def shifted(name: str, offsets: np.ndarray) -> torch.Tensor:
        return torch.cat(
            [getattr(g, name) + int(o) for g, o in zip(inputs, offsets[:-1], strict=True)]
        )

    return GraphInput(
        nodes=torch.cat([graph.nodes for graph in inputs]),
        edges=torch.cat([graph.edges for graph in inputs]),
        surface_edges=torch.cat([graph.surface_edges for graph in inputs]),
        senders=shifted('senders', nodes),
        receivers=shifted('receivers', nodes),
        reverse=shifted('reverse', edges),
        surface_receivers=shifted('surface_receivers', nodes),
        motion=torch.cat([graph.motion for graph in inputs]),
    )


def _tensor(array: Array) -> torch.Tensor:
    # differences were taken in float64; only features are rounded
    return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))
