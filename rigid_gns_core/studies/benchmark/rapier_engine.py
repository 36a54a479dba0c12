# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rapier as a peer: a game engine."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from .node_engine import describe_scene, NodeSpheres
from ...scenes.scene import Scene
from ...scenes.state import State


@dataclass(frozen=True)
class RapierSettings:
    """Settings of Rapier.

    Args:
        substeps: Steps of Rapier per frame.
        iterations: Iterations of its solver in each; 4 is Rapier's own.
    """

    substeps: int = 6
    iterations: int = 4


class RapierSpheres(NodeSpheres):
    """A live Rapier scene that is advanced frame by frame.

    Args:
        scene: Half spaces, and properties that are the same for all spheres.
        start: State at time 0.
        dt: Length of a frame [s].
        settings: Settings of Rapier.

    Raises:
        UserError: Rapier cannot express the scene.
        FloatingPointError: Its process ended.
    """

    peer, package = 'Rapier', '@dimforge/rapier3d-simd-compat'
    script = Path(__file__).with_suffix('.js')

    def __init__(self, scene: Scene, start: State, dt: float, settings: RapierSettings) -> None:
        step = dt / settings.substeps
        # it integrates in each iteration
        described = describe_scene(self.peer, scene, start, step / settings.iterations)
        super().__init__(len(start), {**described, 'step': step, **asdict(settings)})
