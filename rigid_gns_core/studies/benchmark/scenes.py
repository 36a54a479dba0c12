# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The scenes of the benchmark, from free flight to a pile."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..chaos_floor import References
from ...data.recipe import load_recipe
from ...errors import UserError
from ...scenes.plane import Plane
from ...scenes.sampling import sample_start
from ...scenes.scene import Scene
from ...scenes.scene_file import load_start
from ...scenes.state import Array, State, Trajectory

FRAME = 0.1
"""Time between frames [s], the model's for spheres of radius 1 m."""
FRAMES = 100
"""Largest number of frames of a scene, and the length of the references."""
QUICK_FRAMES = 30


@dataclass(frozen=True)
class BenchScene:
    """A scene of the benchmark.

    Args:
        name: Short name, for the table and `--scenes`.
        text: Description in one line.
        scene: Surfaces, sphere properties, materials and gravity; spheres of radius 1 m.
        start: State at time 0.
        frames: Number of frames of `FRAME` seconds.
        settles: Whether it ends in a pile, which is measured, too.
    """

    name: str
    text: str
    scene: Scene
    start: State
    frames: int = FRAMES
    settles: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.frames <= FRAMES:
            raise UserError(f'frames of {self.name!r} is {self.frames}, expected 1 to {FRAMES}')

    def references(self, references: References) -> list[Trajectory] | None:
        """The teacher's trajectory, then those of its floor; None: Bullet does not support it."""
        name = f'bench-{self.name}'
        return references.of(name, self.scene, self.start, self.frames, FRAME)


def bench_scenes(
    names: Iterable[str] | None = None, *, quick: bool = False
) -> tuple[BenchScene, ...]:
    """The scenes in the order of the table.

    Args:
        names: Scenes to include; None: all.
        quick: Whether to take few spheres and `QUICK_FRAMES`.

    Raises:
        UserError: A name is unknown; the message lists the known ones.
    """
    wanted = list(SCENES) if names is None else list(dict.fromkeys(names))
    if unknown := sorted(set(wanted) - set(SCENES)):
        raise UserError(f'unknown scene {unknown[0]!r}, known: {", ".join(SCENES)}')
    made = (make(quick) for name, (_, make) in SCENES.items() if name in wanted)
    return tuple(replace(scene, frames=QUICK_FRAMES) if quick else scene for scene in made)


def lattice(
    columns: tuple[int, int], count: int, pitch: float, low: float, jitter: float
) -> Array:
    """Centres of an upright lattice around x = y = 0, randomly displaced [m], shape (count, 3).

    Args:
        columns: Number of columns along x and y.
        count: Number of spheres; layers are filled from below.
        pitch: Distance of neighbours [m].
        low: Height of the lowest layer [m].
        jitter: Largest displacement along each axis [m].
    """
    rng = np.random.default_rng(count)
    index = np.arange(count)
    wide, deep = columns
    steps = np.stack([index % wide, index // wide % deep, index // (wide * deep)], axis=1)
    middle = np.array([(wide - 1) / 2, (deep - 1) / 2, 0.0])
    places = pitch * (steps - middle) + [0.0, 0.0, low]
    jittered: Array = places + rng.uniform(-jitter, jitter, places.shape)
    return jittered


def _box(quick: bool) -> BenchScene:
    scene, recipe = load_start('box_154')
    if quick:
        recipe = replace(recipe, spheres=8, height=(0.0, 12.0))
    return _named('box', scene, sample_start(scene, recipe))


def _thesis(quick: bool) -> BenchScene:
    recipe = load_recipe('thesis_test')
    if quick:
        recipe = replace(recipe, spheres=(8, 8), height=(0.0, 12.0))
    low, high = (8, 8) if quick else (150, 250)
    for index in range(recipe.trajectories):
        scene, start = recipe.draw(index)
        if low <= len(start) <= high:
            return _named('thesis', scene, start)
    raise UserError(f'thesis_test has no trajectory of {low} to {high} spheres')


def _pile(quick: bool) -> BenchScene:
    side, columns, count = (7.0, 2, 12) if quick else (27.0, 7, 200)
    # restitution 0.4 for every pair, so that a pile forms early
    scene = Scene(
        surfaces=Plane.box(side, side), restitution=0.6325, friction=0.5, rolling_friction=0.03
    )
    places = lattice((columns, columns), count, 3.0, 1.8, 0.3)
    return replace(_named('pile', scene, State(positions=places)), settles=True)


def _billiards(quick: bool) -> BenchScene:
    # a pub table in units of the radius; restitution 0.8 on cushions, 0.9 between balls
    ball = float(np.sqrt(0.9))
    box = Plane.box(44.0, 88.0, restitution=0.8 / ball, friction=0.8)
    scene = Scene(surfaces=box, restitution=ball, friction=0.25, rolling_friction=0.01)
    rows = 2 if quick else 5
    pitch = 2.01  # a small gap: how touching balls share a blow is not determined by the laws
    rack = [
        (pitch * (column - row / 2), 22.0 + pitch * np.sqrt(0.75) * row, 1.0)
        for row in range(rows)
        for column in range(row + 1)
    ]
    rng = np.random.default_rng(16)
    places = np.array([*rack, (0.3, 0.0 if quick else -22.0, 1.0)])
    places[:-1, :2] += rng.uniform(-0.002, 0.002, (len(rack), 2))
    velocities = np.zeros_like(places)
    velocities[-1, 1] = 30.0
    spins = np.zeros_like(places)
    spins[-1, 0] = -30.0  # it rolls
    start = State(positions=places, velocities=velocities, angular_velocities=spins)
    return _named('billiards', scene, start)


def _flight(quick: bool) -> BenchScene:
    side, count = (5, 25) if quick else (32, 1000)
    places = lattice((side, side), count, 4.0, 25.0, 0.5)
    # thrown up, they return after 10 s, within the heights that networks are trained on; they fly
    # apart, so that none collide
    velocities = 0.2 * (places - places.mean(axis=0)) + [0.0, 0.0, 49.0]
    spins = np.random.default_rng(0).uniform(-3.0, 3.0, places.shape)
    start = State(positions=places, velocities=velocities, angular_velocities=spins)
    return _named('flight', Scene(restitution=0.7746, rolling_friction=0.03), start)


def _named(name: str, scene: Scene, start: State) -> BenchScene:
    return BenchScene(name, SCENES[name][0], scene, start)


SCENES: dict[str, tuple[str, Callable[[bool], BenchScene]]] = {
    'box': ('154 spheres fall from up to 150 m into a box of 60 m (box_154)', _box),
    'thesis': ('the first of the thesis test set with 150 to 250 spheres', _thesis),
    'pile': ('200 spheres fall from a shaken lattice into a pile, box of 27 m', _pile),
    'billiards': ('a ball breaks a rack of 15 on a table with cushions', _billiards),
    'flight': ('1000 spheres thrown up to 150 m, no contact', _flight),
}
"""Name: description, and function that makes the scene (True: few spheres)."""
