# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all trainings share: schedule, optimiser, averaged weights, state (thesis section 3.3)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import math
from typing import Any, ClassVar, Generic, TypeVar

import torch
from torch import nn, Tensor

from ..errors import UserError
from ..files.checkpoint import CheckpointError
from ..files.config import check_least, check_positive
from ..scenes.similarity import ModelUnits

N = TypeVar('N', bound=nn.Module)

# windows in a step: more fill any memory, and the process is killed for it
_MOST_BATCH = 100_000


@dataclass(frozen=True)
class Schedule:
    """The part of a training recipe that does not depend on the model.

    Args:
        seed: Of weights, batches and noise.
        steps: Optimiser steps.
        batch: Windows in a step.
        learning_rate: Reached after `warm_up` steps.
        final_learning_rate: At the end, reached along half a cosine.
        warm_up: Steps of linear warm-up.
        clip: Largest norm of the gradient.
        average: Decay per step of the running average of weights that is kept; 0 turns it off.
        validate_every: Steps between validations by rollout, and between checkpoints.
        validation_rollouts: Records of the validation set that are rolled out.
        validation_steps: Length of these rollouts.
    """

    seed: int = 0
    steps: int = 10_000
    batch: int = 16
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-6
    warm_up: int = 100
    clip: float = 1.0
    average: float = 0.0
    validate_every: int = 500
    validation_rollouts: int = 4
    validation_steps: int = 100

    def __post_init__(self) -> None:
        check_least(self, 1, 'steps', 'batch', 'validate_every', 'validation_steps')
        check_least(self, 0, 'seed', 'warm_up', 'validation_rollouts', 'average')
        if self.batch > _MOST_BATCH:
            raise UserError(f'batch is {self.batch}, expected at most {_MOST_BATCH}')
        check_positive(self, 'learning_rate', 'final_learning_rate', 'clip')
        if not self.average < 1:
            raise UserError(f'average is {self.average}, expected less than 1')

    def learning_rate_at(self, step: int) -> float:
        """Linear warm-up, then half a cosine down to `final_learning_rate`."""
        if step < self.warm_up:
            return self.learning_rate * (step + 1) / self.warm_up
        done = (step - self.warm_up) / max(self.steps - self.warm_up, 1)
        span = self.learning_rate - self.final_learning_rate
        return self.final_learning_rate + span * 0.5 * (1 + math.cos(math.pi * min(done, 1.0)))


class Learner(ABC, Generic[N]):
    """Network and optimiser; every draw follows from (seed, step) alone.

    Args:
        config: The schedule.
        network: To be trained; made after `torch.manual_seed(config.seed)`.
        model: Configuration of the network, kept in the card.
        units: Radius, gravity and time step of the training data.
        materials: What the card says of the materials.
        trajectories: Number of training trajectories.
        device: Where the network is trained.
    """

    kind: ClassVar[str]
    measure: ClassVar[str]  # name of the validation score in the card

    def __init__(
        self,
        config: Schedule,
        network: N,
        *,
        model: Any,
        units: ModelUnits,
        materials: dict[str, Any],
        trajectories: int,
        device: torch.device | None = None,
    ) -> None:
        self.device = device or torch.device('cpu')
        self.config, self.network = config, network.to(self.device)
        self.model, self.units, self.materials = model, units, materials
        self.trajectories = trajectories
        self.parameters: list[Tensor] = list(network.parameters())
        self.averaged = [parameter.detach().clone() for parameter in self.parameters]
        self.optimizer = torch.optim.Adam(self.parameters, lr=config.learning_rate, fused=True)
        self.step = 0

    @abstractmethod
    def loss_at(self, step: int) -> Tensor:
        """Loss of a step: a resumed run draws the same."""

    def advance(self) -> float:
        """Take one optimiser step; returns the loss.

        Raises:
            FloatingPointError: The loss is not finite.
        """
        config = self.config
        for group in self.optimizer.param_groups:
            group['lr'] = config.learning_rate_at(self.step)
        total = self.loss_at(self.step)
        loss = total.item()
        if not math.isfinite(loss):
            raise FloatingPointError(
                f'the loss is {loss} at step {self.step}; train anew, in another folder, '
                'with a lower learning_rate or clip'
            )
        self.optimizer.zero_grad()
        total.backward()
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
        return loss

    @contextmanager
    def averaged_weights(self) -> Iterator[N]:
        """Yield the network with its averaged weights, where the recipe has an average."""
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
        """All that a resumed run needs, as tensors on the CPU."""
        tensors = {f'network.{name}': value for name, value in self.network.state_dict().items()}
        for index, parameter in enumerate(self.parameters):
            tensors[f'average.{index}'] = self.averaged[index]
            for name, value in self.optimizer.state[parameter].items():
                tensors[f'optimizer.{index}.{name}'] = value
        tensors['step'] = torch.tensor(self.step)
        return {name: value.cpu() for name, value in tensors.items()}

    def load_state(self, tensors: dict[str, Tensor]) -> None:
        """Restore what `state` returned.

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
                    # the count of steps too, which a fused Adam reads on the device
                    self.optimizer.state[parameter] = {
                        name: value.to(self.device) for name, value in state.items()
                    }
            self.step = int(tensors['step'])
        except (KeyError, RuntimeError) as error:
            raise CheckpointError(
                f'the state of the run does not fit its recipe: {error}'
            ) from error
