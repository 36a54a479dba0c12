"""Seeded start states, and scene files that hold a scene with its start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from .config import ConfigError, find_config, from_mapping, load_yaml
from .plane import closest_points
from .scene import Scene
from .state import Array, State

# a sphere that found no place in so many throws will hardly find one
_THROWS = 2000


class SamplingError(ValueError):
    """The spheres asked for do not fit."""


@dataclass(frozen=True)
class StartRecipe:
    """Spheres at rest, at random places that touch nothing.

    Args:
        spheres: Number of spheres.
        height: Lowest and highest centre above z = 0 [m].
        length_x: Full length along x of the region around the scene's middle [m]; None: between
            the walls.
        length_y: The same along y [m].
        gap: Least distance between surfaces at the start [m].
        seed: Seed of the places.
    """

    spheres: int
    height: tuple[float, float] = (0.0, 150.0)
    length_x: float | None = None
    length_y: float | None = None
    gap: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        if self.spheres < 1:
            raise ConfigError(f'spheres is {self.spheres}, expected at least 1')
        check_range('height', self.height, -np.inf)
        if not self.gap >= 0:
            raise ConfigError(f'gap is {self.gap:g} m, expected at least 0')


def load_scene(name: str | Path) -> tuple[Scene, StartRecipe]:
    """Scene and start of a YAML file, or of a shipped name in config/scenes.

    The file holds `scene:` (see `Scene.from_mapping`) and `start:` (see `StartRecipe`), of which
    the second may be absent: then one sphere starts.

    Raises:
        ConfigError: No such scene, an unknown key, or a value out of range.
    """
    path = find_config('scenes', name)
    mapping = load_yaml(path)
    if unknown := sorted(set(mapping) - {'scene', 'start'}, key=str):
        raise ConfigError(f'{path}: unknown key {unknown[0]!r}, allowed: scene, start')
    for key in ('scene', 'start'):
        if not isinstance(mapping.get(key, {}), dict):
            raise ConfigError(f'{path}: {key} is {mapping[key]!r}, expected a mapping')
    if 'scene' not in mapping:
        raise ConfigError(f"{path}: missing key 'scene'")
    try:
        scene = Scene.from_mapping(mapping['scene'], 'scene')
        start = from_mapping(StartRecipe, {'spheres': 1, **mapping.get('start', {})}, 'start')
    except ValueError as error:
        raise ConfigError(f'{path}: {error}') from error
    return scene, start


def sample_start(
    scene: Scene, recipe: StartRecipe, rng: np.random.Generator | None = None
) -> State:
    """Place spheres at rest by throwing darts: a place too near to anything is thrown again.

    Args:
        scene: Surfaces to keep clear of, and radii.
        recipe: How many spheres, and where.
        rng: Source of the places; None: made from the recipe's seed.

    Raises:
        SamplingError: There is no room, or no bound of the region; says which and what to change.
    """
    rng = np.random.default_rng(recipe.seed) if rng is None else rng
    radii = scene.per_sphere('radius', recipe.spheres)
    low, high = _region(scene, recipe, float(radii.max()))
    positions = np.empty((recipe.spheres, 3))
    cell = 2 * float(radii.max()) + recipe.gap
    near: dict[tuple[int, ...], list[int]] = {}
    # large ones first: they find no place any more between small ones
    for done, sphere in enumerate(np.argsort(-radii, kind='stable')):
        for place in _throws(scene, low, high, float(radii[sphere]), recipe.gap, rng):
            corner = np.floor(place / cell).astype(int).tolist()
            around = product(*((c - 1, c, c + 1) for c in corner))
            rivals = [rival for key in around for rival in near.get(key, ())]
            apart = np.linalg.norm(positions[rivals] - place, axis=1) - radii[rivals]
            if (apart >= radii[sphere] + recipe.gap).all():
                break
        else:
            raise SamplingError(
                f'only {done} of {recipe.spheres} spheres found a place in a region of '
                + ' x '.join(f'{length:.3g}' for length in high - low)
                + ' m; use fewer spheres, a smaller gap, a greater height or a larger box'
            )
        positions[sphere] = place
        near.setdefault(tuple(corner), []).append(int(sphere))
    return State(positions=positions)


def _throws(
    scene: Scene, low: Array, high: Array, radius: float, gap: float, rng: np.random.Generator
) -> Iterator[Array]:
    """Places in the region where a sphere clears every surface."""
    batch = 8
    for _ in range(_THROWS // batch):
        places = rng.uniform(low, high, (batch, 3))
        points, heights = closest_points(scene.surfaces, places)
        distance = np.linalg.norm(places[:, None] - points, axis=2)
        # behind a plane without end is outside; behind a bounded one is a place as good as another
        endless = np.array([np.isinf([s.length_x, s.length_y]).all() for s in scene.surfaces], bool)
        free = (distance >= radius + gap) & ((heights > 0) | ~endless)
        yield from places[free.all(1)]


def _region(scene: Scene, recipe: StartRecipe, radius: float) -> tuple[Array, Array]:
    """Lowest and highest centre [m] of spheres, shape (3,) each."""
    # the outermost of the level and upright planes bound the region; throws avoid the others
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for plane in scene.surfaces:
        axis = int(np.argmax(np.abs(plane.normal)))
        if plane.normal[axis] > 1 - 1e-9:
            low[axis] = min(low[axis], plane.point[axis] + radius + recipe.gap)
        elif plane.normal[axis] < -1 + 1e-9:
            high[axis] = max(high[axis], plane.point[axis] - radius - recipe.gap)
    low[np.isposinf(low)], high[np.isneginf(high)] = -np.inf, np.inf
    low[2], high[2] = max(low[2], recipe.height[0]), min(high[2], recipe.height[1])
    for axis, name in enumerate(('length_x', 'length_y')):
        length = getattr(recipe, name)
        if length is not None:
            bounded = np.isfinite(low[axis]) and np.isfinite(high[axis])
            middle = (low[axis] + high[axis]) / 2 if bounded else 0.0
            low[axis] = max(low[axis], middle - length / 2)
            high[axis] = min(high[axis], middle + length / 2)
        elif not (np.isfinite(low[axis]) and np.isfinite(high[axis])):
            raise SamplingError(
                f'no walls bound the start along {"xy"[axis]}; give {name} in start'
            )
    if (low > high).any():
        axis = int(np.argmax(low - high))
        raise SamplingError(
            f'no room for a sphere of radius {radius:g} m and a gap of {recipe.gap:g} m along '
            f'{"xyz"[axis]}: the lowest centre is {low[axis]:.4g} m, the highest {high[axis]:.4g} m'
        )
    return low, high


def check_range(name: str, value: tuple[float, float], least: float) -> None:
    """Raise ConfigError where `value` is not a finite [lowest, highest] with lowest >= `least`."""
    low, high = value
    if not (least <= low <= high and np.isfinite(high)):
        bound = '' if least == -np.inf else f' with lowest at least {least:g}'
        raise ConfigError(f'{name} is [{low:g}, {high:g}], expected [lowest, highest]{bound}')
