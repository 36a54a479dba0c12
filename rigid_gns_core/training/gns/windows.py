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

"""Training windows: (X[k], Y[k+1]) pairs from trajectories, with noise (thesis section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ...gns.config import GNSConfig
from ...gns.features import Motion
from ...gns.network import graph_input, GraphInput, side_by_side
from ...gns.stepper import backward_velocities, difference
from ...scenes.scene import Scene
from ...scenes.state import Array, rotate_quaternions, Trajectory


class Shifts(NamedTuple):
    """Noise of one window: what is added to its `Motion`, with the shapes of that.

    rotations: as rotation vectors [rad], shape (n, 3).
    """

    positions: Array
    rotations: Array
    velocities: Array
    angular_velocities: Array

    def __call__(self, motion: Motion) -> Motion:
        """Return the motion with this noise."""
        return Motion(
            motion.positions + self.positions,
            rotate_quaternions(motion.quaternions, self.rotations),
            motion.velocities + self.velocities,
            motion.angular_velocities + self.angular_velocities,
        )


class Draw(NamedTuple):
    """One window as it was drawn; with the trajectories, all that a batch is made of.

    source: index of the trajectory; step: k; known: previous velocities to be seen, None for all;
    shifts: noise, None for none; angle: by which it is turned about gravity [rad], None for none.
    """

    source: int
    step: int
    known: int | None
    shifts: Shifts | None
    angle: float | None


class Batch(NamedTuple):
    """Graphs side by side, next motions, and which graph a sphere belongs to.

    graph: input of the network; next_motion: [v, omega] at k + 1 [m/s, rad/s], shape (n, 6);
    owner: index of the window, shape (n,); windows: number of windows.
    """

    graph: GraphInput
    next_motion: Tensor
    owner: Tensor
    windows: int


@dataclass(frozen=True)
class Noise:
    """Gaussian noise on the network's inputs.

    Args:
        std: Standard deviation [radii, radians, radii/s, rad/s] on positions, rotations,
            velocities and angular velocities.
        corrects_target: Ask for the velocity that leads from the noisy pose to the true next one,
            so that errors of position are mended, not kept. The thesis leaves the target
            unchanged. In closed loop the pose is the predicted one, and only positions are mended:
            a network cannot see how far a sphere has turned.
    """

    std: float = 0.01
    corrects_target: bool = False

    def __post_init__(self) -> None:
        if not self.std >= 0:
            raise ValueError(f'std of the noise is {self.std}, expected at least 0')

    def draw(self, count: int, history: int, radius: float, rng: np.random.Generator) -> Shifts:
        """Noise for `count` spheres of `radius` [m] and `history` previous velocities."""
        states = (history + 1, count, 3)
        return Shifts(
            rng.normal(0.0, self.std * radius, (count, 3)),
            rng.normal(0.0, self.std, (count, 3)),
            rng.normal(0.0, self.std * radius, states),
            rng.normal(0.0, self.std, states),
        )


@dataclass(frozen=True)
class Source:
    """One training trajectory: poses, and backward differences of them.

    positions [m], velocities [m/s], angular_velocities [rad/s]: shape (steps + 1, n, 3);
    quaternions: (x, y, z, w), shape (steps + 1, n, 4); dt: time step [s].
    """

    scene: Scene
    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array
    dt: float

    @classmethod
    def of(cls, trajectory: Trajectory, scene: Scene) -> Source:
        """Differences of poses only (thesis section 3.3), but for the first frame."""
        poses = Trajectory.from_poses(trajectory.positions, trajectory.quaternions, trajectory.dt)
        velocities = poses.velocities.copy()
        angular_velocities = poses.angular_velocities.copy()
        velocities[0] = backward_velocities(trajectory[0], scene, trajectory.dt)
        angular_velocities[0] = trajectory.angular_velocities[0]
        return cls(
            scene,
            poses.positions,
            poses.quaternions,
            velocities,
            angular_velocities,
            trajectory.dt,
        )

    @property
    def steps(self) -> int:
        """Number of steps, which is the number of windows of one step."""
        return len(self.positions) - 1

    @property
    def count(self) -> int:
        """Number of spheres."""
        return int(self.positions.shape[1])

    @property
    def radius(self) -> float:
        """Largest radius [m]."""
        return float(np.max(self.scene.radius))

    @property
    def properties(self) -> Array:
        """Radius [m] and mass [kg] of each sphere, shape (n, 2)."""
        return np.stack([self.scene.per_sphere(p, self.count) for p in ('radius', 'mass')], 1)

    def motion(self, step: int, history: int, known: int | None = None) -> Motion:
        """Motion at `step` with `history` previous velocities.

        Where the trajectory (or `known`, the number of previous velocities to be seen) ends, the
        oldest one repeats, as in a rollout that starts here.
        """
        oldest = max(step - (history if known is None else min(known, history)), 0)
        index = np.maximum(np.arange(step, step - history - 1, -1), oldest)
        return Motion(
            self.positions[step],
            self.quaternions[step],
            self.velocities[index],
            self.angular_velocities[index],
        )

    def start(
        self, draw: Draw, config: GNSConfig, corrects_target: bool
    ) -> tuple[Motion, Array, Array]:
        """Motion of a window, with its noise, and v and omega of the step to predict, (n, 3)."""
        motion = self.motion(draw.step, config.history, draw.known)
        there = draw.step + 1
        target = self.velocities[there], self.angular_velocities[there]
        if draw.shifts is not None:
            motion = draw.shifts(motion)
            if corrects_target:
                target = difference(
                    motion.positions,
                    motion.quaternions,
                    self.positions[there],
                    self.quaternions[there],
                    self.dt,
                )
        return motion, *target


def draw_windows(
    sources: Sequence[Source],
    size: int,
    config: GNSConfig,
    noise: Noise,
    rng: np.random.Generator,
    *,
    start_fraction: float = 0.0,
    rotate: bool = False,
    steps: int = 1,
    largest: float = np.inf,
) -> list[Draw]:
    """Draw `size` windows, uniformly over all steps of all trajectories.

    Args:
        sources: Training trajectories.
        size: Windows in the batch.
        config: The network's.
        noise: Noise on inputs.
        rng: Source of every draw.
        start_fraction: Share of windows whose history is cut short, as at a rollout's start.
        rotate: Turn each window by a random angle about gravity.
        steps: Steps of a window.
        largest: Trajectories of more spheres are left out.
    """
    lengths = [max(s.steps + 1 - steps, 0) if s.count <= largest else 0 for s in sources]
    ends = np.cumsum(lengths)
    draws = []
    for number in rng.integers(ends[-1], size=size):
        index = int(np.searchsorted(ends, number, side='right'))
        step = int(number - (ends[index - 1] if index else 0))
        known = int(rng.integers(config.history + 1)) if rng.random() < start_fraction else None
        source, shifts = sources[index], None
        if noise.std > 0:
            shifts = noise.draw(source.count, config.history, source.radius, rng)
        draws.append(Draw(index, step, known, shifts, None))
    if rotate:
        if not config.mask_pose:
            raise ValueError(
                'rotate needs mask_pose: absolute poses in the features do not turn along'
            )
        angles = rng.uniform(0, 2 * np.pi, size).astype(np.float32)
        draws = [d._replace(angle=float(a)) for d, a in zip(draws, angles, strict=True)]
    return draws


def one_step_batch(
    sources: Sequence[Source], draws: Sequence[Draw], config: GNSConfig, corrects_target: bool
) -> Batch:
    """Windows of one step, side by side."""
    graphs, targets = [], []
    for draw in draws:
        source = sources[draw.source]
        motion, *target = source.start(draw, config, corrects_target)
        graphs.append(graph_input(config, motion, source.scene, source.dt))
        targets.append(torch.from_numpy(np.concatenate(target, axis=1).astype(np.float32)))
    batch = Batch(side_by_side(graphs), torch.cat(targets), owners(sources, draws), len(draws))
    angles = angles_of(draws)
    return batch if angles is None else rotate_batch(batch, angles, config)


def owners(sources: Sequence[Source], draws: Sequence[Draw]) -> Tensor:
    """Window of each sphere, shape (n,)."""
    counts = torch.tensor([sources[draw.source].count for draw in draws])
    return torch.repeat_interleave(torch.arange(len(draws)), counts)


def angles_of(draws: Sequence[Draw]) -> Tensor | None:
    """Angle of each window [rad], shape (windows,); None where they are not turned."""
    angles = [draw.angle for draw in draws if draw.angle is not None]
    return torch.from_numpy(np.array(angles, dtype=np.float32)) if angles else None


def rotate_batch(batch: Batch, angles: Tensor, config: GNSConfig) -> Batch:
    """Turn every window about the z axis by its angle [rad], shape (windows,)."""
    graph = batch.graph
    node = angles[batch.owner]

    graph = graph._replace(
        nodes=turned(graph.nodes, node, 2 * (config.history + 1)),
        edges=turned(graph.edges, node[graph.receivers], 1),
        surface_edges=turned(graph.surface_edges, node[graph.surface_receivers], 3),
        motion=turned(graph.motion, node, 2),
    )
    return batch._replace(graph=graph, next_motion=turned(batch.next_motion, node, 2))


def turned(values: Tensor, angle: Tensor, vectors: int) -> Tensor:
    """Rows with the first `vectors` triples turned about z by each row's angle [rad], (rows,)."""
    block = values[:, : 3 * vectors].reshape(-1, vectors, 3)
    cosine, sine = torch.cos(angle)[:, None], torch.sin(angle)[:, None]
    x, y = block[..., 0], block[..., 1]
    block = torch.stack([cosine * x - sine * y, sine * x + cosine * y, block[..., 2]], dim=-1)
    return torch.cat([block.flatten(1), values[:, 3 * vectors :]], dim=1)
