# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rolls the laws out in the model's units: frame, energy guard, sleep."""

from __future__ import annotations

import numpy as np

from .frame import advance
from .guard import limit_energy
from .islands import Islands
from .motion import Settings
from .separation import separate
from .sleep import all_awake, put_to_sleep, Sleepers
from .spheres import is_finite, Spheres, store
from .warm_start import cold_start, WarmStart
from .world import World, world_of
from ..kernels.jit import compiled, compiling, entry, is_compiled
from ..rollout.stepper import Advance, state_at, Stepper
from ..scenes.scene import Plane, Scene
from ..scenes.state import State

_DIVERGED = 'the rollout diverged: a predicted value is not finite'


@compiled
def _finish(
    world: World,
    before: Spheres,
    islands: Islands,
    dt: float,
    guards: bool,
    sleeps: bool,
    after_out: Spheres,
    sleepers_out: Sleepers,
) -> tuple[int, float]:
    """Guard and sleep; returns how many islands the guard limited, and the energy it took."""
    acted, removed = 0, 0.0
    if guards:
        acted, removed = limit_energy(world, before, islands, dt, after_out)
    if sleeps:
        put_to_sleep(world.radius[:-1], islands, dt, after_out, sleepers_out)
    return acted, removed


@entry
def _advance(
    world: World,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    sleepers_out: Sleepers,
    frames_out: Spheres,
) -> tuple[int, WarmStart, int, float]:
    """Write frames into `frames_out`, shapes (frames, n, k), up to one that is not finite.

    Returns how many there are, the warm start, how many islands the guard limited, and the energy
    it took. All in one call, since a call of compiled code costs a fifth of a frame.
    """
    acted, removed = 0, 0.0
    for frame in range(len(frames_out.positions)):
        after, warm_start, islands = advance(
            world, spheres, dt, warm_start, settings, sleepers_out
        )
        held, taken = _finish(
            world=world,
            before=spheres,
            islands=islands,
            dt=dt,
            guards=guards,
            sleeps=sleeps,
            after_out=after,
            sleepers_out=sleepers_out,
        )
        if not is_finite(after):
            return frame, warm_start, acted, removed
        acted += held
        removed += taken
        store(after, frame, frames_out)
        spheres = after
    return len(frames_out.positions), warm_start, acted, removed


def warm_up() -> None:
    """Compile what is not compiled yet, or read it from the disk, before it is needed."""
    scene = Scene(surfaces=(Plane(),))
    start = State(positions=np.array([[0.0, 0.0, 1.2], [0.0, 0.5, 3.0]]))
    with compiling():
        EngineStepper(scene, start, 0.1, substeps=1, rounds=1).step()


class EngineStepper(Stepper):
    """Rolls the laws out in the model's units.

    Args:
        scene: Surfaces and sphere properties.
        state: Start.
        dt: Length of a frame.
        substeps: K of a frame.
        rounds: M, iterations of the solver in a substep.
        guard: Limit the energy of every island.
        sleep: Let islands at rest sleep.
    """

    def __init__(
        self,
        scene: Scene,
        state: State,
        dt: float,
        *,
        substeps: int,
        rounds: int,
        guard: bool = True,
        sleep: bool = True,
    ) -> None:
        if not is_compiled():
            warm_up()
        self.settings, self.dt = Settings(substeps=substeps, iterations=rounds), dt
        self.world = world_of(scene, len(state))
        # what rests on a surface that moves may be carried anywhere
        self.guards, self.sleeps = guard, sleep and not self.world.moving
        self.sleepers = all_awake(self.world.radius[:-1], float(np.linalg.norm(scene.gravity)))
        self.warm_start = cold_start()
        self.frames, self.acted, self.removed = 0, 0, 0.0
        self.spheres = Spheres(
            positions=np.array(state.positions),
            quaternions=np.array(state.quaternions),
            velocities=np.array(state.velocities),
            angular_velocities=np.array(state.angular_velocities),
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
        """Advance by several dt; see `Stepper`."""
        if self.frames == 0:
            separate(self.world, self.dt, self.spheres.positions)
        states = Spheres(*(np.empty((steps, *values.shape)) for values in self.spheres))
        done, self.warm_start, acted, removed = _advance(
            world=self.world,
            spheres=self.spheres,
            dt=self.dt,
            warm_start=self.warm_start,
            settings=self.settings,
            guards=self.guards,
            sleeps=self.sleeps,
            sleepers_out=self.sleepers,
            frames_out=states,
        )
        self.frames += done
        self.acted += acted
        self.removed += removed
        if done:
            self.spheres = Spheres(*(values[done - 1].copy() for values in states))
        diverged = done < steps
        return Advance(
            State.unchecked(*(values[:done] for values in states)), _DIVERGED if diverged else ''
        )
