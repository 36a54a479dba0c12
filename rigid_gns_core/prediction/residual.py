# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws with a residual network as a simulator. It needs no torch."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any, TYPE_CHECKING
import warnings

import numpy as np

from .laws import UNITS
from ..engine.options import LawsOptions, ResidualConfig
from ..errors import UserError
from ..files.checkpoint import CheckpointError, Tensors
from ..files.config import from_mapping
from ..rollout.rollout import Rollout
from ..rollout.simulator import Simulator
from ..rollout.stepper import Stepper
from ..scenes.scene import Scene
from ..scenes.similarity import ModelUnits
from ..scenes.state import State

if TYPE_CHECKING:
    from ..engine.learned_network import RangeCounts

# difference of a material from that of the laws in training that is warned of
_SAME = 1e-3


class ResidualSimulator(Simulator):
    """The laws, and what a network learned of a lab beyond them.

    Args:
        tensors: The trained weights, by name.
        card: See `Simulator`.
        name: See `Simulator`.
        options: See `LawsOptions`.

    Raises:
        UserError: There is no such option, or its value is out of range.
        CheckpointError: The weights are those of another network, or of other units.
    """

    kind = 'residual'
    velocities = 'given'

    def __init__(self, tensors: Tensors, card: dict[str, Any], name: str, **options: Any) -> None:
        super().__init__(card, name, from_mapping(ModelUnits, card['units'], f'{name}: units'))
        if self.units != UNITS:
            raise CheckpointError(f'{name}: units are {self.units}, those of the laws are {UNITS}')
        self.options = from_mapping(LawsOptions, options, 'options of the laws')
        from ..engine.learned_network import network_of

        config = from_mapping(ResidualConfig, card['config'], f'{name}: config')
        try:
            self.network = network_of(tensors, config)
        except (KeyError, ValueError) as error:
            raise CheckpointError(
                f'{name}: weights and card do not belong together: {error}'
            ) from error

    @property
    def strength(self) -> float:
        """Share of the network's outputs that acts, as held-out tracks have chosen; 0: none."""
        return float(self.network.strength[0])

    @property
    def has_springs(self) -> bool:
        """Whether blows are those of springs that training found, see `engine/springs.py`."""
        return bool(self.network.springs[0] > 0)

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Refuse surfaces that move and obstacles, not learned of; warn of other materials."""
        moving = any(plane.moves for plane in scene.surfaces)
        if moving or scene.obstacles:
            what = 'surfaces that move' if moving else 'obstacles'
            raise UserError(
                f'the scene has {what}, which model {self.name!r} does not know; use the laws'
            )
        for name, trained in self.card.get('materials', {}).items():
            own = float(np.mean(scene.per_sphere(name, count))) if count else trained
            if abs(own - trained) > _SAME:
                warnings.warn(
                    f'{name} of the scene is {own:.4g} in the mean, but model {self.name!r} '
                    f'corrects laws with {trained:.4g}; give the scene that it was trained with',
                    stacklevel=stacklevel,
                )

    def warm_up(self) -> None:
        """Compile the engine, or read it from the disk."""
        from ..engine.learned_stepper import warm_up

        warm_up(self.network)

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """Stepper that starts from `state`; scene and state are in the model's units."""
        from ..engine.learned_stepper import LearnedStepper

        return LearnedStepper(self.network, scene, state, self.units.dt, **asdict(self.options))


def range_counts(rollout: Rollout) -> RangeCounts | None:
    """How far contacts of a rollout so far are from those in training; None: of another model."""
    from ..engine.learned_stepper import LearnedStepper

    stepper = rollout.stepper
    return stepper.range_counts if isinstance(stepper, LearnedStepper) else None
