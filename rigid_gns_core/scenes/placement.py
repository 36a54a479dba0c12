# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the spheres of a start are: at random, on a floor, in blocks, or at given places."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from .plane import distances
from .scene import Scene
from .state import Array
from ..errors import UserError

if TYPE_CHECKING:
    from .start import StartRecipe

# throws after which a sphere is taken to have no place
_THROWS = 2000
# overlap [radii] up to which spheres count as touching
_TOLERANCE = 1e-6
# share of the throws onto a floor that touch an earlier sphere, where the gap may be 0
_TOUCHING = 0.3


class SamplingError(UserError):
    """The spheres asked for do not fit."""


def place_spheres(
    scene: Scene, recipe: StartRecipe, radii: Array, rng: np.random.Generator
) -> Array:
    """Centres [m] by the recipe, shape (n, 3).

    Raises:
        SamplingError: See `sample_start`.
    """
    if recipe.blocks or recipe.at:
        return _given(scene, recipe, radii)
    if recipe.layout == 'floor':
        return _on_floor(scene, recipe, radii, rng)
    if recipe.layout == 'blocks':
        return _in_blocks(scene, recipe, radii, rng)
    return _scattered(scene, recipe, radii, rng)


def _scattered(scene: Scene, recipe: StartRecipe, radii: Array, rng: np.random.Generator) -> Array:
    low, high = _region(scene, recipe, float(radii.max()), recipe.height)
    positions = np.empty((recipe.spheres, 3))
    cell = 2 * float(radii.max()) + recipe.gap
    near: dict[tuple[int, ...], list[int]] = {}
    # large ones first: between small ones they would find no place
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
    return positions


def _on_floor(scene: Scene, recipe: StartRecipe, radii: Array, rng: np.random.Generator) -> Array:
    """Spheres that rest on the ground; shape (n, 3)."""
    floor, height = _floor(scene)
    low, high = _region(scene, recipe, float(radii.max()), (-np.inf, np.inf))
    positions = np.empty((recipe.spheres, 3))
    order = np.argsort(-radii, kind='stable')  # as for scattered ones
    for done, sphere in enumerate(order):
        others, radius = order[:done], radii[sphere]
        for _ in range(_THROWS):
            place = np.append(rng.uniform(low[:2], high[:2]), height + radius)
            if done and recipe.gap == 0 and rng.random() < _TOUCHING:
                neighbour = others[rng.integers(done)]
                angle = rng.uniform(0, 2 * np.pi)
                # two spheres on one floor touch where their points on the floor are this far apart
                reach = 2 * np.sqrt(radius * radii[neighbour])
                place[:2] = positions[neighbour, :2] + reach * np.array(
                    [np.cos(angle), np.sin(angle)]
                )
            inside = (place[:2] >= low[:2]).all() and (place[:2] <= high[:2]).all()
            if (
                not inside
                or _nearest(positions[others], radii[others], place, radius) < recipe.gap
            ):
                continue
            if _is_clear(scene, place[None], radius, recipe.gap, floor):
                break
        else:
            raise SamplingError(
                f'only {done} of {recipe.spheres} spheres found a place on a floor of '
                f'{high[0] - low[0]:.3g} x {high[1] - low[1]:.3g} m; '
                'use fewer spheres, a smaller gap or a larger box'
            )
        positions[sphere] = place
    return positions


def _in_blocks(scene: Scene, recipe: StartRecipe, radii: Array, rng: np.random.Generator) -> Array:
    """One to four blocks of touching spheres, the last one incomplete; shape (n, 3)."""
    radius, count = float(radii[0]), recipe.spheres
    if not (radii == radius).all():
        raise SamplingError(
            f'blocks need equal radii, but these go from {radii.min():g} to {radii.max():g} m; '
            'give one radius, or another layout'
        )
    floor, ground = _floor(scene)
    low, high = _region(scene, recipe, radius, (-np.inf, np.inf))
    blocks = int(rng.integers(1, min(4, count), endpoint=True))
    each = -(-count // blocks)
    side = next(n for n in range(1, each + 1) if n**3 >= each)
    grid = np.array(list(np.ndindex(side, side, side)), dtype=np.float64)[:each, ::-1]
    grid[:, :2] -= (side - 1) / 2
    positions = np.empty((0, 3))
    while len(positions) < count:
        block = 2 * radius * grid[: count - len(positions)]
        for _ in range(_THROWS):
            middle = np.append(rng.uniform(low[:2], high[:2]), ground + radius)
            yaw, hangs = rng.uniform(0, 2 * np.pi), rng.random() < 0.5
            if hangs:
                middle[2] = max(middle[2], rng.uniform(*recipe.height))
            turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
            places = middle + np.column_stack([block[:, :2] @ turn, block[:, 2]])
            inside = (places[:, :2] >= low[:2]).all() and (places[:, :2] <= high[:2]).all()
            if not (inside and _is_clear(scene, places, radius, recipe.gap, floor)):
                continue
            apart = np.linalg.norm(positions[:, None] - places, axis=2) - 2 * radius
            if apart.min(initial=np.inf) >= recipe.gap:
                break
        else:
            raise SamplingError(
                f'only {len(positions)} of {count} spheres found a place, in blocks {side} wide '
                f'on a floor of {high[0] - low[0]:.3g} x {high[1] - low[1]:.3g} m; '
                'use fewer spheres, a smaller gap or a larger box'
            )
        positions = np.concatenate([positions, places])
    return positions


def _given(scene: Scene, recipe: StartRecipe, radii: Array) -> Array:
    """Centres [m] that the recipe gives, checked for overlaps; shape (n, 3)."""
    positions = np.concatenate(
        [*(block.positions for block in recipe.blocks), np.reshape(recipe.at, (-1, 3))]
    )
    clearance = _clearance(scene, positions, radii)
    worst = np.unravel_index(np.argmin(clearance), clearance.shape) if clearance.size else None
    if worst is not None and clearance[worst] < -_TOLERANCE * radii[worst[0]]:
        raise SamplingError(
            f'sphere {worst[0]} at {_text(positions[worst[0]])} m starts '
            f'{-clearance[worst]:.3g} m deep in surface {worst[1]}; move it'
        )
    for sphere in range(1, len(positions)):
        nearest = _nearest(positions[:sphere], radii[:sphere], positions[sphere], radii[sphere])
        if nearest < -_TOLERANCE * radii[sphere]:
            raise SamplingError(
                f'sphere {sphere} at {_text(positions[sphere])} m starts {-nearest:.3g} m deep in '
                'one before it; move it, or give its block a larger pitch'
            )
    return positions


def _text(place: Array) -> str:
    return '(' + ', '.join(f'{value:g}' for value in place) + ')'


def _nearest(positions: Array, radii: Array, place: Array, radius: float) -> float:
    """Least distance [m] between the surface of a sphere and those of others, inf without any."""
    apart = np.linalg.norm(positions - place, axis=1) - radii - radius
    nearest = float(apart.min(initial=np.inf))
    return 0.0 if abs(nearest) < 1e-9 * radius else nearest  # placed to touch


def _clearance(scene: Scene, places: Array, radii: Array | float) -> Array:
    """Gap [m] to surfaces and then obstacles, negative inside or behind; shape (n, bodies)."""
    obstacles = [obstacle.closest(places)[0] for obstacle in scene.obstacles]
    apart = np.column_stack([distances(scene.surfaces, places), *obstacles])
    return np.asarray(apart - np.reshape(radii, (-1, 1)))


def depths(scene: Scene, places: Array, tilt: float = 0.0) -> Iterator[tuple[str, Array]]:
    """How deep centres are where none can be [m], shape (n,), and in words where that is.

    Behind each endless surface at rest, which may be tilted by up to `tilt` [rad] about its point,
    and inside each obstacle; negative outside.
    """
    for index, plane in enumerate(scene.surfaces):
        if plane.is_half_space:
            along, across, height = plane.axes @ (places - np.asarray(plane.point)).T
            yield f'behind surface {index}', -height - tilt * np.hypot(along, across)
    for index, obstacle in enumerate(scene.obstacles):
        yield f'inside obstacle {index}', -obstacle.closest(places)[0]


def _is_clear(scene: Scene, places: Array, radius: float, gap: float, floor: int) -> bool:
    """Whether spheres keep the gap to all bodies, but may lie on surface `floor`."""
    gaps = np.full(len(scene.fixed_materials), gap)
    gaps[floor] = 0.0
    return bool((_clearance(scene, places, radius) >= gaps - 1e-9 * radius).all())


def _floor(scene: Scene) -> tuple[int, float]:
    """Index and height [m] of the ground, which is level."""
    ground = scene.ground
    if ground is None or scene.surfaces[ground].normal[2] < 1 - 1e-9:
        raise SamplingError('the scene has no level ground to lie on; add one, or scatter spheres')
    return ground, scene.surfaces[ground].point[2]


def _throws(
    scene: Scene, low: Array, high: Array, radius: float, gap: float, rng: np.random.Generator
) -> Iterator[Array]:
    """Places in the region where a sphere clears every surface."""
    batch = 8
    for _ in range(_THROWS // batch):
        places = rng.uniform(low, high, (batch, 3))
        yield from places[(_clearance(scene, places, radius) >= gap).all(1)]


def _region(
    scene: Scene, recipe: StartRecipe, radius: float, height: tuple[float, float]
) -> tuple[Array, Array]:
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
    low[2], high[2] = max(low[2], height[0]), min(high[2], height[1])
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
            f'{"xyz"[axis]}: the lowest centre is {low[axis]:.4g} m, '
            f'the highest {high[axis]:.4g} m'
        )
    return low, high
