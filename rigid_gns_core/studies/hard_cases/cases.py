# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The hard cases, and the thresholds that hold in all of them.

SI units; radius 1 m and mass 1 kg unless a case is about size or mass, materials of
`usual_scene` unless it is about materials. Random starts depend on the seed. Cases of surfaces
that meet and of heavy loads are in `surface_cases` and `load_cases`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from .case import Case, usual_scene
from .load_cases import LOAD_CASES
from .surface_cases import SURFACE_CASES
from ...errors import UserError
from ...scenes.plane import Plane
from ...scenes.sampling import sample_start
from ...scenes.scene import Scene
from ...scenes.start import StartRecipe
from ...scenes.state import Array, State

ENERGY_RISE = 1e-4
"""Largest sum of energy rises, relative to the sum of m g r plus the initial kinetic energy."""
DRIFT = 1e-3
"""Largest drift of a sphere [r] over the second half of a case in which it should rest."""
QUICK_STEPS = 500
"""Steps of a long case with --quick."""

_SLOPE = float(np.sqrt(0.5))


def hard_cases(
    names: Iterable[str] | None = None, *, quick: bool = False, seed: int = 0
) -> tuple[Case, ...]:
    """The cases in the order of the table.

    Args:
        names: Cases to include; None: all.
        quick: Whether long cases end after `QUICK_STEPS`.
        seed: Seed of random starts.

    Raises:
        UserError: A name is unknown; the message lists the known ones.
    """
    cases = {case.name: case for case in (make(seed) for make in _MAKERS)}
    wanted = list(cases) if names is None else list(names)
    if unknown := sorted(set(wanted) - set(cases)):
        raise UserError(f'unknown case {unknown[0]!r}, known: {", ".join(cases)}')
    chosen = (case for name, case in cases.items() if name in wanted)
    return tuple(
        replace(case, steps=min(case.steps, QUICK_STEPS)) if quick and case.long else case
        for case in chosen
    )


def _box(width: float, height: float) -> tuple[Plane, ...]:
    """A closed box: floor, walls and lid."""
    lid = Plane((0.0, 0.0, height), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), width, width)
    return (*Plane.box(width, width, height), lid)


def _grid(*shape: int, spacing: float = 2.0) -> Array:
    """Centres of a cubic lattice around x = y = 0 that begins at z = 0 [m], shape (n, 3)."""
    places = np.stack(np.meshgrid(*map(np.arange, shape), indexing='ij'), -1).reshape(-1, 3)
    middle = np.array([(shape[0] - 1) / 2, (shape[1] - 1) / 2, 0.0])
    centres: Array = spacing * (places - middle)
    return centres


def _line(*positions: tuple[float, float, float]) -> State:
    return State(positions=np.array(positions))


def _heap(scene: Scene, spheres: int, seed: int) -> State:
    return sample_start(scene, StartRecipe(spheres=spheres, height=(0.0, 10.0), seed=seed))


def _cubes(_: int) -> Case:
    cube = _grid(3, 3, 3)
    places = [(-3.5, -3.5, 2.0), (3.5, -3.5, 2.5), (-3.5, 3.5, 3.0), (3.5, 3.5, 3.5)]
    return Case(
        'cubes',
        '4 cubes of 27 spheres that touch fall side by side into a box',
        usual_scene(Plane.box(14.0, 14.0)),
        State(positions=np.concatenate([cube + place for place in places])),
        100,
        rests=True,
        closed=True,
    )


def _tower(_: int) -> Case:
    return Case(
        'tower',
        '8 spheres exactly on top of each other stand in a shaft of 2.02 r',
        usual_scene(Plane.box(2.02, 2.02)),
        State(positions=_grid(1, 1, 8) + [0.0, 0.0, 1.0]),
        100,
        rests=True,
        closed=True,
    )


def _shaft(seed: int) -> Case:
    places = _grid(3, 3, 34, spacing=2.2)[:300] + [0.0, 0.0, 1.5]
    places += np.random.default_rng(seed).uniform(-0.05, 0.05, places.shape)
    return Case(
        'shaft',
        '300 spheres are dropped into a shaft of 7 r',
        usual_scene(Plane.box(7.0, 7.0)),
        State(positions=places),
        150,
        closed=True,
        seed=seed,
    )


def _bad_start(
    name: str, text: str, *positions: tuple[float, float, float]
) -> Callable[[int], Case]:
    def make(_: int) -> Case:
        return Case(name, text, usual_scene(), _line(*positions), 60, overlaps=True)

    return make


def _fast(_: int) -> Case:
    row = [(2.01 * k, 0.0, 1.0) for k in range(10)]
    velocities = np.zeros((11, 3))
    velocities[-1, 0] = 400.0
    return Case(
        'fast',
        'a sphere of 400 m/s hits a row of 10 with gaps of 0.01 r',
        usual_scene(),
        State(positions=np.array([*row, (-22.0, 0.0, 1.0)]), velocities=velocities),
        60,
    )


def _corner(_: int) -> Case:
    velocities = np.array([[-80.0, -85.0, -42.0]])
    start = State(positions=np.array([[0.0, 1.0, 6.0]]), velocities=velocities)
    text = 'a sphere is thrown at 124 m/s into the bottom corner of a box'
    return Case('corner', text, usual_scene(Plane.box(20.0, 20.0)), start, 60, closed=True)


def _wedge(_: int) -> Case:
    slopes = tuple(Plane(normal=(side, 0.0, 1.0)) for side in (1.0, -1.0))
    ends = tuple(Plane((0.0, -1.02 * side, 0.0), (0.0, side, 0.0)) for side in (1.0, -1.0))
    root = float(np.sqrt(2.0))
    return Case(
        'wedge',
        'a sphere rests in a V of 45 degrees, a second one leans on it and on one side',
        usual_scene(slopes + ends),
        _line((0.0, 0.0, root), (-root, 0.0, 2.0 * root)),
        100,
        rests=True,
    )


def _elastic(seed: int) -> Case:
    scene = usual_scene(_box(10.0, 10.0), restitution=1.0, friction=0.0, rolling_friction=0.0)
    places = sample_start(scene, StartRecipe(spheres=20, gap=0.05, seed=seed)).positions
    velocities = np.random.default_rng(seed).normal(0.0, 5.0, places.shape)
    return Case(
        'elastic',
        '20 spheres without any loss in a closed box of 10 r: restitution 1, no friction',
        scene,
        State(positions=places, velocities=velocities),
        200,
        closed=True,
        seed=seed,
    )


def _stacked(name: str, text: str, lower: float, upper: float) -> Callable[[int], Case]:
    def make(_: int) -> Case:
        # a little off centre: directly above, rounding would decide where the upper one goes
        start = _line((0.0, 0.0, 1.0), (0.3, 0.0, 6.0))
        return Case(name, text, usual_scene(mass=(lower, upper)), start, 100)

    return make


def _mixed(
    name: str, text: str, count: tuple[int, int], small: float, width: float
) -> Callable[[int], Case]:
    def make(seed: int) -> Case:
        radius = np.repeat([1.0, small], count)
        scene = usual_scene(Plane.box(width, width), radius=tuple(radius), mass=tuple(radius**3))
        start = _heap(scene, sum(count), seed)
        return Case(name, text, scene, start, 150, closed=True, seed=seed)

    return make


def _cradle(_: int) -> Case:
    velocities = np.zeros((6, 3))
    velocities[0, 0] = 3.0
    row = _line((-6.0, 0.0, 1.0), *((2.0 * k, 0.0, 1.0) for k in range(5)))
    return Case(
        'cradle',
        'Newton: a sphere of 3 m/s hits 5 that touch; level floor, no friction, restitution 1',
        usual_scene(restitution=1.0, friction=0.0, rolling_friction=0.0),
        replace(row, velocities=velocities),
        60,
    )


def _long(seed: int) -> Case:
    scene = usual_scene(Plane.box(8.0, 8.0))
    text = '12 spheres fall into a box of 8 r and lie there for 20 000 steps'
    start = _heap(scene, 12, seed)
    return Case('long', text, scene, start, 20_000, rests=True, closed=True, long=True, seed=seed)


def _incline_edge(_: int) -> Case:
    angle = np.radians(20.0)
    down = np.array([np.cos(angle), 0.0, -np.sin(angle)])
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    middle = np.array([0.0, 0.0, 2.0]) - 10.0 * down  # its lower edge is 2 r above the floor
    plane = Plane(tuple(middle), tuple(normal), tuple(down), 20.0, 12.0)
    places = [middle + normal + 3.0 * k * down + [0.0, k - 1.0, 0.0] for k in range(3)]
    text = '3 spheres roll down a plane of 20 degrees and off its edge, 2 r above the floor'
    start = State(positions=np.array(places))
    return Case('incline_edge', text, usual_scene((Plane(), plane)), start, 100)


def _plane_end(_: int) -> Case:
    plane = Plane((0.0, 0.0, 10.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 10.0, 20.0)
    start = State(
        positions=np.array([(0.0, -5.0, 11.0), (5.0, 5.0, 13.0)]),
        velocities=np.array([(2.5, 0.0, 0.0), (0.0, 0.0, 0.0)]),
        angular_velocities=np.array([(0.0, 2.5, 0.0), (0.0, 0.0, 0.0)]),
    )
    return Case(
        'plane_end',
        'a sphere rolls off a plane 10 r above the floor, another falls exactly on its edge',
        usual_scene((Plane(), plane)),
        start,
        80,
    )


def _heap_in_box(seed: int) -> Case:
    scene = usual_scene(Plane.box(12.0, 12.0))
    start = _heap(scene, 10, seed)
    text = '10 spheres fall into a box of 12 r'
    return Case('heap', text, scene, start, 100, closed=True, seed=seed)


_MAKERS: tuple[Callable[[int], Case], ...] = (
    _cubes,
    _tower,
    _shaft,
    _bad_start(
        'overlap_air',
        'pairs that overlap by 0.3 r at the start, in the air: level, upright, aslant',
        *((0.0, 0.0, 5.0), (1.7, 0.0, 5.0)),
        *((0.0, 20.0, 5.0), (0.0, 20.0, 6.7)),
        *((0.0, 40.0, 5.0), (1.7 * _SLOPE, 40.0, 5.0 + 1.7 * _SLOPE)),
    ),
    _bad_start(
        'overlap_floor',
        'the same on the floor: level, upright, and a sphere 0.3 r deep in it',
        *((0.0, 0.0, 1.0), (1.7, 0.0, 1.0)),
        *((0.0, 20.0, 1.0), (0.0, 20.0, 2.7)),
        (0.0, 40.0, 0.7),
    ),
    _bad_start('same_point_2', '2 spheres start with one centre', *[(0.0, 0.0, 3.0)] * 2),
    _bad_start('same_point_3', '3 spheres start with one centre', *[(0.0, 0.0, 3.0)] * 3),
    _bad_start('half_below', 'a sphere starts half below the floor', (0.0, 0.0, 0.0)),
    _bad_start(
        'centre_below', 'a sphere starts with its centre 0.5 r below the floor', (0.0, 0.0, -0.5)
    ),
    _fast,
    _corner,
    _wedge,
    _elastic,
    _stacked('heavy_on_light', '1000 kg fall on 1 kg that rests on the floor', 1.0, 1000.0),
    _stacked('light_on_heavy', '1 kg falls on 1000 kg that rest on the floor', 1000.0, 1.0),
    _mixed('radius_ratio', 'a pile of 20 spheres of 1 and 0.2 m radius', (6, 14), 0.2, 6.0),
    _cradle,
    _long,
    _incline_edge,
    _plane_end,
    # the time step follows the largest radius: sqrt(10) times that for the small spheres
    _mixed(
        'coarse_step',
        'radii 0.1 and 1 m: the step of the large ones is too coarse for the small',
        (4, 20),
        0.1,
        5.0,
    ),
    _heap_in_box,
    *SURFACE_CASES,
    *LOAD_CASES,
)
