# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The thesis' graph network simulator: encode, process, decode (thesis sections 3.2.2 to 3.2.5).

==========================================  ====================================
equation                                    here
==========================================  ====================================
x_i without p_i, q_i (3.2.3)                `Features.nodes`
r_ij^pp = [p_i - p_j, norm] (3.2.2)         `Features.edges`
r_is^ps = [v_i, n_s, d n_s, abs(d)]         `Features.surface_edges`
m_ij = MLP(v_i, v_j, e_ij), m_ji = -m_ij    `GNBlock.forward`, `third_law`
v_i' = v_i + MLP(v_i, Agg_i)                `GNBlock.forward`
e_ij' = e_ij + m_ij; e_is stays             `GNBlock.forward`
y_i = decoder(v_i)                          `GNS.forward`
==========================================  ====================================
"""

from __future__ import annotations

import torch
from torch import nn, Tensor

from .config import GNSConfig
from .features import Features
from .layers import MLP, Normaliser


class GNBlock(nn.Module):
    """One step of message passing (thesis section 3.2.4)."""

    def __init__(self, width: int, third_law: bool) -> None:
        super().__init__()
        self.third_law = third_law
        self.particle_message = MLP((width, width, width), width, width)
        self.surface_message = MLP((width, width), width, width)
        self.node_update = MLP((width, width), width, width)

    def forward(
        self, nodes: Tensor, edges: Tensor, surface_edges: Tensor, graph: Features
    ) -> tuple[Tensor, Tensor]:
        received = torch.zeros_like(nodes)
        if len(edges):
            mlp = self.particle_message
            message = mlp.finish(
                mlp.part(0, nodes)[graph.receivers]
                + mlp.part(1, nodes)[graph.senders]
                + mlp.part(2, edges)
            )
            if self.third_law:
                # half the difference, not the sign of an index order: stays permutation
                # equivariant
                message = 0.5 * (message - message[graph.reverse])
            received = received.index_add(0, graph.receivers, message)
            edges = edges + message
        if len(surface_edges):
            mlp = self.surface_message
            message = mlp.finish(
                mlp.part(0, nodes)[graph.surface_receivers] + mlp.part(1, surface_edges)
            )
            received = received.index_add(0, graph.surface_receivers, message)
        return nodes + self.node_update(nodes, received), edges


class GNS(nn.Module):
    """Predicts next linear and angular velocity of every sphere from a graph of the scene."""

    def __init__(self, config: GNSConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.node_normaliser = Normaliser(config.node_size)
        self.edge_normaliser = Normaliser(4)
        self.surface_normaliser = Normaliser(10)
        self.target_normaliser = Normaliser(6)
        self.node_encoder = MLP((config.node_size,), width, width)
        self.edge_encoder = MLP((4,), width, width)
        self.surface_encoder = MLP((10,), width, width)
        self.blocks = nn.ModuleList(
            GNBlock(width, config.third_law) for _ in range(config.message_passing_steps)
        )
        self.decoder = MLP((width,), width, 6)

    def forward(self, graph: Features) -> Tensor:
        """Normalised target of every sphere, shape (n, 6)."""
        nodes = self.node_encoder(self.node_normaliser(graph.nodes))
        edges = self.edge_encoder(self.edge_normaliser(graph.edges))
        surface_edges = self.surface_encoder(self.surface_normaliser(graph.surface_edges))
        for block in self.blocks:
            nodes, edges = block(nodes, edges, surface_edges, graph)
        output: Tensor = self.decoder(nodes)
        return output

    def decode(self, output: Tensor, motion: Tensor) -> Tensor:
        """Next [v, omega] [m/s, rad/s] from the output, shape (n, 6); undoes `encode_target`."""
        value = self.target_normaliser.inverse(output)
        return motion + value if self.config.target == 'acceleration' else value

    def encode_target(self, next_motion: Tensor, motion: Tensor) -> Tensor:
        """Normalised target from the next [v, omega], shape (n, 6)."""
        if self.config.target == 'acceleration':
            next_motion = next_motion - motion
        target: Tensor = self.target_normaliser(next_motion)
        return target
