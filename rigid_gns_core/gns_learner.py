"""Training of the thesis' GNS: one-step loss on noisy windows (thesis section 3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from .dataset import Record
from .learner import Learner, Schedule
from .models.configs import GNSConfig
from .models.gns import GNS
from .similarity import ModelUnits
from .training_set import common_scene
from .windows import Batch, Noise, Source, draw_batch

# windows whose statistics normalise features, and a step number no training step has
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
    """

    model: GNSConfig = field(default_factory=GNSConfig)
    noise: Noise = field(default_factory=Noise)
    energy_weight: float = 0.0
    start_fraction: float = 0.1
    rotate: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ('energy_weight', 'start_fraction'):
            if not getattr(self, name) >= 0:
                raise ValueError(f'{name} is {getattr(self, name)}, expected at least 0')
        if not self.start_fraction <= 1:
            raise ValueError(f'start_fraction is {self.start_fraction}, expected at most 1')


class GNSLearner(Learner[GNS]):
    """Trains a GNS.

    Args:
        config: The recipe.
        sources: Training trajectories, all in `units`.
        units: Radius, gravity and time step of the trajectories.
        materials: Of all trajectories.
    """

    kind = 'gns'
    config: GNSTrainConfig

    def __init__(
        self,
        config: GNSTrainConfig,
        sources: Sequence[Source],
        units: ModelUnits,
        materials: dict[str, float] | None = None,
    ) -> None:
        self.sources = sources
        torch.manual_seed(config.seed)
        super().__init__(
            config,
            GNS(config.model),
            model=config.model,
            units=units,
            materials=materials or {},
            trajectories=len(sources),
        )
        self._fit_normalisers()

    @classmethod
    def of(cls, config: GNSTrainConfig, records: Sequence[Record]) -> GNSLearner:
        """Learner on records.

        Raises:
            ValueError: There are no records, or they differ in radius, gravity, dt or material.
        """
        units, materials = common_scene(records)
        sources = [Source.of(record.trajectory, record.scene) for record in records]
        return cls(config, sources, units, materials)

    def loss_at(self, step: int) -> Tensor:
        """One-step loss of the batch of a step."""
        return self.loss(self.batch(step, self.config.batch, self.config.noise))

    def batch(self, step: int, size: int, noise: Noise) -> Batch:
        """The batch of a step: a resumed run draws the same ones."""
        rng = np.random.default_rng([self.config.seed, step])
        return draw_batch(
            self.sources,
            size,
            self.config.model,
            noise,
            rng,
            start_fraction=self.config.start_fraction,
            rotate=self.config.rotate,
        )

    def loss(self, batch: Batch) -> Tensor:
        """One-step L2 on normalised targets, plus lambda times the energy gain (section 3.3)."""
        motion = batch.graph.motion
        output = self.network(batch.graph)
        loss = (output - self.network.encode_target(batch.next_motion, motion)).square().mean()
        if self.config.energy_weight:
            gain = self.energy_gain(self.network.decode(output, motion), batch)
            loss = loss + self.config.energy_weight * gain
        return loss

    def energy_gain(self, predicted: Tensor, batch: Batch) -> Tensor:
        """Mean over windows of max(E[k+1] - E[k], 0), per sphere and in units of m g r.

        The thesis adds joules of the whole scene; this way lambda does not depend on its size.
        """
        g, dt, radius = self.units.gravity, self.units.dt, self.units.radius
        before = batch.graph.motion[:, :3]
        kinetic = 0.5 * (predicted[:, :3].square() - before.square()).sum(1)
        change = kinetic + g * dt * predicted[:, 2]
        total = torch.zeros(batch.windows).index_add(0, batch.owner, change)
        spheres = torch.bincount(batch.owner, minlength=batch.windows)
        return torch.relu(total / spheres).mean() / (g * radius)

    def _fit_normalisers(self) -> None:
        batch = self.batch(_STATISTICS_STEP, _STATISTICS_WINDOWS, Noise(std=0.0))
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
