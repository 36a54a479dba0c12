# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The recipe of a data set: how each trajectory's scene and start are drawn."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, replace
import hashlib
import json
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..errors import shown
from ..files.config import ConfigError, find_config, from_mapping, load_yaml
from ..scenes.sampling import sample_start
from ..scenes.scene import Plane, Scene
from ..scenes.start import check_range, Layout, StartRecipe
from ..scenes.state import State

Range = float | tuple[float, float]  # a number, or a range to draw from
# keys that came after the first data sets; their hashes must not change
_LATER = ('density', 'vary', 'layout', 'speed', 'spin', 'moving', 'walls')


@dataclass(frozen=True)
class DataRecipe:
    """How a set of trajectories is drawn; see config/data/thesis.yaml.

    Trajectory `index` follows from (seed, index) alone, whatever the others are and wherever it is
    made. A material is a number, or a range that is drawn from evenly (see `vary`); a radius
    or mass is a number, or a range from which each sphere draws a value evenly in its logarithm.

    Args:
        trajectories: Number of trajectories.
        seed: Seed of the set, at least 0.
        steps: Time steps of each trajectory.
        dt: Time step [s].
        spheres: Lowest and highest number of spheres.
        height: Lowest and highest centre above the ground at the start [m].
        box_side: Lowest and highest inner side of the box [m].
        layers: The box is at least so large that the spheres, side by side, lie in this many
            layers on its ground, all as large as the largest may be.
        gap: Least distance between surfaces at the start [m]; see `StartRecipe`.
        radius: Radius [m].
        mass: Mass [kg].
        restitution: Coefficient of restitution of the material; that of a pair is its square.
        friction: Coulomb friction coefficient of the material; that of a pair is its square.
        rolling_friction: Dimensionless, see `Scene`.
        gravity: Acceleration towards -z [m/s^2].
        teacher: Settings of the teacher that differ from its defaults.
        density: `mass` is that of a sphere of the largest radius, smaller ones have as much per
            volume.
        vary: What draws a material from its range: each trajectory, or each sphere and surface (a
            surface has no rolling friction of its own).
        layout: Where the spheres start, see `StartRecipe`.
        speed: Lowest and highest speed at the start [m/s].
        spin: Lowest and highest angular speed at the start [rad/s].
        moving: Probability of each sphere to have speed and spin at the start.
        walls: Without them the box only says where the spheres start; there is the ground alone.
    """

    trajectories: int
    seed: int
    steps: int
    dt: float = 0.1
    spheres: tuple[int, int] = (1, 300)
    height: tuple[float, float] = (0.0, 150.0)
    box_side: tuple[float, float] = (0.0, 100.0)
    layers: float = 2.0
    gap: float = 0.1
    radius: Range = 1.0
    mass: Range = 1.0
    restitution: Range = 0.7746
    friction: Range = 0.5
    rolling_friction: Range = 0.03
    gravity: float = 9.81
    teacher: dict[str, Any] = field(default_factory=dict)
    density: bool = False
    vary: Literal['trajectory', 'sphere'] = 'trajectory'
    layout: Layout = 'scattered'
    speed: tuple[float, float] = (0.0, 0.0)
    spin: tuple[float, float] = (0.0, 0.0)
    moving: float = 1.0
    walls: bool = True

    def __post_init__(self) -> None:
        for name, least in (('trajectories', 1), ('seed', 0), ('steps', 1)):
            if getattr(self, name) < least:
                raise ConfigError(f'{name} is {getattr(self, name)}, expected at least {least}')
        for name in ('dt', 'layers', 'radius', 'mass'):
            value = getattr(self, name)
            if isinstance(value, tuple):
                check_range(name, value, 0.0)
            lowest = value[0] if isinstance(value, tuple) else value
            if not (lowest > 0 and np.isfinite(lowest)):
                raise ConfigError(f'{name} is {lowest:g}, expected a positive number')
        check_range('spheres', self.spheres, 1)
        check_range('height', self.height, 0.0)
        check_range('box_side', self.box_side, 0.0)
        for name in ('restitution', 'friction', 'rolling_friction'):
            value = getattr(self, name)
            if isinstance(value, tuple):
                check_range(name, value, 0.0)
        StartRecipe(spheres=self.spheres[1], **self._start)  # checks them
        if self.layout == 'blocks' and isinstance(self.radius, tuple):
            raise ConfigError(
                f'radius is [{self.radius[0]:g}, {self.radius[1]:g}], but blocks need equal '
                'radii; give one number, or another layout'
            )
        if self._least_area(self.spheres[1]) > self.box_side[1] ** 2:
            raise ConfigError(
                f'{self.spheres[1]} spheres of radius {self._largest:g} m in {self.layers:g} '
                f'layers do not fit into a box of side {self.box_side[1]:g} m; '
                'use fewer spheres, more layers or a larger box_side'
            )

    @property
    def _largest(self) -> float:
        return self.radius[1] if isinstance(self.radius, tuple) else self.radius

    @property
    def _start(self) -> dict[str, Any]:
        names = ('height', 'gap', 'layout', 'speed', 'spin', 'moving')
        return {name: getattr(self, name) for name in names}

    def _least_area(self, spheres: int) -> float:
        return spheres * (2 * self._largest + self.gap) ** 2 / self.layers

    def draw(self, index: int) -> tuple[Scene, State]:
        """Scene and start of trajectory `index`; the same for the same (seed, index).

        Raises:
            SamplingError: The spheres do not fit into the box that was drawn.
        """
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, index]))
        spheres = int(rng.integers(self.spheres[0], self.spheres[1], endpoint=True))
        # the number of spheres is drawn first, so that small boxes do not make it smaller
        low, high = max(self.box_side[0], 2 * self._largest + 3 * self.gap), self.box_side[1]
        area = self._least_area(spheres)
        first = rng.uniform(min(max(low, area / high), high), high)
        second = rng.uniform(min(max(low, area / first), high), high)
        length_x, length_y = (first, second) if rng.random() < 0.5 else (second, first)
        # what only some recipes draw comes last, so that the others' draws stay the same
        each = spheres if self.vary == 'sphere' else None
        material = {
            name: _draw(rng, getattr(self, name), each)
            for name in ('restitution', 'friction', 'rolling_friction')
        }
        radius = _draw_logarithmic(rng, self.radius, spheres)
        mass = _draw_logarithmic(rng, self.mass, spheres)
        if self.density:
            mass = mass * (radius / self._largest) ** 3
        surfaces = Plane.box(length_x, length_y) if self.walls else (Plane(),)
        if self.vary == 'sphere':
            # where there is a range; a number is the scene's, which a surface takes over
            ranged = [
                n for n in ('restitution', 'friction') if isinstance(getattr(self, n), tuple)
            ]
            surfaces = tuple(
                replace(plane, **{name: _draw(rng, getattr(self, name)) for name in ranged})
                for plane in surfaces
            )
        scene = Scene(
            surfaces=surfaces,
            radius=_plain(radius),
            mass=_plain(mass),
            gravity=(0.0, 0.0, -self.gravity),
            **material,
        )
        start = StartRecipe(spheres=spheres, **self._start)
        if not self.walls:
            start = replace(start, length_x=length_x, length_y=length_y)
        return scene, sample_start(scene, start, rng)


def load_recipe(name: str | Path) -> DataRecipe:
    """Data recipe of a YAML file, or of a shipped name in config/data.

    `base: NAME` takes all values of another recipe; the file's own replace them.

    Raises:
        ConfigError: No such recipe, an unknown key, or a value out of range.
    """
    path = find_config('data', name)
    mapping, seen = load_yaml(path), [path.resolve()]
    while 'base' in mapping:
        name = mapping.pop('base')
        if not isinstance(name, str):  # as text it may be of any size
            raise ConfigError(f'{path}: base is {shown(name)}, expected a name')
        try:
            base = find_config('data', name)
        except ConfigError as error:
            raise ConfigError(f'{path}: base: {error}') from error
        if base.resolve() in seen:
            raise ConfigError(f'{path}: base leads back to {base}; remove one of the two')
        seen.append(base.resolve())
        mapping = {**load_yaml(base), **mapping}
    return from_mapping(DataRecipe, mapping, str(path))


def recipe_hash(recipe: DataRecipe) -> str:
    """Short hash of all that shapes a trajectory; the number of trajectories does not."""
    mapping = asdict(replace(recipe, trajectories=1))
    for key in fields(recipe):
        if key.name in _LATER and mapping[key.name] == key.default:
            del mapping[key.name]
    text = json.dumps(mapping, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def recipe_difference(old: DataRecipe, new: DataRecipe) -> list[str]:
    """Lines `key: OLD in the folder, NEW now`, empty where a folder can be continued."""
    before, after = _flat(old), _flat(new)
    return [
        f'{key}: {before.get(key)} in the folder, {after.get(key)} now'
        for key in sorted(before | after)
        if key != 'trajectories' and before.get(key) != after.get(key)
    ]


def _draw(rng: np.random.Generator, value: Range, count: int | None = None) -> Any:
    """`value`, or where it is a range one or `count` draws from it."""
    if not isinstance(value, tuple):
        return value
    return float(rng.uniform(*value)) if count is None else _plain(rng.uniform(*value, count))


def _draw_logarithmic(rng: np.random.Generator, value: Range, count: int) -> Any:
    """`value`, or where it is a range draws even in the logarithm, shape (count,)."""
    if not isinstance(value, tuple):
        return value
    # the logarithm and back may leave the range by rounding
    low, high = np.log(value).tolist()
    return np.exp(rng.uniform(low, high, count)).clip(*value)


def _plain(value: Any) -> Any:
    return tuple(value.tolist()) if isinstance(value, np.ndarray) else value


def _flat(recipe: DataRecipe) -> dict[str, Any]:
    mapping = asdict(recipe)
    teacher = mapping.pop('teacher')
    return mapping | {f'teacher.{key}': value for key, value in teacher.items()}
