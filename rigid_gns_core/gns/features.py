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

"""From arrays of one step to what a network reads (thesis section 3.2.2). No torch in here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .config import GNSConfig
from .graph import build_graph, Graph, Indices
from ..scenes.scene import Scene
from ..scenes.state import Array


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


class Features(NamedTuple):
    """Features and indices of one graph.

    nodes: shape (n, node_size); edges: r^pp, shape (edges, 4); surface_edges: r^ps,
    shape (surface_edges, 10); motion: current [v, omega], shape (n, 6), the base of accelerations.
    """

    nodes: NDArray[np.float32]
    edges: NDArray[np.float32]
    surface_edges: NDArray[np.float32]
    senders: Indices
    receivers: Indices
    reverse: Indices
    surface_receivers: Indices
    motion: NDArray[np.float32]


def features_of(
    config: GNSConfig, motion: Motion, scene: Scene, dt: float, graph: Graph | None = None
) -> Features:
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
    surface = np.concatenate(
        [velocity[receivers], normal, height * normal, np.abs(height)], axis=1
    )
    return Features(
        nodes=_floats(np.concatenate(columns, axis=1)),
        edges=_floats(np.concatenate([displacement, distance], axis=1)),
        surface_edges=_floats(surface),
        senders=graph.senders,
        receivers=graph.receivers,
        reverse=graph.reverse,
        surface_receivers=receivers,
        motion=_floats(np.concatenate([velocity, motion.angular_velocities[0]], axis=1)),
    )


def _floats(array: Array) -> NDArray[np.float32]:
    # differences were taken in float64; only features are rounded
    return np.ascontiguousarray(array, dtype=np.float32)
