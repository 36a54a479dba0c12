# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the trajectories of a training set have in common, and a hash of the set."""

from __future__ import annotations

from collections.abc import Sequence
import hashlib
import json

import numpy as np

from .records import Record
from ..errors import UserError
from ..scenes.similarity import ModelUnits

MATERIALS = ('restitution', 'friction', 'rolling_friction')


def common_scene(records: Sequence[Record]) -> tuple[ModelUnits, dict[str, float]]:
    """Units and materials that all records share.

    The thesis' network knows one radius, one mass and one material, and gravity along -z.

    Raises:
        UserError: There are no records, or they do not share these.
    """
    if not records:
        raise UserError('there are no training trajectories; run `rigid-gns generate` first')
    kinds = {_properties(record) for record in records}
    if len(kinds) > 1:
        raise UserError(
            'the training trajectories differ in (dt, gravity, radius, mass, restitution, '
            f'friction, rolling_friction): {sorted(kinds)[:3]}; train on data of one kind'
        )
    dt, gravity, radius, _, *materials = kinds.pop()
    return (
        ModelUnits(radius=radius, gravity=gravity, dt=dt),
        dict(zip(MATERIALS, materials, strict=True)),
    )


def _properties(record: Record) -> tuple[float, ...]:
    scene = record.scene
    gravity = np.asarray(scene.gravity)
    if not (gravity[2] < 0 and (gravity[:2] == 0).all()):
        raise UserError(
            f'record {record.name!r} has gravity {scene.gravity}, expected along -z; '
            'turn the scene before it is simulated'
        )
    values = []
    for name in ('radius', 'mass', *MATERIALS):
        own = scene.per_sphere(name, record.trajectory.count)
        if name in ('restitution', 'friction'):
            own = np.concatenate([own, scene.surface_values(name)])
        if np.ptp(own) > 0:
            raise UserError(
                f'record {record.name!r} has {name} from {own.min():g} to {own.max():g}, but the '
                'GNS knows one of each; generate data with one radius, mass and material'
            )
        values.append(float(own[0]))
    return (record.trajectory.dt, float(-gravity[2]), *values)


def fingerprint(records: Sequence[Record]) -> str:
    """SHA-256 of scenes and poses: the same for the same data, wherever they lie."""
    digest = hashlib.sha256()
    for record in records:
        digest.update(json.dumps(record.scene.to_mapping()).encode())
        digest.update(np.ascontiguousarray(record.trajectory.positions).tobytes())
        digest.update(np.ascontiguousarray(record.trajectory.quaternions).tobytes())
    return digest.hexdigest()
