# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of rigid contact as a simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from ..engine.options import LawsOptions
from ..files.checkpoint import LAWS
from ..files.config import from_mapping
from ..installation.versions import PACKAGE, version_of
from ..rollout.simulator import Simulator
from ..rollout.stepper import Stepper
from ..running.threads import in_threads, usable_cores
from ..scenes.scene import Scene
from ..scenes.similarity import in_units, ModelUnits
from ..scenes.state import State

UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=0.1)
"""A frame of 0.1 s for spheres of 1 m, as the thesis has."""

# starts from which on a thread of its own pays
_IN_THREAD = 256


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
        from ..engine.world import still_world

        world = still_world(scene, count)
        return lambda state: EngineStepper(
            scene, state, self.units.dt, world=world, **self._settings
        )

    def rollout_samples(
        self, scene: Scene, starts: State, steps: int, *, workers: int | None = None
    ) -> State:
        """As of `Simulator`, to the bit what `rollout` gives: parts of the starts in threads."""
        count = len(starts.positions)
        found = State.unchecked(
            *(np.empty((count, steps + 1, *values.shape[1:])) for values in vars(starts).values())
        )
        parts = max(1, min(workers or usable_cores(), count // _IN_THREAD))
        bounds = np.linspace(0, count, parts + 1).astype(int).tolist()

        def roll(chosen: slice) -> None:
            self._roll(scene, _part(starts, chosen), _part(found, chosen))

        in_threads(roll, [slice(*pair) for pair in pairwise(bounds)], parts)
        return found

    def _roll(self, scene: Scene, starts: State, frames_out: State) -> None:
        """Write starts and their frames, fields of shape (s, steps + 1, n, k)."""
        from ..engine.stepper import advance_starts

        similarity, similar = in_units(scene, self.units)
        given = similar, similarity.to_model(starts), self.units.dt
        done = advance_starts(*given, **self._settings, frames_out=frames_out)
        similarity.to_world(frames_out, in_place=True)
        unfinished = np.flatnonzero(done < frames_out.positions.shape[1]).tolist()
        for name, values in vars(frames_out).items():
            values[:, 0] = getattr(starts, name)
            for index in unfinished:
                values[index, done[index] :] = np.nan


def _part(states: State, chosen: slice) -> State:
    return State.unchecked(*(values[chosen] for values in vars(states).values()))
