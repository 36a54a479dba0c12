# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One hard case: a scene, a start, and what is checked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ...errors import UserError
from ...scenes.plane import Plane
from ...scenes.scene import Scene
from ...scenes.state import State


def usual_scene(surfaces: tuple[Plane, ...] = (Plane(),), **properties: Any) -> Scene:
    """Scene with the materials that all cases have which are not about materials."""
    materials = {'restitution': 0.7746, 'friction': 0.5, 'rolling_friction': 0.03}
    return Scene(surfaces=surfaces, **materials | properties)


@dataclass(frozen=True)
class Case:
    """A scene and a start that are hard to simulate.

    Args:
        name: Short name, for the table and `--cases`.
        text: What is hard, in one line.
        scene: Surfaces, sphere properties, materials and gravity.
        start: State at time 0.
        steps: Number of the simulator's own time steps.
        rests: Whether the spheres should rest over the second half, so that drift is checked.
        overlaps: Whether spheres overlap or are below the floor at the start. The potential energy
            of pushing them out in the first step then does not count as a rise.
        closed: Whether all surfaces enclose the spheres; if not, half-spaces do.
        long: Whether --quick cuts it to `cases.QUICK_STEPS`.
        deepest: Largest penetration [diameters] over the second half; None: it is not judged.
        seed: Seed of a random start; None: nothing is random.
    """

    name: str
    text: str
    scene: Scene
    start: State
    steps: int
    rests: bool = False
    overlaps: bool = False
    closed: bool = False
    long: bool = False
    deepest: float | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        if self.steps < 2:
            raise UserError(f'steps of case {self.name!r} is {self.steps}, expected at least 2')
        for name in ('radius', 'mass'):
            self.scene.per_sphere(name, len(self.start))

    @property
    def enclosing(self) -> tuple[Plane, ...]:
        """Surfaces that no centre may be behind."""
        return tuple(s for s in self.scene.surfaces if self.closed or s.is_half_space)
