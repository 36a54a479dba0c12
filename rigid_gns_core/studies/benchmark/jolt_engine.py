# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Jolt as a peer: a game engine that is made for many contacts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from .node_engine import describe_scene, NodeSpheres
from ...errors import UserError
from ...scenes.scene import Scene
from ...scenes.state import State


@dataclass(frozen=True)
class JoltSettings:
    """Settings of Jolt.

    Args:
        substeps: Steps of Jolt per frame.
        velocity_steps: Iterations over velocities in each; 10 is Jolt's own.
        position_steps: Iterations over positions in each; 2 is Jolt's own.
    """

    substeps: int = 6
    velocity_steps: int = 10
    position_steps: int = 2


class JoltSpheres(NodeSpheres):
    """A live Jolt scene that is advanced frame by frame.

    Args:
        scene: Half spaces, and properties that are the same for all spheres.
        start: State at time 0.
        dt: Length of a frame [s].
        settings: Settings of Jolt.

    Raises:
        UserError: Jolt cannot express the scene.
        FloatingPointError: Its process ended.
    """

    peer, package = 'Jolt', 'jolt-physics'
    script = Path(__file__).with_suffix('.js')

    def __init__(self, scene: Scene, start: State, dt: float, settings: JoltSettings) -> None:
        step = dt / settings.substeps
        described = describe_scene(self.peer, scene, start, step)
        super().__init__(len(start), {**_as_pairs(described), 'step': step, **asdict(settings)})


def _as_pairs(described: dict[str, Any]) -> dict[str, Any]:
    """The scene with values that Jolt's rules make those of its pairs.

    Here a pair has the product of restitutions and of frictions; in Jolt the larger restitution
    and the geometric mean of frictions.
    """
    restitution, friction = described['restitution'], described['friction']
    planes = []
    for plane in described['planes']:
        if plane['restitution'] < restitution:
            raise UserError(
                f'the restitution of a surface, {plane["restitution"]:g}, is below that of the '
                f'spheres, {restitution:g}, which the Jolt peer cannot express: a pair of it has '
                'the larger one'
            )
        pair = {
            'restitution': plane['restitution'] * restitution,
            'friction': plane['friction'] ** 2,
        }
        planes.append({**plane, **pair})
    pair = {'restitution': restitution**2, 'friction': friction**2}
    return {**described, **pair, 'planes': planes}
