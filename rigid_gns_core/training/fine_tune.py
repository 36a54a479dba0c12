# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns train --from MODEL`: training that starts from the weights of a checkpoint.

The normalisers of features and targets are part of the weights and stay as they are, so the
records are brought to the units that the checkpoint was trained in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TYPE_CHECKING

import numpy as np

from ..data.records import Record
from ..errors import UserError
from ..files.checkpoint import CheckpointError, find_model, Tensors
from ..files.config import to_mapping
from ..prediction.gns import GNSSimulator
from ..prediction.load import load_simulator
from ..scenes.similarity import ModelUnits, Similarity
from ..scenes.state import Trajectory

if TYPE_CHECKING:
    from .learner import Learner

# relative difference up to which time steps count as equal
_SAME_STEP = 1e-3


@dataclass(frozen=True)
class StartingPoint:
    """A checkpoint to start from.

    Args:
        name: Name of the model, for the card of the trained one.
        kind: Kind of the model.
        config: Configuration of its network.
        units: Radius, gravity and time step that it was trained with.
        tensors: Its weights, with normalisers.
    """

    name: str
    kind: str
    config: dict[str, Any]
    units: ModelUnits
    tensors: Tensors

    @classmethod
    def of(cls, name: str | Path) -> StartingPoint:
        """Starting point from a shipped model by name, or from any by path.

        Raises:
            CheckpointError: There is no such model, its files are damaged, or it has no weights.
        """
        simulator = load_simulator(name)
        if not isinstance(simulator, GNSSimulator):
            raise CheckpointError(
                f'model {simulator.name!r} has no weights to start from; fit '
                'materials instead: rigid-gns calibrate'
            )
        return cls(
            f'{find_model(name).stem} {simulator.card["weights_sha256"][:12]}',
            simulator.kind,
            dict(simulator.card['config']),
            simulator.units,
            simulator.tensors,
        )

    def records(self, records: Sequence[Record]) -> list[Record]:
        """Records in the checkpoint's units; tracked ones from frame 1 on.

        Raises:
            UserError: A record's time step is not that of the model for its radius and gravity,
                or it was tracked and has one step.
        """
        return [self._record(record) for record in records]

    def load(self, learner: Learner[Any]) -> None:
        """Put the weights into a learner, unless it has trained already, as in a resumed run.

        Raises:
            CheckpointError: The recipe's network is another one.
        """
        if learner.step:
            return
        import torch

        asked = to_mapping(learner.model)
        differing = [key for key in asked if asked[key] != self.config.get(key)]
        if learner.kind != self.kind or differing:
            what = ', '.join(differing) if learner.kind == self.kind else 'kind'
            raise CheckpointError(
                f'model {self.name} ({self.kind}) differs from the recipe ({learner.kind}) in '
                f'{what}; take a recipe with its model, as config/train/gns_finetune.yaml for gns'
            )
        learner.network.load_state_dict(
            {name: torch.from_numpy(value) for name, value in self.tensors.items()}
        )
        with torch.no_grad():
            torch._foreach_copy_(learner.averaged, learner.parameters)

    def _record(self, record: Record) -> Record:
        if tracked := record.teacher.get('engine') == 'tracker':
            record = _from_frame_1(record)
        if not np.any(record.scene.gravity):
            raise UserError(
                f'record {record.name!r} has no gravity, but model {self.name} has learned it; '
                'train one anew, without --from'
            )
        similarity = Similarity.between(record.scene, self.units)
        native = self.units.dt * similarity.time
        if abs(record.trajectory.dt - native) > _SAME_STEP * native:
            remedy = 'import it without --dt' if tracked else 'generate it with this dt'
            raise UserError(
                f'record {record.name!r} has a time step of {record.trajectory.dt:.4g} s, but '
                f'model {self.name} has {native:.4g} s for its radius and gravity; {remedy}'
            )
        trajectory = Trajectory.from_states(
            [similarity.to_model(state) for state in record.trajectory], self.units.dt
        )
        scene = similarity.scene(record.scene)
        # equal to the model's by construction: without rounding errors
        radius = np.asarray(scene.radius)
        if np.ptp(radius) <= 1e-9 * radius.max():
            scene = replace(scene, radius=self.units.radius)
        scene = replace(scene, gravity=(0.0, 0.0, -self.units.gravity))
        return replace(record, trajectory=trajectory, scene=scene)


def _from_frame_1(record: Record) -> Record:
    """Tracked record from frame 1 on, with the velocity of the instant there.

    Backward differences repeat in frame 0 the mean velocity of the step after it, which is the
    target of a window from there. In frame 1 they are the mean of the step before, at the end of
    which a sphere in flight is g dt / 2 faster.
    """
    tracked, fall = record.trajectory, np.asarray(record.scene.gravity, dtype=np.float64)
    if tracked.steps < 2:
        raise UserError(
            f'record {record.name!r} has {tracked.steps} step, expected at least 2; import it '
            'with --min-steps 2 or more'
        )
    bent = np.diff(tracked.positions[:3], 2, axis=0)[0]
    flies = np.linalg.norm(bent - fall * tracked.dt**2, axis=-1) < np.linalg.norm(bent, axis=-1)
    trajectory = tracked.window(1, len(tracked))
    velocities = trajectory.velocities.copy()
    velocities[0] += flies[:, None] * 0.5 * tracked.dt * fall
    return replace(record, trajectory=replace(trajectory, velocities=velocities))
