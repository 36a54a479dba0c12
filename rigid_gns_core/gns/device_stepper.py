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

"""The thesis' GNS on a device: the state stays there, poses come to the host once per block.

A step is a fixed list of tensor operations of fixed shape, so that the host never waits for the
device within a block. Sums over neighbours are along an axis of their own, not scattered: the same
start gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
import torch
from torch import Tensor

from .config import GNSConfig
from .device_graph import DeviceScenes, Links, links_of, padded
from .network import GNBlock, GNS
from .rotations import rotate_quaternions
from .stepper import backward_velocities
from ..rollout.stepper import Stepper
from ..scenes.scene import Scene
from ..scenes.state import Array, State

# steps between two copies to the host
BLOCK = 64
# neighbours that there is room for at first; more where a block turns out to need more
_ROOM = 16


class DeviceMotion(NamedTuple):
    """What the network sees, in float64.

    positions: shape (b, n, 3); quaternions: shape (b, n, 4); velocities, angular_velocities:
    newest first, shape (H + 1, b, n, 3).
    """

    positions: Tensor
    quaternions: Tensor
    velocities: Tensor
    angular_velocities: Tensor


class DeviceStepper(Stepper):
    """Rolls one scene or several side by side out in the model's units.

    Args:
        network: With its weights; moved to the device.
        scenes: Surfaces and sphere properties.
        states: Starts, as many.
        dt: Length of a step.
        device: Such as 'cuda'.
    """

    def __init__(
        self,
        network: GNS,
        scenes: Sequence[Scene],
        states: Sequence[State],
        dt: float,
        device: torch.device | str,
    ) -> None:
        self.given = (tuple(scenes), tuple(states))
        self.dt, self.device = dt, torch.device(device)
        self.network = network.to(self.device)
        self.reach = network.config.reach(float(np.max(scenes[0].radius)))
        counts = [len(state) for state in states]
        self.scenes = DeviceScenes.of(scenes, counts, self.device)
        size = self.scenes.present.shape[1]
        self.room = max(1, min(_ROOM, size - 1))

        def on_device(values: Sequence[Array], width: int) -> Tensor:
            return torch.from_numpy(padded(values, size, (width,), 0.0)).to(self.device)

        history = network.config.history + 1
        before = [backward_velocities(s, c, dt) for s, c in zip(states, scenes, strict=True)]
        spins = [state.angular_velocities for state in states]
        turns = on_device([state.quaternions for state in states], 4)
        turns[..., 3] += (~self.scenes.present).double()  # of no sphere: no rotation
        self.motion = DeviceMotion(
            on_device([state.positions for state in states], 3),
            turns,
            on_device(before, 3).expand(history, -1, -1, -1),
            on_device(spins, 3).expand(history, -1, -1, -1),
        )

    def step(self) -> State:
        """Advance a single scene by dt; one copy to the host.

        Raises:
            FloatingPointError: The rollout diverged (a value is not finite or beyond 1e9).
        """
        block = self.block(1)[0, 0, : len(self.given[1][0])]
        if diverged(block):
            raise FloatingPointError(DIVERGED)
        return state_of(block)

    @torch.inference_mode()
    def block(self, steps: int) -> Array:
        """Advance by `steps`; poses and velocities on the host, shape (steps, b, n, 13)."""
        while True:
            motion, rows = self.motion, []
            most = torch.zeros((), dtype=torch.int64, device=self.device)
            for _ in range(steps):
                motion, needed = self.next_motion(motion)
                most = torch.maximum(most, needed)
                newest = motion.velocities[0], motion.angular_velocities[0]
                rows.append(torch.cat([motion.positions, motion.quaternions, *newest], dim=-1))
            if int(most) <= self.room:
                self.motion = motion
                return torch.stack(rows).cpu().numpy()
            # the farthest neighbours were left out: all again with room for them
            self.room = min(8 * -(-int(most) // 8), motion.positions.shape[1] - 1)

    def next_motion(self, motion: DeviceMotion) -> tuple[DeviceMotion, Tensor]:
        """One step, semi-implicit Euler; and the most neighbours of a sphere, shape ()."""
        links = links_of(
            self.scenes, motion.positions, motion.velocities[0], self.dt, self.reach, self.room
        )
        predicted = predict(self.network, self.scenes, motion, links).double()
        predicted = torch.where(self.scenes.present[..., None], predicted, 0.0)
        velocity, angular = predicted[..., :3], predicted[..., 3:]
        after = DeviceMotion(
            motion.positions + self.dt * velocity,
            rotate_quaternions(motion.quaternions, self.dt * angular),
            torch.cat([velocity[None], motion.velocities[:-1]]),
            torch.cat([angular[None], motion.angular_velocities[:-1]]),
        )
        return after, links.most


def predict(network: GNS, scenes: DeviceScenes, motion: DeviceMotion, links: Links) -> Tensor:
    """Next [v, omega], shape (b, n, 6); the same as `GNS.forward` and `GNS.decode`."""
    config = network.config
    velocity, angular = motion.velocities[0], motion.angular_velocities[0]
    nodes = network.node_encoder(network.node_normaliser(_node_features(config, scenes, motion)))
    # displacement of the receiver from the sender, differences in float64
    away = motion.positions[:, :, None] - _at(motion.positions, links.neighbour)
    distance = torch.linalg.vector_norm(away, dim=-1, keepdim=True)
    there, back = (
        network.edge_encoder(network.edge_normaliser(torch.cat([d, distance], dim=-1).float()))
        for d in (away, -away)
    )
    surface = network.surface_encoder(
        network.surface_normaliser(_surface_features(scenes, motion.positions, velocity, links))
    )
    for block in network.blocks:
        assert isinstance(block, GNBlock)
        nodes, there, back = _block(block, nodes, there, back, surface, links)
    return network.decode(network.decoder(nodes), torch.cat([velocity, angular], dim=-1).float())


def _block(
    block: GNBlock, nodes: Tensor, there: Tensor, back: Tensor, surface: Tensor, links: Links
) -> tuple[Tensor, Tensor, Tensor]:
    """One step of message passing; `there` and `back`: edges to a sphere and from it."""
    mlp = block.particle_message
    to, of = mlp.part(0, nodes), mlp.part(1, nodes)
    message = mlp.finish(to[:, :, None] + _at(of, links.neighbour) + mlp.part(2, there))
    if block.third_law:
        opposite = mlp.finish(_at(to, links.neighbour) + of[:, :, None] + mlp.part(2, back))
        message = 0.5 * (message - opposite)
        back = back - message
    received = torch.where(links.linked[..., None], message, 0.0).sum(dim=2)
    mlp = block.surface_message
    pushed = mlp.finish(mlp.part(0, nodes)[:, :, None] + mlp.part(1, surface))
    received = received + torch.where(links.surface_linked[..., None], pushed, 0.0).sum(dim=2)
    return nodes + block.node_update(nodes, received), there + message, back


def _node_features(config: GNSConfig, scenes: DeviceScenes, motion: DeviceMotion) -> Tensor:
    columns = [*motion.velocities.unbind(0), *motion.angular_velocities.unbind(0)]
    if not config.mask_pose:
        columns += [motion.positions, motion.quaternions]
    if config.sphere_properties:
        columns += [scenes.radius[..., None], scenes.mass[..., None]]
    return torch.cat(columns, dim=-1).float()


def _surface_features(
    scenes: DeviceScenes, positions: Tensor, velocity: Tensor, links: Links
) -> Tensor:
    """[v, n_s, d n_s, abs(d)], shape (b, n, s, 10)."""
    normal = scenes.axes[:, None, :, 2].expand(-1, positions.shape[1], -1, -1)
    away = positions[:, :, None] - links.surface_points
    height = (away * normal).sum(dim=-1, keepdim=True)
    moving = velocity[:, :, None].expand_as(normal)
    return torch.cat([moving, normal, height * normal, height.abs()], dim=-1).float()


def _at(values: Tensor, index: Tensor) -> Tensor:
    """Rows of the neighbours, shape (b, n, k, w), of values (b, n, w)."""
    b, n, k = index.shape
    flat = index.reshape(b, n * k, 1).expand(-1, -1, values.shape[-1])
    return values.gather(1, flat).reshape(b, n, k, values.shape[-1])


DIVERGED = 'the rollout diverged: a predicted velocity is not finite'


def diverged(rows: Array) -> NDArray[np.bool_]:
    """Whether velocities are beyond bounds; of [p, q, v, omega], shape (..., n, 13)."""
    if not rows.shape[-2]:
        return np.zeros(rows.shape[:-2], dtype=bool)
    with np.errstate(invalid='ignore'):
        within: NDArray[np.bool_] = np.abs(rows[..., 7:]).max(axis=(-2, -1)) < 1e9
    return ~within  # also true for NaN


def state_of(rows: Array) -> State:
    """[p, q, v, omega] as a state, or as states one after the other, shape (..., n, 13)."""
    return State.unchecked(rows[..., :3], rows[..., 3:7], rows[..., 7:10], rows[..., 10:])


def side_by_side(steppers: Sequence[DeviceStepper]) -> DeviceStepper:
    """Return the scenes of several steppers, each at its start, as those of one."""
    first = steppers[0]
    if len(steppers) == 1:
        return first
    scenes = [scene for stepper in steppers for scene in stepper.given[0]]
    states = [state for stepper in steppers for state in stepper.given[1]]
    return DeviceStepper(first.network, scenes, states, first.dt, first.device)


def blocks(stepper: DeviceStepper, steps: int) -> Iterator[Array]:
    """All steps, in blocks of shape (up to BLOCK, b, n, 13); no more where all have diverged."""
    for begin in range(0, steps, BLOCK):
        rows = stepper.block(min(BLOCK, steps - begin))
        yield rows
        if diverged(rows[-1]).all():
            return
