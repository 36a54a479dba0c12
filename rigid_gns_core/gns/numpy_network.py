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

"""The thesis' GNS in NumPy: the same as models/gns.py, without torch."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from threadpoolctl import ThreadpoolController

from .config import GNSConfig
from .features import Features
from .graph import Indices
from ..files.checkpoint import Tensors
from ..scenes.state import Array

Floats = NDArray[np.float32]


class GNSEngine:
    """Predicts next linear and angular velocity of every sphere from a graph of the scene.

    Products of matrices are small: a second thread gains little, and waits for what else is busy.

    Args:
        tensors: Weights, by the names of the torch module.
        config: See there.
        threads: CPU threads.
    """

    def __init__(self, tensors: Tensors, config: GNSConfig, threads: int = 1) -> None:
        self.tensors, self.config, self.threads = tensors, config, threads
        self._threads = ThreadpoolController()

    def __call__(self, features: Features) -> Array:
        """Next [v, omega] [m/s, rad/s], shape (n, 6)."""
        with self._threads.limit(limits=self.threads, user_api='blas'):
            return self._predict(features)

    def _predict(self, graph: Features) -> Array:
        nodes = self._mlp('node_encoder', self._normal('node', graph.nodes))
        edges = self._mlp('edge_encoder', self._normal('edge', graph.edges))
        surface_edges = self._mlp('surface_encoder', self._normal('surface', graph.surface_edges))
        for index in range(self.config.message_passing_steps):
            nodes, edges = self._block(f'blocks.{index}', nodes, edges, surface_edges, graph)
        output = self._mlp('decoder', nodes)
        target = 'target_normaliser'
        value = output * self.tensors[f'{target}.scale'] + self.tensors[f'{target}.mean']
        value = value + graph.motion if self.config.target == 'acceleration' else value
        return value.astype(np.float64)

    def _block(
        self, name: str, nodes: Floats, edges: Floats, surface_edges: Floats, graph: Features
    ) -> tuple[Floats, Floats]:
        """One step of message passing (thesis section 3.2.4)."""
        received = np.zeros_like(nodes)
        if len(edges):
            mlp = f'{name}.particle_message'
            message = self._finish(
                mlp,
                self._part(mlp, 0, nodes)[graph.receivers]
                + self._part(mlp, 1, nodes)[graph.senders]
                + self._part(mlp, 2, edges),
            )
            if self.config.third_law:
                message = np.float32(0.5) * (message - message[graph.reverse])
            received += _sum_at(graph.receivers, message, len(nodes))
            edges = edges + message
        if len(surface_edges):
            mlp = f'{name}.surface_message'
            message = self._finish(
                mlp,
                self._part(mlp, 0, nodes)[graph.surface_receivers]
                + self._part(mlp, 1, surface_edges),
            )
            received += _sum_at(graph.surface_receivers, message, len(nodes))
        return nodes + self._mlp(f'{name}.node_update', nodes, received), edges

    def _part(self, mlp: str, index: int, value: Floats) -> Floats:
        return value @ self.tensors[f'{mlp}.weights.{index}'].T

    def _finish(self, mlp: str, hidden: Floats) -> Floats:
        hidden = np.maximum(hidden + self.tensors[f'{mlp}.bias'], 0)
        return hidden @ self.tensors[f'{mlp}.last.weight'].T + self.tensors[f'{mlp}.last.bias']

    def _mlp(self, mlp: str, *values: Floats) -> Floats:
        hidden = self._part(mlp, 0, values[0])
        for index, value in enumerate(values[1:], start=1):
            hidden = hidden + self._part(mlp, index, value)
        return self._finish(mlp, hidden)

    def _normal(self, name: str, value: Floats) -> Any:
        mean, scale = (self.tensors[f'{name}_normaliser.{part}'] for part in ('mean', 'scale'))
        return (value - mean) / scale


def _sum_at(receivers: Indices, message: Floats, count: int) -> Any:
    """Return sums of messages by receiver, shape (count, width)."""
    edges = len(receivers)
    one = np.ones(edges, dtype=np.float32)
    return csr_array((one, (receivers, np.arange(edges))), shape=(count, edges)) @ message
