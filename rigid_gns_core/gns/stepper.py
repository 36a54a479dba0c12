# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One step of the thesis' GNS from state to state, with its history (thesis section 3.4)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch

from .features import GraphBatch
from .graph import build_graph, Reach
from .motion import Motion
from .network import GNS
from ..rollout.stepper import Stepper
from ..scenes.scene import Scene
from ..scenes.state import Array, State


def backward_velocities(state: State, scene: Scene, dt: float) -> Array:
    """Mean velocities [m/s] over the step before `state`, shape (n, 3).

    With the velocity v of the instant: v - g dt / 2 in free flight. A sphere in contact is taken
    to have moved at v.
    """
    if not len(state):
        return state.velocities
    reach = Reach('epsilon', epsilon=0.02 * float(np.max(scene.radius)), ground_edge=False)
    graph = build_graph(state.positions, np.zeros_like(state.positions), scene, dt, reach)
    flying = np.ones((len(state), 1), dtype=bool)
    flying[graph.receivers] = False
    flying[graph.surface_receivers] = False
    fallen: Array = flying * 0.5 * dt * np.asarray(scene.gravity)
    return state.velocities - fallen


class GNSStepper(Stepper):
    """Rolls a GNS out in the model's units. The history starts with copies of the first motion.

    State, features and network are on the network's device; graphs are built on the CPU.

    Args:
        network: With its weights.
        scene: Surfaces and sphere properties.
        state: Start.
        dt: Length of a step.
        threads: CPU threads of torch in a step.
    """

    def __init__(
        self, network: GNS, scene: Scene, state: State, dt: float, *, threads: int = 1
    ) -> None:
        self.network, self.dt, self.threads = network, dt, threads
        device = network.target_normaliser.mean.device
        self.graph = GraphBatch([scene], [len(state)], network.config, dt, device)
        history = (network.config.history + 1, 1, 1)
        velocity = torch.from_numpy(backward_velocities(state, scene, dt))
        self.motion = Motion(
            torch.from_numpy(state.positions),
            torch.from_numpy(state.quaternions),
            velocity.repeat(history),
            torch.from_numpy(state.angular_velocities).repeat(history),
        ).to(device)

    @torch.inference_mode()
    def step(self) -> State:
        """Advance by dt; the result's velocities are means over the step: backward differences.

        Raises:
            FloatingPointError: The rollout diverged (a value is not finite or beyond 1e9).
        """
        with torch_threads(self.threads):
            features = self.graph.features(self.motion)
            predicted = self.network.decode(self.network(features), features.motion).double()
            if len(predicted) and not predicted.abs().max() < 1e9:  # also false for NaN
                raise FloatingPointError(
                    'the rollout diverged: a predicted velocity is not finite'
                )
            self.motion = motion = self.motion.advanced(predicted, self.dt)
        return State(
            positions=motion.positions.cpu().numpy(),
            quaternions=motion.quaternions.cpu().numpy(),
            velocities=motion.velocities[0].cpu().numpy(),
            angular_velocities=motion.angular_velocities[0].cpu().numpy(),
        )


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Let torch use `count` CPU threads within, and as many as before afterwards."""
    before = torch.get_num_threads()
    if before == count:
        yield
        return
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
