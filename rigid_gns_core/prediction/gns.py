# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The thesis' GNS as a simulator: what it can serve, and where it runs. It needs torch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TYPE_CHECKING
import warnings

import numpy as np

from ..errors import UserError
from ..files.checkpoint import CheckpointError, Tensors
from ..files.config import from_mapping
from ..gns.config import GNSConfig
from ..installation.extras import needed
from ..rollout.outcome import Outcome
from ..rollout.rollout import Rollout
from ..rollout.simulator import Simulator
from ..rollout.stepper import Stepper
from ..scenes.plane import SOLID
from ..scenes.scene import Scene
from ..scenes.similarity import ModelUnits
from ..scenes.state import Array, State

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True)
class Materials:
    """Materials that a model was trained on, where they are no inputs of it; see `Scene`."""

    restitution: float
    friction: float
    rolling_friction: float


class GNSSimulator(Simulator):
    """The thesis' GNS: one radius, one mass, one material.

    Args:
        tensors: The trained weights, by name.
        card: See `Simulator`.
        name: See `Simulator`.
        threads: CPU threads.
        device: Where features and network are, as torch names it: 'cpu', 'cuda', 'cuda:1', ...
            Graphs are built on the CPU in any case.

    Raises:
        ModuleNotFoundError: torch is not installed; the message tells how to get it.
        UserError: There is no such device.
        CheckpointError: The weights are those of another network.
    """

    kind = 'gns'
    velocities = 'poses'

    def __init__(
        self,
        tensors: Tensors,
        card: dict[str, Any],
        name: str,
        *,
        threads: int = 1,
        device: str = 'cpu',
    ) -> None:
        super().__init__(card, name, from_mapping(ModelUnits, card['units'], f'{name}: units'))
        torch = needed('torch', f'model {name!r}')
        from ..gns.network import GNS

        self.tensors, self.threads = tensors, threads
        self.device = known_device(device)
        self.config = from_mapping(GNSConfig, card['config'], f'{name}: config')
        self.materials = from_mapping(Materials, card['materials'], f'{name}: materials')
        self.network = GNS(self.config)
        weights = {key: torch.from_numpy(value) for key, value in tensors.items()}
        try:
            self.network.load_state_dict(weights)
        except RuntimeError as error:
            raise CheckpointError(
                f'{name}: weights and card do not belong together: {error}'
            ) from error
        self.network.eval().to(self.device)

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Refuse unequal spheres and a scene without gravity; warn of other materials."""
        if not any(scene.gravity):
            raise UserError('gravity is 0, but the model was trained with gravity; set it')
        for name in ('radius', 'mass'):
            values = scene.per_sphere(name, count)
            if count and np.ptp(values) > 1e-9 * values.max():
                raise UserError(
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

        laws = [scene.sphere_contact, *(surface.contact for surface in scene.surfaces)]
        solid = not np.any(scene.per_sphere('inertia_factor', count) - SOLID)
        unknown = {
            'air': scene.air,
            'a contact law': any(laws),
            'hollow spheres': not solid,
            'surfaces that move': any(surface.moves for surface in scene.surfaces),
            'obstacles': scene.obstacles,
        }
        for what, given in unknown.items():
            if given:
                warnings.warn(
                    f'the scene has {what}, but model {self.name!r} was trained without and will '
                    'behave like that',
                    stacklevel=stacklevel,
                )

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """Stepper that starts from `state`; scene and state are in the model's units."""
        from ..gns.stepper import GNSStepper

        return GNSStepper(self.network, scene, state, self.units.dt, threads=self.threads)

    def _run(self, rollouts: Sequence[Rollout], steps: int, workers: int) -> list[Outcome]:
        from ..gns.stepper import torch_threads

        # once for the process: workers that set and reset it in every step would reset it while
        # others compute
        with torch_threads(self.threads):
            return super()._run(rollouts, steps, workers)


def _values(scene: Scene, name: str, count: int) -> Array:
    """Material property of all spheres, and of all surfaces where they have it."""
    values = scene.per_sphere(name, count)
    if name == 'rolling_friction':
        return values
    return np.concatenate([values, scene.surface_values(name)])


def known_device(name: str) -> torch.device:
    """Device of torch of this name.

    Raises:
        UserError: There is no such device, or it has no float64.
    """
    import torch

    try:
        device = torch.device(name)
    except RuntimeError as error:
        raise UserError(f"device is {name!r}, allowed: 'cpu', 'cuda', 'cuda:0', ...") from error
    if device.type not in ('cpu', 'cuda'):
        # poses are float64, which mps for instance does not have
        raise UserError(f"device is {name!r}, allowed: 'cpu', 'cuda', 'cuda:0', ...")
    present = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if device.type == 'cuda' and (device.index or 0) >= present:
        raise UserError(
            f'device is {name!r}, but torch {torch.__version__} finds {present} CUDA devices '
            'here; leave device out to run on the CPU'
        )
    return device
