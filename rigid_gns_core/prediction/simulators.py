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

"""The kinds of models: what each can serve, and how it is rolled out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple, TYPE_CHECKING, TypeVar
import warnings

import numpy as np
from threadpoolctl import threadpool_limits

from .on_device import known_device, run_on_device
from ..engine.options import known_backend, LawsOptions
from ..files.checkpoint import LAWS, Tensors
from ..files.config import from_mapping
from ..gns.config import GNSConfig
from ..gns.features import Features
from ..gns.stepper import GNSStepper
from ..installation.versions import PACKAGE, version_of
from ..rollout.outcome import Outcome
from ..rollout.rollout import Rollout, Simulator
from ..rollout.stepper import Stepper
from ..scenes.scene import Scene
from ..scenes.similarity import ModelUnits
from ..scenes.state import Array, State

if TYPE_CHECKING:
    from torch.nn import Module

    from ..gns.network import GNS

N = TypeVar('N', bound='Module')


@dataclass(frozen=True)
class Materials:
    """What a model without materials as inputs was trained on; see `Scene`."""

    restitution: float
    friction: float
    rolling_friction: float


class GNSSimulator(Simulator):
    """The thesis' GNS: one radius, one mass, one material.

    Args:
        tensors: The trained weights, by name.
        card: See `Simulator`.
        name: See `Simulator`.
        backend: 'engine' (NumPy), or 'torch', the reference.
        threads: CPU threads.
        device: Where the backend 'torch' keeps all of a rollout, such as 'cuda'; None: networks on
            the CPU, graphs by SciPy.
    """

    kind = 'gns'
    velocities = 'poses'

    def __init__(
        self,
        tensors: Tensors,
        card: dict[str, Any],
        name: str,
        *,
        backend: str = 'engine',
        threads: int = 1,
        device: str | None = None,
    ) -> None:
        super().__init__(card, name, from_mapping(ModelUnits, card['units'], f'{name}: units'))
        self.tensors = tensors
        self.backend, self.threads = known_backend(backend), threads
        self.device = None if device is None else known_device(device, backend)
        self.config = from_mapping(GNSConfig, card['config'], f'{name}: config')
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
        """Return a rollout in the model's units."""
        if self.device is not None:
            import torch

            from ..gns.device_stepper import DeviceStepper

            torch.set_num_threads(self.threads)
            return DeviceStepper(self.network, [scene], [state], self.units.dt, self.device)
        return GNSStepper(self._predict, self.config, scene, state, self.units.dt)

    def _run(self, rollouts: Sequence[Rollout], steps: int, workers: int) -> list[Outcome]:
        if self.device is not None:
            return run_on_device(rollouts, steps)
        if self.backend == 'torch' or workers == 1:
            return super()._run(rollouts, steps, 1)
        # a limit of BLAS is one of the process: what each worker sets and lifts in every step
        # would be lifted under the feet of the others
        with threadpool_limits(self.threads, user_api='blas'):
            return super()._run(rollouts, steps, workers)

    @cached_property
    def network(self) -> GNS:
        """The network as a torch module, for the backend 'torch'."""
        from ..gns.network import GNS

        return _filled(GNS(self.config), self.tensors)

    @cached_property
    def _predict(self) -> Callable[[Features], Array]:
        if self.backend == 'torch':
            import torch

            torch.set_num_threads(self.threads)
            return self.network.predict
        from ..gns.numpy_network import GNSEngine

        return GNSEngine(self.tensors, self.config, self.threads)


class LawsSimulator(Simulator):
    """The laws of rigid contact: any radii, masses and materials.

    Args:
        options: See `LawsOptions`.

    Raises:
        ValueError: There is no such option, or its value is out of range.
    """

    kind = 'laws'
    velocities = 'given'

    def __init__(self, **options: Any) -> None:
        self.options = from_mapping(LawsOptions, options, 'options of the laws')
        card = {
            'kind': self.kind,
            'options': asdict(self.options),
            'version': version_of(PACKAGE) or 'unknown',  # a source tree that is not installed
        }
        # a frame of 0.1 s for spheres of 1 m, as the thesis has
        super().__init__(card, LAWS, ModelUnits(radius=1.0, gravity=9.81, dt=0.1))

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Nothing: the laws hold for all scenes."""

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """Return a rollout in the model's units."""
        from ..engine.stepper import EngineStepper

        return EngineStepper(scene, state, self.units.dt, **asdict(self.options))


class Kind(NamedTuple):
    """Classes of a kind of trained model."""

    config: type[GNSConfig]
    simulator: type[GNSSimulator]


KINDS = {'gns': Kind(GNSConfig, GNSSimulator)}


def _filled(network: N, tensors: Tensors) -> N:
    """Return the network with these weights."""
    import torch

    network.load_state_dict({name: torch.from_numpy(value) for name, value in tensors.items()})
    return network.eval()


def _values(scene: Scene, name: str, count: int) -> Array:
    values = scene.per_sphere(name, count)
    if name == 'rolling_friction':
        return values
    return np.concatenate([values, scene.surface_values(name)])
