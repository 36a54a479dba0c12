# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training of the thesis' GNS on noisy windows, of one step (thesis section 3.3) or several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from .closed_loop import Batch, batch_of, roll_out
from .windows import Draw, draw_windows, Noise, Source, stack_windows, Windows
from ..learner import Learner, Schedule
from ...data.common_scene import common_scene
from ...data.records import Record
from ...errors import UserError
from ...files.config import check_least
from ...gns.config import GNSConfig
from ...gns.network import GNS
from ...scenes.similarity import ModelUnits

# windows whose statistics normalise features, and their step number, which no training step has
_STATISTICS_WINDOWS, _STATISTICS_STEP = 256, 2**31


@dataclass(frozen=True)
class GNSTrainConfig(Schedule):
    """A training recipe of the GNS; config/train/gns.yaml explains each choice.

    Args:
        model: The network.
        noise: Noise on inputs.
        energy_weight: lambda of the energy regulariser; 0 turns it off.
        start_fraction: Share of windows with a history cut short, as at a rollout's start.
        rotate: Turn each window by a random angle about gravity.
        closed_loop_steps: Steps that each window is rolled out for, with gradients through all of
            them; 1 is the thesis' one-step training.
        curriculum: Share of the training steps over which the trajectories that are drawn grow,
            evenly, from those with the fewest spheres to all; 0: all from the start.
    """

    model: GNSConfig = field(default_factory=GNSConfig)
    noise: Noise = field(default_factory=Noise)
    energy_weight: float = 0.0
    start_fraction: float = 0.1
    rotate: bool = True
    closed_loop_steps: int = 1
    curriculum: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_least(self, 0, 'energy_weight', 'start_fraction', 'curriculum')
        for name in ('start_fraction', 'curriculum'):
            if not getattr(self, name) <= 1:
                raise UserError(f'{name} is {getattr(self, name)}, expected at most 1')
        if self.closed_loop_steps < 1:
            raise UserError(
                f'closed_loop_steps is {self.closed_loop_steps}, expected at least 1, which is '
                'one-step training'
            )


class GNSLearner(Learner[GNS]):
    """Trains a GNS.

    Args:
        config: The recipe.
        sources: Training trajectories, all in `units`.
        units: Radius, gravity and time step of the trajectories.
        materials: Of all trajectories.
        device: Where features are computed and the network is trained; None: the CPU.

    Raises:
        UserError: No trajectory is as long as `closed_loop_steps`.
    """

    kind = 'gns'
    measure = 'root_chamfer_radii'
    config: GNSTrainConfig

    def __init__(
        self,
        config: GNSTrainConfig,
        sources: Sequence[Source],
        units: ModelUnits,
        materials: dict[str, float] | None = None,
        device: torch.device | None = None,
    ) -> None:
        steps = config.closed_loop_steps
        self.sources = [source for source in sources if source.steps >= steps]
        if not self.sources:
            raise UserError(
                f'no training trajectory has {steps} steps (closed_loop_steps), the longest has '
                f'{max(source.steps for source in sources)}; lower it, or generate longer ones'
            )
        torch.manual_seed(config.seed)
        super().__init__(
            config,
            GNS(config.model),
            model=config.model,
            units=units,
            materials=materials or {},
            trajectories=len(self.sources),
            device=device,
        )
        self._fit_normalisers()

    @classmethod
    def of(
        cls, config: GNSTrainConfig, records: Sequence[Record], device: torch.device | None = None
    ) -> GNSLearner:
        """Learner on records.

        Raises:
            UserError: There are no records, or they differ in radius, gravity, dt or material.
        """
        units, materials = common_scene(records)
        sources = [Source.of(record.trajectory, record.scene) for record in records]
        return cls(config, sources, units, materials, device)

    def loss_at(self, step: int) -> Tensor:
        """Loss over the windows of a step: a resumed run draws the same."""
        error, gain = self.loss_terms(self.draw(step, self.config.batch, self.config.noise))
        return error + gain

    def draw(self, step: int, size: int, noise: Noise) -> list[Draw]:
        """Draws of the windows of a step, which follow from the seed and the step alone."""
        config = self.config
        return draw_windows(
            self.sources,
            size,
            config.model,
            noise,
            np.random.default_rng([config.seed, step]),
            start_fraction=config.start_fraction,
            rotate=config.rotate,
            steps=config.closed_loop_steps,
            largest=self.largest_at(step),
        )

    def largest_at(self, step: int) -> float:
        """Largest number of spheres of the trajectories that a step draws from (curriculum)."""
        grown = self.config.curriculum * self.config.steps
        if step >= grown:
            return np.inf
        counts = [source.count for source in self.sources]
        return min(counts) + (max(counts) - min(counts)) * step / grown

    def windows(self, draws: Sequence[Draw], steps: int) -> Windows:
        """Windows of these draws, of so many steps."""
        corrects = self.config.noise.corrects_target
        return stack_windows(self.sources, draws, self.config.model, steps, corrects, self.device)

    def loss_terms(self, draws: Sequence[Draw]) -> tuple[Tensor, Tensor]:
        """L2 on normalised targets, and lambda times the energy gain (section 3.3).

        Both are means over the steps of the windows; lost spheres are left out of the first.
        """
        config, network = self.config, self.network
        windows = self.windows(draws, config.closed_loop_steps)
        errors, gains = [], []
        for batch, output, counted in roll_out(network, windows, config.noise.corrects_target):
            motion = batch.graph.motion
            target = network.encode_target(batch.next_motion, motion)
            errors.append((output - target)[counted].square().flatten())
            if config.energy_weight:
                gains.append(self.energy_gain(network.decode(output, motion), batch))
        error = torch.cat(errors).mean()
        gain = config.energy_weight * torch.stack(gains).mean() if gains else error.new_zeros(())
        return error, gain

    def energy_gain(self, predicted: Tensor, batch: Batch) -> Tensor:
        """Mean over windows of max(E[k+1] - E[k], 0), per sphere and in units of m g r.

        The thesis adds joules of the whole scene; this way lambda does not depend on its size.

        Args:
            predicted: Next [v, omega] [m/s, rad/s], shape (n, 6).
            batch: What it was predicted from.
        """
        g, dt, radius = self.units.gravity, self.units.dt, self.units.radius
        before = batch.graph.motion[:, :3]
        kinetic = 0.5 * (predicted[:, :3].square() - before.square()).sum(1)
        change = kinetic + g * dt * predicted[:, 2]
        total = change.new_zeros(batch.windows).index_add(0, batch.owner, change)
        spheres = torch.bincount(batch.owner, minlength=batch.windows)
        return torch.relu(total / spheres).mean() / (g * radius)

    def _fit_normalisers(self) -> None:
        draws = self.draw(_STATISTICS_STEP, _STATISTICS_WINDOWS, Noise(std=0.0))
        windows = self.windows(draws, 1)
        batch = batch_of(windows, 0, windows.start, corrects_target=False)
        network, graph = self.network, batch.graph
        target = batch.next_motion
        if self.config.model.target == 'acceleration':
            target = target - graph.motion
        for normaliser, values in (
            (network.node_normaliser, graph.nodes),
            (network.edge_normaliser, graph.edges),
            (network.surface_normaliser, graph.surface_edges),
            (network.target_normaliser, target),
        ):
            if len(values):
                normaliser.fit(values.mean(0), values.std(0, correction=0))
