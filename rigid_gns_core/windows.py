"""Training windows: (X[k], Y[k+1]) pairs from trajectories, with noise (thesis section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .models.configs import GNSConfig
from .models.features import Motion
from .models.gns import GraphInput, graph_input, side_by_side
from .models.stepping import backward_velocities, difference
from .scene import Scene
from .state import Array, Trajectory, rotate_quaternions


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
        std: Standard deviation [radii, radians, radii/s, rad/s] on positions, rotations, velocities
            and angular velocities.
        corrects_target: Ask for the velocity that leads from the noisy pose to the true next one,
            so that errors of position are mended, not kept. The thesis leaves the target unchanged.
    """

    std: float = 0.01
    corrects_target: bool = False

    def __post_init__(self) -> None:
        if not self.std >= 0:
            raise ValueError(f'std of the noise is {self.std}, expected at least 0')


@dataclass(frozen=True)
class Source:
    """One training trajectory: poses, and backward differences of them."""

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
            scene, poses.positions, poses.quaternions, velocities, angular_velocities, trajectory.dt
        )

    @property
    def steps(self) -> int:
        """Number of windows."""
        return len(self.positions) - 1

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

    def window(
        self,
        step: int,
        config: GNSConfig,
        noise: Noise,
        rng: np.random.Generator,
        known: int | None = None,
    ) -> tuple[GraphInput, Tensor]:
        """Network input at `step`, with noise, and the motion [v, omega] at `step + 1`."""
        motion = self.motion(step, config.history, known)
        next_velocity = self.velocities[step + 1]
        next_angular = self.angular_velocities[step + 1]
        if noise.std > 0:
            motion = _noisy(motion, noise.std, float(np.max(self.scene.radius)), rng)
            if noise.corrects_target:
                next_velocity, next_angular = difference(
                    motion.positions,
                    motion.quaternions,
                    self.positions[step + 1],
                    self.quaternions[step + 1],
                    self.dt,
                )
        graph = graph_input(config, motion, self.scene, self.dt)
        target = np.concatenate([next_velocity, next_angular], axis=1).astype(np.float32)
        return graph, torch.from_numpy(target)


def draw_batch(
    sources: Sequence[Source],
    size: int,
    config: GNSConfig,
    noise: Noise,
    rng: np.random.Generator,
    *,
    start_fraction: float = 0.0,
    rotate: bool = False,
) -> Batch:
    """Draw `size` windows, uniformly over all steps of all trajectories.

    Args:
        sources: Training trajectories.
        size: Windows in the batch.
        config: The network's.
        noise: Noise on inputs.
        rng: Source of every draw.
        start_fraction: Share of windows whose history is cut short, as at a rollout's start.
        rotate: Turn each window by a random angle about gravity.
    """
    ends = np.cumsum([source.steps for source in sources])
    graphs, targets = [], []
    for draw in rng.integers(ends[-1], size=size):
        index = int(np.searchsorted(ends, draw, side='right'))
        step = int(draw - (ends[index - 1] if index else 0))
        known = int(rng.integers(config.history + 1)) if rng.random() < start_fraction else None
        graph, target = sources[index].window(step, config, noise, rng, known)
        graphs.append(graph)
        targets.append(target)
    owner = torch.repeat_interleave(
        torch.arange(size), torch.tensor([len(target) for target in targets])
    )
    batch = Batch(side_by_side(graphs), torch.cat(targets), owner, size)
    if rotate:
        angles = torch.from_numpy(rng.uniform(0, 2 * np.pi, size).astype(np.float32))
        batch = rotate_batch(batch, angles, config)
    return batch


def rotate_batch(batch: Batch, angles: Tensor, config: GNSConfig) -> Batch:
    """Turn every window about the z axis by its angle [rad], shape (windows,)."""
    if not config.mask_pose:
        raise ValueError('rotate needs mask_pose: absolute poses in the features do not turn along')
    graph = batch.graph
    node = angles[batch.owner]

    def turn(values: Tensor, angle: Tensor, vectors: int) -> Tensor:
        """Turn the first `vectors` triples of each row."""
        block = values[:, : 3 * vectors].reshape(-1, vectors, 3)
        cosine, sine = torch.cos(angle)[:, None], torch.sin(angle)[:, None]
        x, y = block[..., 0], block[..., 1]
        turned = torch.stack([cosine * x - sine * y, sine * x + cosine * y, block[..., 2]], dim=-1)
        return torch.cat([turned.flatten(1), values[:, 3 * vectors :]], dim=1)

    graph = graph._replace(
        nodes=turn(graph.nodes, node, 2 * (config.history + 1)),
        edges=turn(graph.edges, node[graph.receivers], 1),
        surface_edges=turn(graph.surface_edges, node[graph.surface_receivers], 3),
        motion=turn(graph.motion, node, 2),
    )
    return batch._replace(graph=graph, next_motion=turn(batch.next_motion, node, 2))


def _noisy(motion: Motion, std: float, radius: float, rng: np.random.Generator) -> Motion:
    def draw(like: Array, scale: float) -> Array:
        return rng.normal(0.0, scale, like.shape)

    return Motion(
        motion.positions + draw(motion.positions, std * radius),
        rotate_quaternions(motion.quaternions, draw(motion.positions, std)),
        motion.velocities + draw(motion.velocities, std * radius),
        motion.angular_velocities + draw(motion.angular_velocities, std),
    )
