"""Load a learned simulator and roll it out, at any radius and gravity."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .checkpoint import CheckpointError, find_model, load_card, load_weights
from .config import from_mapping
from .models.gns import GNS, GNSConfig
from .models.stepping import GNSStepper
from .scene import Scene
from .similarity import ModelUnits, Similarity
from .state import State, Trajectory


class Stepper(Protocol):
    """Advances a state in the model's units."""

    def step(self) -> State:
        """The state one model step later."""
        ...


@dataclass(frozen=True)
class Materials:
    """What a model without materials as inputs was trained on; see `Scene`."""

    restitution: float
    friction: float
    rolling_friction: float


class Rollout:
    """A simulation in progress: `state` is now, `step` advances it by `dt` [s]."""

    def __init__(self, stepper: Stepper, similarity: Similarity, state: State, dt: float) -> None:
        self._stepper = stepper
        self._similarity = similarity
        self.state = state
        self.dt = dt
        self.steps = 0

    def step(self) -> State:
        """Advance by `dt` and return the new state.

        Velocities of the state are means over the step (backward differences, thesis section 3.3).

        Raises:
            FloatingPointError: The rollout diverged; `state` is the last finite one.
        """
        state = self._similarity.to_world(self._stepper.step())
        self.state = state
        self.steps += 1
        return state


class Simulator:
    """A trained model, ready to predict.

    Args:
        network: The trained network.
        card: What is known of it: configuration, units, recipe, metrics.
        name: Name for messages and reports.
    """

    def __init__(self, network: GNS, card: dict[str, Any], name: str) -> None:
        self.network = network.eval()
        self.card = card
        self.name = name
        self.units = from_mapping(ModelUnits, card['units'], f'{name}: units')
        self.materials = from_mapping(Materials, card['materials'], f'{name}: materials')

    @property
    def history(self) -> int:
        """H, the number of previous velocities the model uses."""
        return self.network.config.history

    def native_dt(self, scene: Scene) -> float:
        """The model's time step for this radius and gravity [s]: dt sqrt(r / r_m * g_m / g)."""
        return self.units.dt * Similarity.between(scene, self.units).time

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Refuse a scene that the model cannot serve; warn where it was not trained for it.

        Raises:
            ValueError: Radii or masses differ, a property has the wrong length, or no gravity.
        """
        for name in ('radius', 'mass'):
            values = scene.per_sphere(name, count)
            if count and np.ptp(values) > 1e-9 * values.max():
                raise ValueError(
                    f'{name} differs between spheres ({values.min():g} to {values.max():g}), '
                    f'but model {self.name!r} knows spheres of one {name} only'
                )
        Similarity.between(scene, self.units)
        for name, trained in vars(self.materials).items():
            values = scene.per_sphere(name, count)
            if name != 'rolling_friction':
                values = np.concatenate([values, scene.surface_values(name)])
            low, high = values.min(initial=np.inf), values.max(initial=-np.inf)
            if max(trained - low, high - trained) > 1e-3:
                what = f'{low:g}' if low == high else f'{low:g} to {high:g}'
                warnings.warn(
                    f'{name} of the scene is {what}, but model {self.name!r} was trained at '
                    f'{trained:g} and will behave like that',
                    stacklevel=stacklevel,
                )

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
            velocities: Velocities now, not means over a step as `Trajectory.velocities` of a
                rollout are [m/s], shape (n, 3). None: at rest.
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
        stepper = GNSStepper(
            self.network, similarity.scene(scene), similarity.to_model(state), self.units.dt
        )
        return Rollout(stepper, similarity, state, self.native_dt(scene))


def load_simulator(name_or_path: str | Path | None = None) -> Simulator:
    """Load a shipped model by name, any model by path, or the shipped default.

    Raises:
        CheckpointError: There is no such model, or its files are damaged or of another version.
    """
    path = find_model(name_or_path)
    card = load_card(path)
    if card['kind'] != 'gns':
        raise CheckpointError(f'{path}: its card is of kind {card["kind"]!r}, known: gns')
    known = {field.name for field in fields(GNSConfig)}
    if missing := sorted(known - set(card['config'])):
        # a default that changes later must not change what old weights mean
        raise CheckpointError(f'{path}: the config in its card lacks {", ".join(missing)}')
    network = GNS(from_mapping(GNSConfig, card['config'], f'{path}: config'))
    load_weights(network, path, card['weights_sha256'])
    return Simulator(network, card, path.stem)
