"""The kinds of models: what each can serve, and how it is rolled out."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np
import torch

from .config import from_mapping
from .models.contact.network import ContactConfig, ContactNetwork
from .models.contact.stepper import ContactStepper
from .models.gns import GNS, GNSConfig
from .models.stepping import GNSStepper
from .rollout import Simulator, Stepper
from .scene import Scene
from .state import Array, State


@dataclass(frozen=True)
class Materials:
    """What a model without materials as inputs was trained on; see `Scene`."""

    restitution: float
    friction: float
    rolling_friction: float


class GNSSimulator(Simulator):
    """The thesis' GNS: one radius, one mass, one material.

    Args:
        network: The trained network.
        card: See `Simulator`.
        name: See `Simulator`.
        dtype: 'float32', the only one.
    """

    kind = 'gns'
    velocities = 'poses'

    def __init__(
        self, network: GNS, card: dict[str, Any], name: str, *, dtype: str = 'float32'
    ) -> None:
        super().__init__(card, name)
        if dtype != 'float32':
            raise ValueError(f'dtype is {dtype!r}, but model {name!r} (a GNS) knows float32 only')
        self.dtype = dtype
        self.network = network.eval()
        self.materials = from_mapping(Materials, card['materials'], f'{name}: materials')

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Refuse unlike spheres and no gravity; warn of other materials."""
        if not any(scene.gravity):
            raise ValueError('gravity is 0, but the model was trained with gravity; set it')
        for name in ('radius', 'mass'):
            values = scene.per_sphere(name, count)
            if count and np.ptp(values) > 1e-9 * values.max():
                raise ValueError(
                    f'{name} differs between spheres ({values.min():g} to {values.max():g}), '
                    f'but model {self.name!r} knows spheres of one {name} only'
                )
        for name, trained in vars(self.materials).items():
            values = _values(scene, name, count)
            low, high = values.min(initial=np.inf), values.max(initial=-np.inf)
            if max(trained - low, high - trained) > 1e-3:
                what = f'{low:g}' if low == high else f'{low:g} to {high:g}'
                warnings.warn(
                    f'{name} of the scene is {what}, but model {self.name!r} was trained at '
                    f'{trained:g} and will behave like that',
                    stacklevel=stacklevel,
                )

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """A rollout in the model's units."""
        return GNSStepper(self.network, scene, state, self.units.dt)


@dataclass(frozen=True)
class ContactOptions:
    """What a user may change of a contact model; for measurements rather than for use.

    Args:
        dtype: 'float64' or 'float32', of the arithmetic of contacts; states are kept in float64.
        guard: Hold the energy of every island down.
        sleep: Let islands at rest sleep.
        network: Use the network; False: the law of isolated contacts alone.
        substeps: K instead of the trained one.
        rounds: M instead of the trained one, for the law alone.
    """

    dtype: str = 'float64'
    guard: bool = True
    sleep: bool = True
    network: bool = True
    substeps: int | None = None
    rounds: int | None = None

    def __post_init__(self) -> None:
        if self.dtype not in ('float32', 'float64'):
            raise ValueError(f"dtype is {self.dtype!r}, allowed: 'float32', 'float64'")
        for name in ('substeps', 'rounds'):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f'{name} is {value}, expected at least 1')
        if self.rounds is not None and self.network:
            raise ValueError('rounds can be changed only with network=False: each has its weights')


class ContactSimulator(Simulator):
    """The contact-frame graph network: any radii, masses and materials.

    Args:
        network: The trained network.
        card: See `Simulator`.
        name: See `Simulator`.
        options: See `ContactOptions`.
    """

    kind = 'contact'
    velocities = 'given'

    def __init__(
        self, network: ContactNetwork, card: dict[str, Any], name: str, /, **options: Any
    ) -> None:
        super().__init__(card, name)
        if unknown := sorted(set(options) - {field.name for field in fields(ContactOptions)}):
            allowed = ', '.join(field.name for field in fields(ContactOptions))
            raise ValueError(f'model {name!r} has no option {unknown[0]!r}, allowed: {allowed}')
        self.options = ContactOptions(**options)
        self.dtype = self.options.dtype
        self.network = network.eval()
        self.ranges: dict[str, tuple[float, float]] = {
            key: (float(low), float(high)) for key, (low, high) in card['materials'].items()
        }

    @property
    def config(self) -> ContactConfig:
        """K, M and what else the options leave of the network's configuration."""
        trained = self.network.config
        options = self.options
        return replace(
            trained,
            substeps=options.substeps or trained.substeps,
            rounds=options.rounds or trained.rounds,
            network=options.network,
        )

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Warn of properties far from what the network has seen; the law holds for all."""
        if not count:
            return
        values = {name: _values(scene, name, count) for name in ('restitution', 'friction')}
        for name in ('radius', 'mass'):
            own = scene.per_sphere(name, count)
            values[f'{name}_ratio'] = own.max() / own
        for name, (low, high) in self.ranges.items():
            seen = values.get(name)
            if seen is not None and (seen.min() < low - 0.01 or seen.max() > high + 0.01):
                warnings.warn(
                    f'{name} of the scene is {seen.min():.4g} to {seen.max():.4g}, beyond the '
                    f'{low:g} to {high:g} that model {self.name!r} was trained on',
                    stacklevel=stacklevel,
                )

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """A rollout in the model's units."""
        options = self.options
        return ContactStepper(
            self.network if options.network else None,
            self.config,
            scene,
            state,
            self.units.dt,
            guard=options.guard,
            sleep=options.sleep,
            dtype=getattr(torch, options.dtype),
        )


class Kind(NamedTuple):
    """Classes of a kind of model."""

    config: type
    network: Any
    simulator: Any


KINDS = {
    'gns': Kind(GNSConfig, GNS, GNSSimulator),
    'contact': Kind(ContactConfig, ContactNetwork, ContactSimulator),
}


def _values(scene: Scene, name: str, count: int) -> Array:
    values = scene.per_sphere(name, count)
    if name == 'rolling_friction':
        return values
    return np.concatenate([values, scene.surface_values(name)])
