# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The interface of all models: rollouts from a start, at any radius and gravity."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar, Literal
import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .forecast import checked_times, drawn_starts, Estimate, Forecast, forecast_of
from .outcome import Outcome
from .paths import Paths
from .rollout import Rollout, steps_of
from .stepper import state_at, Stepper
from ..errors import shown, UserError
from ..running.threads import in_threads, usable_cores
from ..scenes.scene import checked_scene, Scene
from ..scenes.similarity import in_units, ModelUnits
from ..scenes.state import Array, State, Trajectory
from ..scenes.values import checked_whole

# steps of a rollout: beyond, arrays have more bytes than can be counted
_MOST = 10**12


class Simulator(ABC):
    """A model, ready to predict.

    `velocities` says what the velocities of its states are: 'given', those of the instant, or
    'poses', means over the step before (backward differences, thesis section 3.3).

    Args:
        card: Description of the model, of types that JSON knows.
        name: Name for messages and reports.
        units: Radius, gravity and time step that it is made for.
    """

    velocities: ClassVar[Literal['given', 'poses']]
    kind: ClassVar[str]

    def __init__(self, card: dict[str, Any], name: str, units: ModelUnits) -> None:
        self.card, self.name, self.units = card, name, units

    def native_dt(self, scene: Scene) -> float:
        """Time step [s] at the scene's radius and gravity: dt sqrt(r / r_m * g_m / g)."""
        return self.units.dt * in_units(scene, self.units)[0].time

    @abstractmethod
    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Refuse a scene that the model cannot serve; warn where it was not trained for it.

        Raises:
            UserError: The model cannot serve it.
        """

    @abstractmethod
    def stepper(self, scene: Scene, state: State) -> Stepper:
        """Stepper that starts from `state`; scene and state are in the model's units."""

    def steppers(self, scene: Scene, count: int) -> Callable[[State], Stepper]:  # noqa: ARG002
        """What makes steppers of `count` spheres in a scene, in the model's units."""
        return lambda state: self.stepper(scene, state)

    def warm_up(self) -> None:  # noqa: B027 - most models have nothing to compile
        """Compile what the first step would, where that is not done: before times are measured."""

    def start(
        self,
        scene: Scene,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        angular_velocities: ArrayLike | None = None,
        *,
        quaternions: ArrayLike | None = None,
    ) -> Rollout:
        """Begin a simulation that is advanced step by step.

        Args:
            scene: Surfaces, radius, materials and gravity.
            positions: Centres [m], world frame, shape (n, 3).
            velocities: Velocities of the instant, whatever `Simulator.velocities` says of those
                that come out [m/s], shape (n, 3). None: at rest.
            angular_velocities: [rad/s], world frame, shape (n, 3). None: no spin.
            quaternions: Rotations (x, y, z, w), shape (n, 4). None: identity.

        Raises:
            UserError: Shapes are wrong, values not finite, or the model cannot serve the scene.
        """
        return self._begin(scene, positions, velocities, angular_velocities, quaternions)

    def starter(
        self, scene: Scene, count: int, *, stacklevel: int = 3
    ) -> Callable[[State], Rollout]:
        """What begins simulations of `count` spheres in a scene, for callers that begin many.

        Args:
            scene: As of `start`.
            count: Number of spheres.
            stacklevel: Of warnings.

        Raises:
            UserError: The model cannot serve the scene.
        """
        self.check(checked_scene(scene), count, stacklevel=stacklevel)
        similarity, similar = in_units(scene, self.units)
        begin, dt = self.steppers(similar, count), self.native_dt(scene)
        return lambda state: Rollout(begin(similarity.to_model(state)), similarity, state, dt)

    def rollout(
        self,
        scene: Scene,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        angular_velocities: ArrayLike | None = None,
        steps: int = 300,
        *,
        quaternions: ArrayLike | None = None,
    ) -> Trajectory:
        """Predict `steps` steps of `native_dt(scene)` from a start; arguments as in `start`.

        A rollout that diverges is filled with NaN from there on and a warning says when;
        `Trajectory.diverged_at` tells it too.
        """
        rollout = self._begin(scene, positions, velocities, angular_velocities, quaternions)
        (outcome,) = self._run([rollout], _checked(steps), 1)
        if outcome.error:
            warnings.warn(outcome.error, stacklevel=2)
        return outcome.trajectory

    def rollout_batch(
        self,
        scenes: Scene | Sequence[Scene],
        starts: Sequence[State | ArrayLike] | NDArray[Any],
        steps: int = 300,
        *,
        workers: int | None = None,
        done: Callable[[int], object] | None = None,
    ) -> list[Trajectory]:
        """Predict many starts, what-ifs of one scene or scenes of their own, on several cores.

        Each trajectory is bit for bit that of `rollout`, whatever the number of workers, and one
        that diverges does not affect the others; warnings and errors name the index of its start.
        Workers are threads, since compiled code and torch run in parallel to other threads.

        Args:
            scenes: One for all starts, or one per start.
            starts: States, or centres [m] of spheres at rest: shape (b, n, 3), or b arrays of
                shape (n, 3), where n may differ.
            steps: Steps of `native_dt` of each scene.
            workers: Threads; None: one per usable core.
            done: Called with each number of steps that a start has taken, in its thread.

        Raises:
            UserError: A start is wrong, or the model cannot serve its scene; before any runs.
        """
        if workers is not None:
            workers = checked_whole('workers', workers, 1)
        steps, rollouts = _checked(steps), []
        for index, (scene, start) in enumerate(_paired(scenes, starts)):
            values = vars(start) if isinstance(start, State) else {'positions': start}
            try:
                rollouts.append(self._begin(scene, **values))
            except UserError as error:
                raise UserError(f'start {index}: {error}') from error
            rollouts[-1].done = done
        outcomes = self._run(rollouts, steps, workers or usable_cores())
        for index, outcome in enumerate(outcomes):
            if outcome.error:
                warnings.warn(f'start {index}: {outcome.error}', stacklevel=2)
        return [outcome.trajectory for outcome in outcomes]

    def forecast(
        self,
        scene: Scene,
        estimate: State | Estimate,
        lead_times: ArrayLike,
        samples: int = 64,
        seed: int = 0,
    ) -> Forecast:
        """Forecast from an estimate, with what its covariance and the laws leave open.

        Each sample is a rollout from a state drawn from the estimate's normal distribution. Where
        the scene has a learned tracker, a random motion of the size that the laws leave open, as
        fitted to tracks that were left out, is added to each.

        Args:
            scene: Surfaces, spheres, gravity and air.
            estimate: Of `tracking.estimate_state`, or a State: then there is no spread.
            lead_times: Times after it [s], from 0 on and rising, shape (k,).
            samples: Number of states drawn; 0: none.
            seed: Of the draws: the same seed, the same bytes.

        Raises:
            UserError: A time or a number is wrong, or the model cannot serve the scene.
        """
        times, seed = checked_times(lead_times), checked_whole('seed', seed, 0)
        samples = checked_whole('samples', samples, 0)
        starts = drawn_starts(estimate, samples, seed)
        dt = self.native_dt(checked_scene(scene))
        steps = _checked(max(steps_of(float(times[-1]), dt), 1))
        states = self.rollout_samples(scene, starts, steps)
        return self.forecast_from(states, scene, estimate, times, samples, seed)

    def forecast_from(
        self,
        states: State,
        scene: Scene,
        estimate: State | Estimate,
        times: Array,
        samples: int,
        seed: int,
    ) -> Forecast:
        """Forecast from the `rollout_samples` of `drawn_starts`; the rest is as of `forecast`."""
        dt, exact = self.native_dt(scene), self.velocities == 'given'
        paths = Paths.of(scene, states, dt, exact=exact)
        return forecast_of(scene, estimate, paths, times, samples, seed)

    def rollout_samples(
        self, scene: Scene, starts: State, steps: int, *, workers: int | None = None
    ) -> State:
        """Predict many starts of one scene: as `rollout_batch`, in arrays instead of a list.

        Args:
            scene: One for all starts.
            starts: States that are known to be valid, fields of shape (s, n, k).
            steps: Steps of `native_dt`.
            workers: Most threads; None: one per usable core, where that pays.

        Returns:
            Fields of shape (s, steps + 1, n, k), NaN from where a rollout diverged.
        """
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # of a divergence, which is NaN here
            runs = self.rollout_batch(
                scene,
                [state_at(starts, index) for index in range(len(starts.positions))],
                steps,
                workers=workers or 1,
            )
        names = ('positions', 'quaternions', 'velocities', 'angular_velocities')
        return State.unchecked(*(np.stack([getattr(run, name) for run in runs]) for name in names))

    def _run(self, rollouts: Sequence[Rollout], steps: int, workers: int) -> list[Outcome]:
        """Outcomes of rollouts that have just begun."""
        return in_threads(lambda rollout: rollout.run(steps), rollouts, workers)

    def _begin(
        self,
        scene: Scene,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        angular_velocities: ArrayLike | None = None,
        quaternions: ArrayLike | None = None,
    ) -> Rollout:
        values: dict[str, Any] = {
            'positions': positions,
            'quaternions': quaternions,
            'velocities': velocities,
            'angular_velocities': angular_velocities,
        }
        state = State(**values)
        # warnings point at the caller of the public method
        return self.starter(scene, len(state), stacklevel=5)(state)


def _checked(steps: int) -> int:
    return checked_whole('steps', steps, 0, _MOST)


def _paired(
    scenes: Scene | Sequence[Scene], starts: Sequence[State | ArrayLike] | NDArray[Any]
) -> Iterator[tuple[Scene, State | ArrayLike]]:
    """Each start with its scene; one scene serves all.

    Raises:
        UserError: There are not as many scenes as starts.
    """
    if isinstance(starts, State):
        raise UserError('starts is one State, expected several; use rollout for one')
    if not np.iterable(starts):
        raise UserError(f'starts is {shown(starts)}, expected several states')
    if isinstance(scenes, Scene):
        scenes = [scenes] * len(starts)
    if not isinstance(scenes, Sequence) or isinstance(scenes, str):
        raise UserError(f'scenes is {shown(scenes)}, expected Scene(...), or one per start')
    if len(scenes) != len(starts):
        raise UserError(
            f'there are {len(scenes)} scenes for {len(starts)} starts; give one scene for all, or '
            'one per start'
        )
    return zip(scenes, starts, strict=True)
