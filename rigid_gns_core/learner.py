"""What one optimiser step does: loss, gradient, averaged weights (thesis section 3.3)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from .checkpoint import CheckpointError
from .models.gns import GNS, GNSConfig
from .similarity import ModelUnits
from .windows import Batch, Noise, Source, draw_batch

# windows whose statistics normalise features, and a step number no training step has
_STATISTICS_WINDOWS, _STATISTICS_STEP = 256, 2**31


@dataclass(frozen=True)
class TrainConfig:
    """A training recipe; the files in config/train explain each choice.

    Args:
        model: The network.
        noise: Noise on inputs.
        seed: Of weights, batches and noise.
        steps: Optimiser steps.
        batch: Windows in a step.
        learning_rate: Reached after `warm_up` steps.
        final_learning_rate: At the end, reached along half a cosine.
        warm_up: Steps of linear warm-up.
        clip: Largest norm of the gradient.
        energy_weight: lambda of the energy regulariser; 0 turns it off.
        start_fraction: Share of windows with a history cut short, as at a rollout's start.
        rotate: Turn each window by a random angle about gravity.
        average: Decay per step of the running average of weights that is kept; 0 turns it off.
        validate_every: Steps between validations by rollout, and between checkpoints.
        validation_rollouts: Records of the validation set that are rolled out.
        validation_steps: Length of these rollouts.
    """

    model: GNSConfig = field(default_factory=GNSConfig)
    noise: Noise = field(default_factory=Noise)
    seed: int = 0
    steps: int = 10_000
    batch: int = 16
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-6
    warm_up: int = 100
    clip: float = 1.0
    energy_weight: float = 0.0
    start_fraction: float = 0.1
    rotate: bool = True
    average: float = 0.0
    validate_every: int = 500
    validation_rollouts: int = 4
    validation_steps: int = 100

    def __post_init__(self) -> None:
        for names, least in (
            (('steps', 'batch', 'validate_every', 'validation_steps'), 1),
            (('seed', 'warm_up', 'validation_rollouts'), 0),
            (('energy_weight', 'start_fraction', 'average'), 0.0),
        ):
            for name in names:
                if not getattr(self, name) >= least:
                    raise ValueError(f'{name} is {getattr(self, name)}, expected at least {least}')
        for name in ('learning_rate', 'final_learning_rate', 'clip'):
            if not getattr(self, name) > 0:
                raise ValueError(f'{name} is {getattr(self, name)}, expected more than 0')
        if not self.start_fraction <= 1:
            raise ValueError(f'start_fraction is {self.start_fraction}, expected at most 1')
        if not self.average < 1:
            raise ValueError(f'average is {self.average}, expected less than 1')

    def learning_rate_at(self, step: int) -> float:
        """Linear warm-up, then half a cosine down to `final_learning_rate`."""
        if step < self.warm_up:
            return self.learning_rate * (step + 1) / self.warm_up
        done = (step - self.warm_up) / max(self.steps - self.warm_up, 1)
        span = self.learning_rate - self.final_learning_rate
        return self.final_learning_rate + span * 0.5 * (1 + math.cos(math.pi * min(done, 1.0)))


class Learner:
    """Network, optimiser and training data; every draw follows from (seed, step) alone.

    Args:
        config: The recipe.
        sources: Training trajectories, all in `units`.
        units: Radius, gravity and time step of the trajectories.
    """

    def __init__(self, config: TrainConfig, sources: Sequence[Source], units: ModelUnits) -> None:
        self.config, self.sources, self.units = config, sources, units
        torch.manual_seed(config.seed)
        self.network = GNS(config.model)
        self._fit_normalisers()
        self.parameters: list[Tensor] = list(self.network.parameters())
        self.averaged = [parameter.detach().clone() for parameter in self.parameters]
        self.optimizer = torch.optim.Adam(self.parameters, lr=config.learning_rate)
        self.step = 0

    def advance(self) -> float:
        """One optimiser step; returns the loss.

        Raises:
            FloatingPointError: The loss is not finite.
        """
        config = self.config
        for group in self.optimizer.param_groups:
            group['lr'] = config.learning_rate_at(self.step)
        loss = self.loss(self.batch(self.step, config.batch, config.noise))
        if not torch.isfinite(loss):
            raise FloatingPointError(
                f'the loss is {loss.item()} at step {self.step}; train anew, in another folder, '
                'with a lower learning_rate or clip'
            )
        self.optimizer.zero_grad()
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.parameters, config.clip)
        if not torch.isfinite(norm):  # before it reaches the weights
            raise FloatingPointError(
                f'the gradient is not finite at step {self.step}; train anew, in another folder, '
                'with a lower learning_rate or clip'
            )
        self.optimizer.step()
        self.step += 1
        with torch.no_grad():
            # early on the average is short, so that it does not remember the random start
            decay = min(config.average, self.step / (9 + self.step))
            torch._foreach_lerp_(self.averaged, self.parameters, 1 - decay)
        return loss.item()

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

    @contextmanager
    def averaged_weights(self) -> Iterator[GNS]:
        """The network with its averaged weights, where the recipe has an average."""
        current = [parameter.detach().clone() for parameter in self.parameters]
        with torch.no_grad():
            if self.config.average:
                torch._foreach_copy_(self.parameters, self.averaged)
            self.network.eval()
            try:
                yield self.network
            finally:
                torch._foreach_copy_(self.parameters, current)
                self.network.train()

    def state(self) -> dict[str, Tensor]:
        """All that a resumed run needs, as tensors."""
        tensors = {f'network.{name}': value for name, value in self.network.state_dict().items()}
        for index, parameter in enumerate(self.parameters):
            tensors[f'average.{index}'] = self.averaged[index]
            for name, value in self.optimizer.state[parameter].items():
                tensors[f'optimizer.{index}.{name}'] = value
        tensors['step'] = torch.tensor(self.step)
        return tensors

    def load_state(self, tensors: dict[str, Tensor]) -> None:
        """Go on from `state()`.

        Raises:
            CheckpointError: The tensors are not of this network.
        """

        def part(prefix: str) -> dict[str, Tensor]:
            return {
                name.removeprefix(prefix): value
                for name, value in tensors.items()
                if name.startswith(prefix)
            }

        try:
            self.network.load_state_dict(part('network.'))
            for index, parameter in enumerate(self.parameters):
                self.averaged[index].copy_(tensors[f'average.{index}'])
                if state := part(f'optimizer.{index}.'):
                    self.optimizer.state[parameter] = state
            self.step = int(tensors['step'])
        except (KeyError, RuntimeError) as error:
            raise CheckpointError(
                f'the state of the run does not fit its recipe: {error}'
            ) from error

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
