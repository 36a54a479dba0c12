# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The starts of the comparison, and the steps before anything is measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.scene_file import load_scene, load_start
from rigid_gns_core.scenes.start import StartRecipe
from rigid_gns_core.scenes.state import Array, State


@dataclass(frozen=True)
class Start:
    """Start of a row.

    Args:
        text: Description on the page.
        scene: Surfaces and sphere properties.
        state: State at time 0.
        skip: Steps before anything is measured.
        bullet: Whether Bullet's records are of such scenes, so that a change is judged by them.
    """

    text: str
    scene: Scene
    state: State
    skip: int = 0
    bullet: bool = True


def _lattice(spheres: int, pitch: float, height: tuple[float, float]) -> Array:
    """Centres on a square lattice around the origin [m], shape (spheres, 3)."""
    side = int(np.ceil(np.sqrt(spheres)))
    across = np.stack(np.divmod(np.arange(spheres), side), axis=1) - (side - 1) / 2
    return np.c_[pitch * across, np.random.default_rng(0).uniform(*height, spheres)]


def _thrown(balls: int) -> Start:
    """Table tennis balls with spin, far enough from each other that none meet."""
    draw = np.random.default_rng(2).uniform
    state = State(
        positions=np.c_[
            np.full(balls, -1.2), np.linspace(-0.7, 0.7, balls), draw(0.2, 0.4, balls)
        ],
        velocities=np.c_[draw(3.0, 5.0, balls), np.zeros(balls), draw(-1.0, 1.0, balls)],
        angular_velocities=np.c_[np.zeros(balls), draw(-100.0, 200.0, balls), np.zeros(balls)],
    )
    text = f'{balls} table tennis balls with spin are thrown on a table, from step 10'
    return Start(text, load_scene('table_tennis'), state, skip=10, bullet=False)


def make_starts(quick: bool) -> dict[str, Start]:
    """Starts by name; smaller ones if `quick`."""
    spheres, piled = (40, 12) if quick else (154, 64)
    moving, settled, settled_pile = (30, 30, 100) if quick else (60, 300, 400)
    scene, recipe = load_start('box_154')
    wide = replace(scene, surfaces=Plane.box(400.0, 400.0))
    shaft = replace(scene, surfaces=Plane.box(8.0, 8.0))
    bounce = State(positions=_lattice(spheres, 5.0, (2.0, 4.0)))
    speed = np.c_[np.random.default_rng(1).uniform(-1.0, 1.0, (spheres, 2)), np.zeros(spheres)]
    roll = State(
        positions=_lattice(spheres, 12.0, (1.0, 1.0)),
        velocities=speed,
        angular_velocities=np.cross([0.0, 0.0, 1.0], speed),
    )
    box = sample_start(scene, replace(recipe, spheres=spheres))
    pile = sample_start(shaft, StartRecipe(spheres=piled, height=(0.0, 60.0)))
    in_box = f'the box of 60 m with {spheres} spheres'
    return {
        'bounce': Start(
            f'{spheres} spheres, 5 m from each other, bounce in the middle of a box of 400 m',
            wide,
            bounce,
            3,
        ),
        'thrown': _thrown(4 if quick else 16),
        'roll': Start(f'{spheres} spheres roll on the ground without meeting', wide, roll),
        'box': Start(f'{in_box}, from step 15', scene, box, 15),
        'pile': Start(
            f'{piled} spheres fall into a shaft of 8 m, from step {moving}', shaft, pile, moving
        ),
        'settled': Start(f'{in_box}, from step {settled}', scene, box, settled),
        'settled pile': Start(
            f'the shaft of 8 m, from step {settled_pile}', shaft, pile, settled_pile
        ),
    }
