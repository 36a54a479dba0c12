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

"""Rolls a contact model out in the model's units: sleep, frame, energy guard."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .frame import advance
from .guard import hold
from .islands import Islands
from .jit import compiled, compiling, entry, is_compiled
from .memory import Memory, no_memory
from .network import no_weights, weights_of
from .overlap import separate
from .sleep import all_awake, settle, Sleepers
from .spheres import is_finite, Spheres, store
from .substep import Settings
from .world import World, world_of
from ..scene import Plane, Scene
from ..state import State
from ..stepper import Advance, state_at, Stepper

_DIVERGED = 'the rollout diverged: a predicted value is not finite'


def settings_of(
    tensors: Mapping[str, NDArray[Any]] | None,
    substeps: int,
    rounds: int,
    everywhere: bool = False,
) -> Settings:
    """Return a model for the engine; tensors None: the law alone."""
    weights = no_weights() if tensors is None else weights_of(tensors, rounds)
    return Settings(substeps, rounds, weights, no_weights(), everywhere)


@compiled
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


@entry
def _advance(
    world: World,
    spheres: Spheres,
    dt: float,
    memory: Memory,
    settings: Settings,
    sleepers: Sleepers,
    guards: bool,
    sleeps: bool,
    made: Spheres,
) -> tuple[int, Memory, int, float]:
    """Frames one after the other into `made`, shapes (frames, n, k), up to one that is not finite.

    Returns how many there are, the memory, islands that the guard held, and the energy it took. In
    one call, since the way into compiled code and back costs as much as a fifth of a frame.
    """
    acted, removed = 0, 0.0
    for frame in range(len(made.positions)):
        after, memory, islands = advance(world, spheres, dt, memory, settings, sleepers)
        held, taken = _finish(world, spheres, after, islands, dt, sleepers, guards, sleeps)
        if not is_finite(after):
            return frame, memory, acted, removed
        acted += held
        removed += taken
        store(after, made, frame)
        spheres = after
    return len(made.positions), memory, acted, removed


def warm_up() -> None:
    """Compile what is not compiled yet, or read it from the disk, before it is needed."""
    scene = Scene(surfaces=(Plane(),))
    start = State(positions=np.array([[0.0, 0.0, 1.2], [0.0, 0.5, 3.0]]))
    with compiling():
        EngineStepper(settings_of(None, 1, 1), scene, start, 0.1).step()


class EngineStepper(Stepper):
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
            warm_up()
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
        states, error = self.advance(1)
        if error:
            raise FloatingPointError(error)
        return state_at(states, 0)

    def advance(self, steps: int) -> Advance:
        """Advance by so many dt; see `Stepper`."""
        if self.frames == 0:
            separate(self.world, self.spheres.positions, self.dt)
        made = Spheres(*(np.empty((steps, *values.shape)) for values in self.spheres))
        done, self.memory, acted, removed = _advance(
            self.world,
            self.spheres,
            self.dt,
            self.memory,
            self.settings,
            self.sleepers,
            self.guards,
            self.sleeps,
            made,
        )
        self.frames += done
        self.acted += acted
        self.removed += removed
        if done:
            self.spheres = Spheres(*(values[done - 1].copy() for values in made))
        diverged = done < steps
        return Advance(
            State.unchecked(*(values[:done] for values in made)), _DIVERGED if diverged else ''
        )
