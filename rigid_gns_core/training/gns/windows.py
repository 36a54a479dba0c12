# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training windows: (X[k], Y[k+1]) pairs from trajectories, with noise (thesis section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ...errors import UserError
from ...gns.config import GNSConfig
from ...gns.features import GraphBatch
from ...gns.motion import difference, joined, Motion
from ...gns.rotations import rotate_quaternions
from ...gns.stepper import backward_velocities
from ...scenes.scene import Scene
from ...scenes.state import Array, Trajectory


class Shifts(NamedTuple):
    """Noise of one window, in the shapes of the `Motion` that it is added to.

    rotations: as rotation vectors [rad], shape (n, 3).
    """

    positions: Array
    rotations: Array
    velocities: Array
    angular_velocities: Array

    def __call__(self, motion: Motion) -> Motion:
        """Motion with this noise added."""
        positions, rotations, velocities, angular_velocities = map(torch.from_numpy, self)
        return Motion(
            motion.positions + positions,
            rotate_quaternions(motion.quaternions, rotations),
            motion.velocities + velocities,
            motion.angular_velocities + angular_velocities,
        )


class Draw(NamedTuple):
    """Draw of one window; a batch follows from draws and trajectories.

    source: index of the trajectory; step: k; known: number of previous velocities that are seen,
    None for all; shifts: noise, None for none; angle: by which it is turned about gravity [rad],
    None for none.
    """

    source: int
    step: int
    known: int | None
    shifts: Shifts | None
    angle: float | None


@dataclass(frozen=True)
class Noise:
    """Gaussian noise on the network's inputs.

    Args:
        std: Standard deviation [radii, radians, radii/s, rad/s] on positions, rotations,
            velocities and angular velocities.
        corrects_target: The target velocity leads from the noisy pose to the true next one, so
            that errors of position are corrected, not kept. The thesis leaves the target
            unchanged. In closed loop the pose is the predicted one, and only positions are
            corrected: a network cannot see how far a sphere has turned.
    """

    std: float = 0.01
    corrects_target: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.std < math.inf:
            raise UserError(f'std of the noise is {self.std}, expected a finite number from 0 on')

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
        """Source with differences of poses (thesis section 3.3), but for the first frame."""
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

    def motion(self, step: int, history: int, known: int | None = None) -> Motion:
        """Motion at `step` with `history` previous velocities.

        Before the first frame, or beyond `known` previous velocities, the oldest one repeats, as
        in a rollout that starts here.
        """
        oldest = max(step - (history if known is None else min(known, history)), 0)
        index = np.maximum(np.arange(step, step - history - 1, -1), oldest)
        return Motion(
            torch.from_numpy(self.positions[step]),
            torch.from_numpy(self.quaternions[step]),
            torch.from_numpy(self.velocities[index]),
            torch.from_numpy(self.angular_velocities[index]),
        )

    def targets(self, step: int, steps: int) -> Tensor:
        """[v, omega] of the steps after `step` [m/s, rad/s], shape (steps, n, 6)."""
        after = slice(step + 1, step + 1 + steps)
        both = [self.velocities[after], self.angular_velocities[after]]
        return torch.from_numpy(np.concatenate(both, axis=2))


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
            raise UserError(
                'rotate needs mask_pose: absolute poses in the features do not turn along'
            )
        angles = rng.uniform(0, 2 * np.pi, size).astype(np.float32)
        draws = [d._replace(angle=float(a)) for d, a in zip(draws, angles, strict=True)]
    return draws


class Windows(NamedTuple):
    """A batch of windows of K steps; n spheres in all.

    start: with noise; positions: true ones after each step [m], shape (K, n, 3); targets: [v,
    omega] of each step [m/s, rad/s], shape (K, n, 6); graph: of the windows' scenes; angles: by
    which windows are turned about gravity [rad], shape (windows,), or None.
    """

    start: Motion
    positions: Tensor
    targets: Tensor
    graph: GraphBatch
    angles: Tensor | None


def stack_windows(
    sources: Sequence[Source],
    draws: Sequence[Draw],
    config: GNSConfig,
    steps: int,
    corrects_target: bool,
    device: torch.device,
) -> Windows:
    """Batch of the windows of these draws, on a device."""
    starts, positions, targets = [], [], []
    for draw in draws:
        source, there = sources[draw.source], draw.step + 1
        motion = source.motion(draw.step, config.history, draw.known)
        target = source.targets(draw.step, steps)
        following = torch.from_numpy(source.positions[there : there + steps])
        if draw.shifts is not None:
            motion = draw.shifts(motion)
            if corrects_target:
                after = torch.from_numpy(source.quaternions[there])
                to_truth = difference(
                    motion.positions, motion.quaternions, following[0], after, source.dt
                )
                target[0] = torch.cat(to_truth, dim=1)
        starts.append(motion)
        positions.append(following)
        targets.append(target)
    drawn = [sources[draw.source] for draw in draws]
    angles = [draw.angle for draw in draws if draw.angle is not None]
    return Windows(
        start=joined(starts).to(device),
        positions=torch.cat(positions, dim=1).to(device),
        targets=torch.cat(targets, dim=1).to(device),
        graph=GraphBatch(
            [source.scene for source in drawn],
            [source.count for source in drawn],
            config,
            drawn[0].dt,
            device,
        ),
        angles=torch.tensor(angles, dtype=torch.float32, device=device) if angles else None,
    )
