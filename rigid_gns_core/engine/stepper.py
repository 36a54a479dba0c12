# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rolls the laws out in the model's units: frame, energy guard, sleep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .frames import advance_frames, FEW
from .motion import Settings
from .plane_motion import set_clock
from .planned_planes import with_plans
from .samples import advance_samples
from .separation import separate
from .sleep import all_awake, Sleepers, wake_all
from .spheres import part_of, Spheres
from .warm_start import cold_start, WarmStart
from .world import still_world, World, world_of
from ..kernels.jit import compiling, entry, is_compiled
from ..kernels.neighbours import Indices
from ..rollout.crossing import first_passages
from ..rollout.forecast import spread_of
from ..rollout.paths import Paths
from ..rollout.stepper import Advance, state_at, Stepper
from ..rollout.touches import touches_of
from ..running.memory import keep_freed_memory
from ..scenes.scene import Plane, Scene
from ..scenes.state import State

# with so many spheres, the scratch of a frame is more than the C library keeps by itself
_LARGE = 2000
_DIVERGED = 'the rollout diverged: a predicted value is not finite'


@entry
def _advance(
    world: World,
    starts: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    is_start: bool,
    first: int,
    sleepers_out: Sleepers,
    frames_out: Spheres,
    done_out: Indices,
) -> tuple[WarmStart, int, float]:
    """Frames of one state or of many starts, shapes (s, n, k), in one call.

    A call of compiled code costs a fifth of a frame, and each entry as much time to compile as
    the whole engine.

    Args:
        world: What does not move.
        starts: The states.
        dt: Length of a frame.
        warm_start: Impulses of the last frame.
        settings: Substeps and iterations.
        guards: Limit the energy.
        sleeps: Let islands sleep.
        is_start: Whether nothing has moved yet: overlaps are undone in `starts`, no impulses are
            known, and all are awake.
        first: First frame to write: 1, and a start, where that before it has the starts.
        sleepers_out: Who sleeps.
        frames_out: Frames, shapes (s, frames, n, k).
        done_out: Number of finite frames of each, with those before the first, shape (s,).

    Returns:
        Warm start of the next frame, how many islands the guard limited, and the energy it took.
    """
    acted, removed = 0, 0.0
    fixed = not (world.moving or world.has_solids)
    if first == 1 and fixed and 0 < len(world.restitution) <= FEW:
        acted, removed = advance_samples(
            world, dt, settings, guards, sleeps, sleepers_out, frames_out, done_out
        )
        return warm_start, acted, removed
    for k in range(len(done_out)):
        if is_start:
            wake_all(sleepers_out)
            set_clock(world, 0.0)
            separate(world, dt, starts.positions[k])
            warm_start = cold_start()
        done_out[k], _, warm_start, held, taken = advance_frames(
            world=world,
            spheres=part_of(starts, k),
            dt=dt,
            warm_start=warm_start,
            settings=settings,
            guards=guards,
            sleeps=sleeps,
            until_flight=False,
            first=first,
            sleepers_out=sleepers_out,
            frames_out=part_of(frames_out, k),
        )
        acted += held
        removed += taken
    return warm_start, acted, removed


def warm_up() -> None:
    """Compile what is not compiled yet, or read it from the disk, before it is needed."""
    scene = Scene(surfaces=(Plane(),))
    start = State(positions=np.array([[0.0, 0.0, 1.2], [0.0, 0.5, 3.0]]))
    with compiling():
        EngineStepper(scene, start, 0.1, substeps=1, rounds=1).step()
        _read_paths(scene, start)


def _read_paths(scene: Scene, start: State) -> None:
    """The same of what reads the paths of rollouts, with a blow."""
    states = State.unchecked(*(np.stack([[field, field]]) for field in vars(start).values()))
    states.velocities[:, 1, :, 2] = 10.0
    paths = Paths.of(scene, states, 0.1, exact=True)
    paths.at(np.array([0.05]))
    first_passages(paths, 0, scene.surfaces[0], 0.1)
    touches_of(paths, scene, 0)
    spread_of(states.positions)


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
        world: See `still_world`; None: one is made.
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
        world: World | None = None,
    ) -> None:
        if not is_compiled():
            warm_up()
        if len(state) >= _LARGE:
            keep_freed_memory()
        self.settings, self.dt = Settings(substeps=substeps, iterations=rounds), dt
        if world is None:
            world = world_of(scene, len(state), dt / substeps)
        self.world, self.planes = world, scene.surfaces
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
        states = Spheres(*(np.empty((steps, *values.shape)) for values in self.spheres))
        frame = self.settings.substeps
        self.world = with_plans(
            self.world, self.planes, first=frame * self.frames, substeps=frame * steps, frame=frame
        )
        done, self.warm_start, acted, removed = self._advance(states)
        self.frames += done
        self.acted += acted
        self.removed += removed
        if done:
            self.spheres = Spheres(*(values[done - 1].copy() for values in states))
        diverged = done < steps
        return Advance(
            State.unchecked(*(values[:done] for values in states)), _DIVERGED if diverged else ''
        )

    def _advance(self, frames_out: Spheres) -> tuple[int, WarmStart, int, float]:
        """Write frames; returns as `advance_frames`."""
        done = np.zeros(1, np.int64)
        warm_start, acted, removed = _advance(
            world=self.world,
            starts=_as_one(self.spheres),
            dt=self.dt,
            warm_start=self.warm_start,
            settings=self.settings,
            guards=self.guards,
            sleeps=self.sleeps,
            is_start=self.frames == 0,
            first=0,
            sleepers_out=self.sleepers,
            frames_out=_as_one(frames_out),
            done_out=done,
        )
        return int(done[0]), warm_start, acted, removed


def _as_one(spheres: Spheres) -> Spheres:
    """View with an axis of one start before the others."""
    return Spheres(*(values[None] for values in spheres))


def advance_starts(
    scene: Scene,
    starts: State,
    dt: float,
    *,
    substeps: int,
    rounds: int,
    guard: bool = True,
    sleep: bool = True,
    frames_out: State,
) -> NDArray[np.int64]:
    """Roll many starts of one scene out, each to the bit as an `EngineStepper` would.

    One call of compiled code, since a stepper of its own costs more than a second of one sphere.

    Args:
        scene: Surfaces and sphere properties.
        starts: Fields of shape (s, n, k).
        dt: Length of a frame.
        substeps: See `EngineStepper`, as of the next three.
        rounds: See there.
        guard: See there.
        sleep: See there.
        frames_out: Starts and states after each frame, fields of shape (s, steps + 1, n, k).

    Returns:
        How many of each are finite, shape (s,): those after them, and the starts, are undefined.
    """
    if not is_compiled():
        warm_up()
    count, spheres = np.shape(starts.positions)[:2]
    begin = Spheres(
        positions=np.array(starts.positions),
        quaternions=np.array(starts.quaternions),
        velocities=np.array(starts.velocities),
        angular_velocities=np.array(starts.angular_velocities),
    )
    frames = Spheres(**vars(frames_out))
    world = still_world(scene, spheres) or world_of(scene, spheres, dt / substeps)
    count_of = substeps * (frames_out.positions.shape[1] - 1)
    world = with_plans(world, scene.surfaces, first=0, substeps=count_of, frame=substeps)
    for values, part in zip(frames, begin, strict=True):
        values[:, 0] = part
    done = np.ones(count, np.int64)
    _advance(
        world=world,
        starts=begin,
        dt=dt,
        warm_start=cold_start(),
        settings=Settings(substeps=substeps, iterations=rounds),
        guards=guard,
        sleeps=sleep and not world.moving,
        is_start=True,
        first=1,
        sleepers_out=all_awake(world.radius[:-1], float(np.linalg.norm(scene.gravity))),
        frames_out=frames,
        done_out=done,
    )
    return done
