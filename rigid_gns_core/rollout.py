"""Load a learned simulator and roll it out, at any radius and gravity."""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .checkpoint import CheckpointError, Tensors, find_model, load_card, load_weights
from .config import from_mapping
from .scene import Scene
from .similarity import ModelUnits, Similarity
from .state import State, Trajectory


class Stepper(Protocol):
    """Advances a state in the model's units."""

    def step(self) -> State:
        """The state one model step later."""
        ...


class Rollout:
    """A simulation in progress: `state` is now, `step` advances it by `dt` [s].

    `stepper` is the model's own, with what it tells of itself.
    """

    def __init__(self, stepper: Stepper, similarity: Similarity, state: State, dt: float) -> None:
        self.stepper = stepper
        self._similarity = similarity
        self.state = state
        self.dt = dt
        self.steps = 0

    def step(self) -> State:
        """Advance by `dt` and return the new state.

        What its velocities are, `Simulator.velocities` says.

        Raises:
            FloatingPointError: The rollout diverged; `state` is the last finite one.
        """
        state = self._similarity.to_world(self.stepper.step())
        self.state = state
        self.steps += 1
        return state


class Simulator(ABC):
    """A trained model, ready to predict.

    `velocities` says what the velocities of its states are: 'given', those of the instant, or
    'poses', means over the step before (backward differences, thesis section 3.3). `dtype` is that
    of its arithmetic.

    Args:
        tensors: The trained weights, by name.
        card: What is known of the model: configuration, units, recipe, metrics.
        name: Name for messages and reports.
    """

    velocities: ClassVar[Literal['given', 'poses']]
    kind: ClassVar[str]
    dtype: str

    def __init__(self, tensors: Tensors, card: dict[str, Any], name: str) -> None:
        self.tensors = tensors
        self.card = card
        self.name = name
        self.units = from_mapping(ModelUnits, card['units'], f'{name}: units')

    def native_dt(self, scene: Scene) -> float:
        """The model's time step for this radius and gravity [s]: dt sqrt(r / r_m * g_m / g)."""
        return self.units.dt * Similarity.between(scene, self.units).time

    @abstractmethod
    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Refuse a scene that the model cannot serve; warn where it was not trained for it.

        Raises:
            ValueError: The model cannot serve it.
        """

    @abstractmethod
    def stepper(self, scene: Scene, state: State) -> Stepper:
        """A rollout in the model's units."""

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
            ValueError: Shapes are wrong, values not finite, or the model cannot serve the scene.
        """
        return self._begin(scene, positions, velocities, angular_velocities, quaternions)

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
        if steps != int(steps) or steps < 0:
            raise ValueError(f'steps is {steps}, expected a whole number, 0 or more')
        rollout = self._begin(scene, positions, velocities, angular_velocities, quaternions)
        count = len(rollout.state)
        shapes = {'positions': 3, 'quaternions': 4, 'velocities': 3, 'angular_velocities': 3}
        arrays = {name: np.full((steps + 1, count, k), np.nan) for name, k in shapes.items()}
        for step in range(steps + 1):
            if step:
                try:
                    rollout.step()
                except FloatingPointError as error:
                    warnings.warn(f'{error} (step {step} of {steps})', stacklevel=2)
                    break
            for name in shapes:
                arrays[name][step] = getattr(rollout.state, name)
        return Trajectory(dt=rollout.dt, **arrays)

    def _begin(
        self,
        scene: Scene,
        positions: ArrayLike,
        velocities: ArrayLike | None,
        angular_velocities: ArrayLike | None,
        quaternions: ArrayLike | None,
    ) -> Rollout:
        given: dict[str, Any] = {
            'positions': positions,
            'quaternions': quaternions,
            'velocities': velocities,
            'angular_velocities': angular_velocities,
        }
        state = State(**given)
        self.check(scene, len(state), stacklevel=4)  # warnings point at who called start or rollout
        similarity = Similarity.between(scene, self.units)
        stepper = self.stepper(similarity.scene(scene), similarity.to_model(state))
        return Rollout(stepper, similarity, state, self.native_dt(scene))


def load_simulator(
    name_or_path: str | Path | None = None, *, dtype: str | None = None, **options: Any
) -> Simulator:
    """Load a shipped model by name, any model by path, or the shipped default.

    Args:
        name_or_path: None: the default.
        dtype: 'float64' or 'float32', of the arithmetic; None: the model's usual one.
        options: Of the kind of model, such as those of `ContactOptions`.

    Raises:
        CheckpointError: There is no such model, or its files are damaged or of another version.
        ValueError: The model has no such dtype or option.
    """
    from .simulators import KINDS  # here, since they build on this module

    path = find_model(name_or_path)
    card = load_card(path)
    if card['kind'] not in KINDS:
        raise CheckpointError(
            f'{path}: its card is of kind {card["kind"]!r}, known: {", ".join(KINDS)}'
        )
    kind = KINDS[card['kind']]
    known = {field.name for field in fields(kind.config)}
    if missing := sorted(known - set(card['config'])):
        # a default that changes later must not change what old weights mean
        raise CheckpointError(f'{path}: the config in its card lacks {", ".join(missing)}')
    config = from_mapping(kind.config, card['config'], f'{path}: config')
    tensors = load_weights(path, card['weights_sha256'], config.shapes)
    if dtype is not None:
        options['dtype'] = dtype
    return kind.simulator(tensors, card, path.stem, **options)
