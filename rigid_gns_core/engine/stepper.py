"""Rolls a contact model out in the model's units: sleep, frame, energy guard."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scene import Plane, Scene
from ..state import State
from .frame import advance
from .guard import hold
from .islands import Islands
from .jit import entry, is_compiled
from .memory import no_memory
from .network import no_weights, weights_of
from .overlap import separate
from .sleep import Sleepers, all_awake, settle
from .spheres import Spheres
from .substep import Settings
from .world import World, world_of


def settings_of(
    tensors: Mapping[str, NDArray[Any]] | None, substeps: int, rounds: int, everywhere: bool = False
) -> Settings:
    """A model for the engine; tensors None: the law alone."""
    weights = no_weights() if tensors is None else weights_of(tensors, rounds)
    return Settings(substeps, rounds, weights, no_weights(), everywhere)


@entry
def _finish(
    world: World,
    before: Spheres,
    after: Spheres,
    islands: Islands,
    dt: float,
    sleepers: Sleepers,
    guards: bool,
    sleeps: bool,
) -> tuple[int, float]:
    """Guard and sleep; returns the islands that the guard held, and the energy it took."""
    acted, removed = 0, 0.0
    if guards:
        acted, removed = hold(world, before, after, islands, dt)
    if sleeps:
        settle(sleepers, world.radius[:-1], after, islands, dt)
    return acted, removed


def warm_up() -> None:
    """Compile what is not compiled yet, or read it from the disk, before it is needed."""
    scene = Scene(surfaces=(Plane(),))
    start = State(positions=np.array([[0.0, 0.0, 1.2], [0.0, 0.5, 3.0]]))
    stepper = EngineStepper(settings_of(None, 1, 1), scene, start, 0.1)
    stepper.step()


class EngineStepper:
    """Rolls a contact model out in the model's units.

    Args:
        settings: The model.
        scene: Surfaces and sphere properties.
        state: Start.
        dt: Length of a frame.
        guard: Hold the energy of every island down.
        sleep: Let islands at rest sleep.
    """

    def __init__(
        self,
        settings: Settings,
        scene: Scene,
        state: State,
        dt: float,
        *,
        guard: bool = True,
        sleep: bool = True,
    ) -> None:
        if not is_compiled():
            print('rigid_gns: compiling the engine, once; about a minute', file=sys.stderr)
        self.settings, self.dt = settings, dt
        self.guards, self.sleeps = guard, sleep
        self.world = world_of(scene, len(state))
        self.sleepers = all_awake(self.world.radius[:-1], float(np.linalg.norm(scene.gravity)))
        self.memory = no_memory()
        self.frames, self.acted, self.removed = 0, 0, 0.0
        self.spheres = Spheres(
            np.array(state.positions),
            np.array(state.quaternions),
            np.array(state.velocities),
            np.array(state.angular_velocities),
        )

    def step(self) -> State:
        """Advance by dt.

        Raises:
            FloatingPointError: A value is not finite.
        """
        if self.frames == 0:
            separate(self.world, self.spheres.positions, self.dt)
        before = self.spheres
        after, self.memory, islands = advance(
            self.world, before, self.dt, self.memory, self.settings, self.sleepers
        )
        acted, removed = _finish(
            self.world, before, after, islands, self.dt, self.sleepers, self.guards, self.sleeps
        )
        if not all(np.isfinite(values).all() for values in after):
            raise FloatingPointError('the rollout diverged: a predicted value is not finite')
        self.frames += 1
        self.acted += acted
        self.removed += removed
        self.spheres = after
        return State.unchecked(*after)
