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

"""One step of the thesis' GNS from state to state, with its history (thesis section 3.4)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .config import GNSConfig
from .features import Features, features_of, Motion
from .graph import build_graph, Reach
from ..rollout.stepper import Stepper
from ..scenes.scene import Scene
from ..scenes.state import Array, rotate_quaternions, rotation_between, State


def integrate(
    positions: Array, quaternions: Array, velocities: Array, angular_velocities: Array, dt: float
) -> tuple[Array, Array]:
    """Semi-implicit Euler: p + v dt, and q turned by w dt; inverse of `difference`.

    The rotation is the exponential of w dt in the world frame. The thesis' first order form,
    q + q (0, w) dt / 2 and normalised, turns a sphere that rolls at 20 m/s by 90 degrees in a step
    of 0.1 s, where it should be 115.

    Args:
        positions: Centres [m], shape (n, 3).
        quaternions: Rotations (x, y, z, w), shape (n, 4).
        velocities: [m/s], shape (n, 3).
        angular_velocities: [rad/s], world frame, shape (n, 3).
        dt: Length of the step [s].
    """
    return positions + dt * velocities, rotate_quaternions(quaternions, dt * angular_velocities)


def difference(
    positions: Array, quaternions: Array, next_positions: Array, next_quaternions: Array, dt: float
) -> tuple[Array, Array]:
    """Velocities [m/s] and angular velocities [rad/s] that lead to the next pose (section 3.3).

    Positions have shape (n, 3), quaternions (n, 4), both results (n, 3).
    """
    return (next_positions - positions) / dt, rotation_between(quaternions, next_quaternions) / dt


def backward_velocities(state: State, scene: Scene, dt: float) -> Array:
    """Mean velocity over the step before `state`, for spheres of which only v is known; (n, 3).

    In free flight that is v - g dt / 2. A sphere with a contact is taken to move as it does.
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

    Args:
        predict: The network: next [v, omega] from features, shape (n, 6).
        config: Its configuration.
        scene: Surfaces and sphere properties.
        state: Start.
        dt: Length of a step.
    """

    def __init__(
        self,
        predict: Callable[[Features], Array],
        config: GNSConfig,
        scene: Scene,
        state: State,
        dt: float,
    ) -> None:
        self.predict, self.config, self.scene, self.dt = predict, config, scene, dt
        states = config.history + 1
        velocity = backward_velocities(state, scene, dt)
        self.motion = Motion(
            state.positions,
            state.quaternions,
            np.repeat(velocity[None], states, axis=0),
            np.repeat(state.angular_velocities[None], states, axis=0),
        )

    def step(self) -> State:
        """Advance by dt; the result's velocities are means over the step: backward differences.

        Raises:
            FloatingPointError: The rollout diverged (a value is not finite or beyond 1e9).
        """
        motion = self.motion
        features = features_of(self.config, motion, self.scene, self.dt)
        predicted = self.predict(features).astype(np.float64)
        if predicted.size and not np.abs(predicted).max() < 1e9:  # also false for NaN
            raise FloatingPointError('the rollout diverged: a predicted velocity is not finite')
        velocity, angular = predicted[:, :3], predicted[:, 3:]
        positions, quaternions = integrate(
            motion.positions, motion.quaternions, velocity, angular, self.dt
        )
        self.motion = Motion(
            positions,
            quaternions,
            np.concatenate([velocity[None], motion.velocities[:-1]]),
            np.concatenate([angular[None], motion.angular_velocities[:-1]]),
        )
        return State(
            positions=positions,
            quaternions=quaternions,
            velocities=velocity,
            angular_velocities=angular,
        )
