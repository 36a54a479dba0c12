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

"""Training of the contact model: several frames in closed loop, on steps in which bodies touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from .distributed import Mean
from .learner import Learner, Schedule
from ..data.records import Record
from ..files.config import check_least, check_positive
from ..gns.config import ContactConfig
from ..models.contact.candidates import Candidates, find_candidates, join
from ..models.contact.geometry import find_contacts
from ..models.contact.memory import Memory
from ..models.contact.network import ContactNetwork
from ..models.contact.step import frame, Motion
from ..models.contact.world import UNIT_GRAVITY, World
from ..scenes.similarity import ModelUnits
from ..scenes.state import Array

# windows thrown until one holds a sphere with several contacts
_THROWS = 20
# held-out windows of a score
_WINDOWS = 48


@dataclass(frozen=True)
class ContactTrainConfig(Schedule):
    """A training recipe of the contact model; config/train/contact.yaml explains each choice.

    Args:
        model: The network.
        frames: Frames of a window, simulated in closed loop with gradients through all of them.
        noise: Lowest and highest standard deviation of the noise on a window's start [radii for
            positions, sqrt(g r) for velocities], drawn evenly in the logarithm; [0, 0] for none.
        resolution: Speed error [sqrt(g r)] below which an error counts linearly, above which in
            decades: 1 mm/s at rest and 1 m/s in flight both matter.
        lost: Position error [radii] beyond which a sphere is lost to chaos and no longer counts.
    """

    model: ContactConfig = field(default_factory=ContactConfig)
    frames: int = 3
    noise: tuple[float, float] = (1e-6, 1e-3)
    resolution: float = 1e-3
    lost: float = 0.25

    def __post_init__(self) -> None:
        super().__post_init__()
        check_least(self, 1, 'frames')
        if not self.model.network:
            raise ValueError('network of the model is off, so there is nothing to train')
        low, high = self.noise
        if not (0 <= low <= high and (low > 0 or high == 0)):
            raise ValueError(f'noise is [{low:g}, {high:g}], expected 0 < low <= high, or [0, 0]')
        check_positive(self, 'resolution', 'lost')


@dataclass(frozen=True)
class Scenario:
    """A training trajectory, with its scene as tensors; radius: shape (n,)."""

    record: Record
    world: World
    radius: Array

    @classmethod
    def of(cls, record: Record) -> Scenario:
        """Prepare a record.

        Raises:
            ValueError: Gravity is not that of the model's units.
        """
        gravity = np.asarray(record.scene.gravity)
        if not np.allclose(gravity, [0.0, 0.0, -UNIT_GRAVITY]):
            raise ValueError(
                f'record {record.name!r} has gravity {record.scene.gravity}, expected '
                f'(0, 0, {-UNIT_GRAVITY:g}); generate data in the units of the model'
            )
        count = record.trajectory.count
        world = World.of(record.scene, count)
        return cls(record, world, record.scene.per_sphere('radius', count))

    def motion(self, step: int) -> Motion:
        """State at a step."""
        t = self.record.trajectory
        return Motion(
            *(
                torch.from_numpy(np.array(values[step], dtype=np.float64))
                for values in (t.positions, t.velocities, t.angular_velocities)
            )
        )

    def candidates(self, positions: Array, velocities: Array) -> Candidates:
        """Contacts that a frame may bring; positions, velocities: shape (n, 3)."""
        scene = self.record.scene
        gravity = np.asarray(scene.gravity)
        dt = self.record.trajectory.dt
        return find_candidates(positions, velocities, self.radius, scene.surfaces, gravity, dt)

    def has_several(self, step: int) -> bool:
        """Whether some sphere that moves has several contacts in the frame after `step`."""
        motion = self.motion(step)
        candidates = self.candidates(motion.positions.numpy(), motion.velocities.numpy())
        if len(candidates) < 2:
            return False
        dt = self.record.trajectory.dt
        contacts = find_contacts(
            self.world, motion.positions, motion.velocities, candidates, dt, 0.0
        )
        bodies = torch.cat([contacts.a, contacts.b])
        several = torch.bincount(bodies, minlength=self.world.count + 1)[:-1] > 1
        moves = motion.velocities.norm(dim=1) > 0.02
        return bool((several & moves).any())


class ContactLearner(Learner[ContactNetwork]):
    """Trains a contact network.

    Args:
        config: The recipe.
        records: Training trajectories of any material, gravity 9.81 along -z.
    """

    kind = 'contact'
    score_name = 'closed_loop_loss'
    config: ContactTrainConfig

    def __init__(self, config: ContactTrainConfig, records: Sequence[Record]) -> None:
        if not records:
            raise ValueError('there are no training trajectories; run `rigid-gns generate` first')
        steps = {record.trajectory.dt for record in records}
        if len(steps) != 1:
            raise ValueError(f'the records have time steps {sorted(steps)}, expected one')
        self.dt = steps.pop()
        self.sources = [Scenario.of(record) for record in records]
        torch.manual_seed(config.seed)
        super().__init__(
            config,
            ContactNetwork(config.model),
            model=config.model,
            units=ModelUnits(radius=1.0, gravity=UNIT_GRAVITY, dt=self.dt),
            materials=_ranges(records),
            trajectories=len(records),
        )

    def means_at(self, step: int) -> tuple[Mean]:
        """Loss of this process' share of a step; windows of a share end extra rounds together."""
        rng = np.random.default_rng([self.config.seed, step])
        frames = self.config.frames
        windows = [_draw(self.sources, rng, frames) for _ in range(self.config.batch)]
        start = _stack([scenario.motion(at) for scenario, at in windows])
        start = self._noisy(start, windows, rng)  # all of it, so that shares are those of a whole
        counts = [scenario.world.count for scenario, _ in windows]
        moving = (start.positions, start.velocities, start.angular_velocities)
        parts = list(zip(*(values.split(counts) for values in moving), strict=True))
        own = self.processes.share(range(len(windows)))
        windows, start = [windows[k] for k in own], _stack([Motion(*parts[k]) for k in own])
        mean = self.mean(windows, start, frames)
        if not mean.value.requires_grad:  # no contacts that share a body: nothing to learn here
            nothing = 0.0 * torch.stack([weight.sum() for weight in self.parameters]).sum()
            mean = mean._replace(value=mean.value + nothing)
        return (mean,)

    @torch.no_grad()
    def score(self, records: Sequence[Record]) -> float:
        """Loss on held-out windows of `validation_steps` frames in closed loop, without noise.

        The same windows whatever the seed. Chaos does not drown it: lost spheres do not count.
        """
        sources = [Scenario.of(record) for record in records]
        rng = np.random.default_rng(0)
        frames = self.config.validation_steps
        windows = [_draw(sources, rng, frames) for _ in range(_WINDOWS)]
        start = _stack([scenario.motion(at) for scenario, at in windows])
        return float(self.mean(windows, start, frames).value)

    def mean(self, windows: Sequence[tuple[Scenario, int]], motion: Motion, frames: int) -> Mean:
        """Mean over spheres with contacts of log(1 + error / resolution), all frames alike.

        Errors are of velocity, of surface velocity r w, and of position per frame.
        """
        config, model = self.config, self.config.model
        world = World.join([scenario.world for scenario, _ in windows])
        neighbours = _Neighbours([scenario for scenario, _ in windows])
        memory: Memory | None = None
        radius = world.radius[:-1]
        resolution = config.resolution * (UNIT_GRAVITY * radius).sqrt()
        alive = torch.ones(world.count, dtype=torch.bool)
        total, weight = motion.positions.new_zeros(()), 0
        for k in range(1, frames + 1):
            result = frame(
                world,
                motion,
                neighbours,
                self.dt,
                memory,
                model.substeps,
                model.rounds,
                self.network,
                settle=False,
            )
            motion, memory = result.motion, result.memory
            truth = _stack([scenario.motion(at + k) for scenario, at in windows])
            engaged = torch.zeros(world.count + 1, dtype=torch.bool)
            for contacts in result.contacts:
                engaged[contacts.a] = True
                engaged[contacts.b] = True
            counted = torch.nonzero(engaged[:-1] & alive)[:, 0]
            apart = (motion.positions - truth.positions)[counted]
            errors = (
                (motion.velocities - truth.velocities)[counted],
                (motion.angular_velocities - truth.angular_velocities)[counted]
                * radius[counted, None],
                apart / self.dt,
            )
            for error in errors:
                size = error.square().sum(1).clamp(min=1e-24).sqrt()
                total = total + torch.log1p(size / resolution[counted]).sum()
            weight += 3 * len(counted)
            alive = alive.clone()
            alive[counted] = apart.detach().norm(dim=1) < config.lost * radius[counted]
        return Mean(total / max(weight, 1), weight)

    def _noisy(
        self, motion: Motion, windows: Sequence[tuple[Scenario, int]], rng: np.random.Generator
    ) -> Motion:
        low, high = self.config.noise
        if high == 0:
            return motion
        std = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        radius = torch.cat([scenario.world.radius[:-1] for scenario, _ in windows])[:, None]

        def noise() -> Tensor:
            return std * torch.from_numpy(rng.normal(size=motion.positions.shape))

        speed = (UNIT_GRAVITY * radius).sqrt()
        return Motion(
            motion.positions + noise() * radius,
            motion.velocities + noise() * speed,
            motion.angular_velocities + noise() * speed / radius,
        )


def _draw(
    sources: Sequence[Scenario], rng: np.random.Generator, frames: int
) -> tuple[Scenario, int]:
    """Return a scenario and a step at which some sphere that moves has several contacts."""
    for _ in range(_THROWS):
        scenario = sources[int(rng.integers(len(sources)))]
        step = int(rng.integers(scenario.record.trajectory.steps - frames + 1))
        if scenario.has_several(step):
            break
    return scenario, step


def _ranges(records: Sequence[Record]) -> dict[str, list[float]]:
    """Lowest and highest value of what the scenes of the training data have."""
    seen: dict[str, list[float]] = {}
    for record in records:
        scene, count = record.scene, record.trajectory.count
        for name in ('restitution', 'friction', 'rolling_friction'):
            values = scene.per_sphere(name, count)
            if name != 'rolling_friction':
                values = np.append(values, scene.surface_values(name))
            seen.setdefault(name, []).extend((float(values.min()), float(values.max())))
        for name in ('radius', 'mass'):
            ratios = scene.per_sphere(name, count)
            ratio = float(ratios.max() / ratios.min())
            seen.setdefault(f'{name}_ratio', []).extend((1.0, ratio))
    return {name: [min(values), max(values)] for name, values in seen.items()}


class _Neighbours:
    """Candidates of scenes side by side."""

    def __init__(self, scenarios: Sequence[Scenario]) -> None:
        self.scenarios = scenarios
        self.ends = np.cumsum([0] + [scenario.world.count for scenario in scenarios])
        self.planes = np.cumsum([0] + [len(scenario.world.point) for scenario in scenarios])

    def __call__(self, positions: Tensor, velocities: Tensor) -> Candidates:
        p, v = positions.detach().numpy(), velocities.detach().numpy()
        parts = []
        for index, scenario in enumerate(self.scenarios):
            own = slice(self.ends[index], self.ends[index + 1])
            found = scenario.candidates(p[own], v[own])
            parts.append(found.shifted(int(self.ends[index]), int(self.planes[index])))
        return join(parts)


def _stack(motions: Sequence[Motion]) -> Motion:
    names = ('positions', 'velocities', 'angular_velocities')
    return Motion(*(torch.cat([getattr(motion, name) for motion in motions]) for name in names))
