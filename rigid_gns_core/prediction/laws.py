# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of rigid contact as a simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np

from ..engine.options import LawsOptions
from ..files.checkpoint import LAWS
from ..files.config import from_mapping
from ..installation.versions import PACKAGE, version_of
from ..rollout.simulator import Simulator
from ..rollout.stepper import Stepper
from ..scenes.scene import Scene
from ..scenes.similarity import in_units, ModelUnits
from ..scenes.state import State

UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=0.1)
"""A frame of 0.1 s for spheres of 1 m, as the thesis has."""


class LawsSimulator(Simulator):
    """The laws of rigid contact: any radii, masses and materials.

    Args:
        options: See `LawsOptions`.

    Raises:
        UserError: There is no such option, or its value is out of range.
    """

    kind = 'laws'
    velocities = 'given'

    def __init__(self, **options: Any) -> None:
        self.options = from_mapping(LawsOptions, options, 'options of the laws')
        self._settings = asdict(self.options)  # not anew for each start
        card = {
            'kind': self.kind,
            'options': dict(self._settings),
            'version': version_of(PACKAGE) or 'unknown',  # a source tree that is not installed
        }
        super().__init__(card, LAWS, UNITS)

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Accept every scene: the laws hold for all."""

    def warm_up(self) -> None:
        """Compile the engine, or read it from the disk."""
        from ..engine.stepper import warm_up

        warm_up()

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """Stepper that starts from `state`; scene and state are in the model's units."""
        from ..engine.stepper import EngineStepper

        return EngineStepper(scene, state, self.units.dt, **self._settings)

    def steppers(self, scene: Scene, count: int) -> Callable[[State], Stepper]:
        """See `Simulator.steppers`: they share what does not move."""
        from ..engine.stepper import EngineStepper
        from ..engine.world import world_of

        world = world_of(scene, count)
        shared = None if world.moving else world
        return lambda state: EngineStepper(
            scene, state, self.units.dt, world=shared, **self._settings
        )

    def rollout_samples(self, scene: Scene, starts: State, steps: int) -> State:
        """As of `Simulator`, in one call of the engine; to the bit what `rollout` gives."""
        from ..engine.stepper import advance_starts

        similarity, similar = in_units(scene, self.units)
        frames, done = advance_starts(
            similar, similarity.to_model(starts), self.units.dt, steps, **self._settings
        )
        found = similarity.to_world(frames)
        for index, last in enumerate(done.tolist()):
            for values in vars(found).values():
                values[index, last:] = np.nan
        names = ('positions', 'quaternions', 'velocities', 'angular_velocities')
        pairs = ((getattr(starts, name)[:, None], getattr(found, name)) for name in names)
        return State.unchecked(*(np.concatenate(pair, axis=1) for pair in pairs))
