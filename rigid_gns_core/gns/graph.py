# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which spheres and surfaces are connected in a step (thesis section 3.2.1).

"Distance" is the gap between surfaces of bodies, not between centres: with centres, two slow
spheres that touch (2 r apart) would never connect under a radius of V dt. There is no limit to the
number of neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import get_args, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..errors import UserError
from ..scenes.plane import closest_points, free_ends, Plane
from ..scenes.scene import Scene
from ..scenes.state import Array

Connectivity = Literal['epsilon', 'vmax', 'vi', 'swept']
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Reach:
    """How far a step's graph reaches; lengths are absolute [m], in the model's units.

    Args:
        connectivity: `epsilon`: gap below `epsilon`. `vmax`: gap below V_max dt. `vi`: gap below
            the larger V_i dt of the two. `swept`: smallest gap during the step of straight
            relative motion below `margin` (the fewest edges).
        epsilon: Reach of `epsilon` connectivity [m].
        margin: Added to the reach of the other connectivities [m]: covers what V dt leaves out,
            the g dt^2 / 2 that a resting sphere falls when it loses its support.
        ground_edge: Connect every sphere to the ground at any height: gravity can be learned.
    """

    connectivity: Connectivity = 'vi'
    epsilon: float = 0.1
    margin: float = 0.05
    ground_edge: bool = True

    def __post_init__(self) -> None:
        if self.connectivity not in get_args(Connectivity):
            allowed = ', '.join(get_args(Connectivity))
            raise UserError(f'connectivity is {self.connectivity!r}, allowed: {allowed}')
        for name in ('epsilon', 'margin'):
            if not getattr(self, name) >= 0:
                raise UserError(f'{name} is {getattr(self, name)}, expected 0 or more')


@dataclass(frozen=True)
class Graph:
    """Edges of one step. Particle edges come in both directions: edge e and `reverse[e]`.

    Args:
        senders, receivers: Sphere indices of the particle edges, shape (edges,).
        reverse: Index of the opposite edge, shape (edges,).
        surface_receivers: Sphere index of each surface edge, shape (surface_edges,).
        surface_senders: Surface index of each surface edge, shape (surface_edges,).
        surface_points: Closest point p_s of the surface [m], shape (surface_edges, 3).
        surface_normals: Normal n_s of the face on the sphere's side, shape (surface_edges, 3).
    """

    senders: Indices
    receivers: Indices
    reverse: Indices
    surface_receivers: Indices
    surface_senders: Indices
    surface_points: Array
    surface_normals: Array


def build_graph(
    positions: Array, velocities: Array, scene: Scene, dt: float, reach: Reach
) -> Graph:
    """Connect spheres with spheres and with surfaces for the step that starts now.

    Args:
        positions: Centres [m], shape (n, 3).
        velocities: Velocities [m/s], shape (n, 3).
        scene: Surfaces and radii.
        dt: Time step [s].
        reach: Connectivity and its lengths.
    """
    radii = scene.per_sphere('radius', len(positions))
    low, high = sphere_pairs(positions, velocities, radii, dt, reach)
    pairs = len(low)
    order = np.arange(2 * pairs)
    receivers, senders, points = surface_edges(positions, velocities, radii, scene, dt, reach)
    normals = _facing_normals(scene.surfaces, senders, points, positions[receivers])
    return Graph(
        senders=np.concatenate([low, high]),
        receivers=np.concatenate([high, low]),
        reverse=np.where(order < pairs, order + pairs, order - pairs),
        surface_receivers=receivers,
        surface_senders=senders,
        surface_points=points,
        surface_normals=normals,
    )


def sphere_pairs(
    positions: Array, velocities: Array, radii: Array, dt: float, reach: Reach
) -> tuple[Indices, Indices]:
    """Pairs i < j of spheres that are connected, sorted; shapes (pairs,) and (pairs,)."""
    empty = np.zeros(0, dtype=np.int64)
    if len(positions) < 2:
        return empty, empty
    travel = np.linalg.norm(velocities, axis=1) * dt
    fastest = {
        'epsilon': reach.epsilon,
        'vmax': travel.max() + reach.margin,
        'vi': travel.max() + reach.margin,
        'swept': 2 * travel.max() + reach.margin,
    }[reach.connectivity]
    tree = cKDTree(positions)
    pairs = tree.query_pairs(2 * radii.max() + fastest, output_type='ndarray')
    low, high = pairs[:, 0].astype(np.int64), pairs[:, 1].astype(np.int64)
    offset = positions[high] - positions[low]
    touching = radii[low] + radii[high]
    gap = np.linalg.norm(offset, axis=1) - touching
    if reach.connectivity == 'epsilon':
        near = gap <= reach.epsilon
    elif reach.connectivity == 'vmax':
        near = gap <= travel.max() + reach.margin
    elif reach.connectivity == 'vi':
        near = gap <= np.maximum(travel[low], travel[high]) + reach.margin
    else:
        moved = (velocities[high] - velocities[low]) * dt
        near = swept_distance(offset, moved) - touching <= reach.margin
    low, high = low[near], high[near]
    order = np.lexsort((high, low))
    return low[order], high[order]


def swept_distance(offset: Array, moved: Array) -> Array:
    """Smallest distance [m] of `offset + s moved` for s in 0..1, shape (pairs,)."""
    square = np.einsum('ij,ij->i', moved, moved)
    along = -np.einsum('ij,ij->i', offset, moved) / np.maximum(square, 1e-300)
    nearest = offset + np.clip(along, 0.0, 1.0)[:, None] * moved
    distance: Array = np.linalg.norm(nearest, axis=1)
    return distance


def surface_edges(
    positions: Array, velocities: Array, radii: Array, scene: Scene, dt: float, reach: Reach
) -> tuple[Indices, Indices, Array]:
    """Receivers (spheres), senders (surfaces) and closest points [m] of the e surface edges.

    A sphere is connected whichever way it moves, and stays connected while it penetrates.

    Args:
        positions: Centres [m], shape (n, 3).
        velocities: [m/s], shape (n, 3).
        radii: [m], shape (n,).
        scene: Surfaces and gravity.
        dt: Time step [s].
        reach: Which spheres and surfaces are connected.

    Returns:
        Shapes (e,), (e,) and (e, 3).
    """
    points, distance = _closest(scene.surfaces, positions)
    gap = distance - radii[:, None]
    travel = np.linalg.norm(velocities, axis=1) * dt
    if reach.connectivity == 'epsilon':
        near = gap <= reach.epsilon
    elif reach.connectivity == 'vmax':
        near = gap <= (travel.max() if len(travel) else 0.0) + reach.margin
    elif reach.connectivity == 'vi':
        near = gap <= travel[:, None] + reach.margin
    else:
        ahead = positions + velocities * dt + 0.5 * np.asarray(scene.gravity) * dt**2
        ahead_gap = _closest(scene.surfaces, ahead)[1] - radii[:, None]
        near = np.minimum(gap, ahead_gap) <= reach.margin
        near |= _crosses(scene.surfaces, positions, ahead, radii + reach.margin)
    if reach.ground_edge and scene.ground is not None:
        near[:, scene.ground] = True
    receivers, senders = np.nonzero(near)
    return receivers, senders, points[receivers, senders]


def _crosses(
    surfaces: tuple[Plane, ...], positions: Array, ahead: Array, reach: Array
) -> NDArray[np.bool_]:
    """Whether the straight way to `ahead` crosses a plane within `reach` [m] of its rectangle."""
    crosses = np.zeros((len(positions), len(surfaces)), dtype=bool)
    for index, plane in enumerate(surfaces):
        here = (positions - plane.point) @ plane.axes.T
        there = (ahead - plane.point) @ plane.axes.T
        passes = here[:, 2] * there[:, 2] < 0
        share = here[:, 2] / np.where(passes, here[:, 2] - there[:, 2], 1.0)
        place = here[:, :2] + share[:, None] * (there[:, :2] - here[:, :2])
        half = plane.half_lengths
        crosses[:, index] = passes & (np.abs(place) <= half + reach[:, None]).all(axis=1)
    return crosses


def _facing_normals(
    surfaces: tuple[Plane, ...], senders: Indices, points: Array, positions: Array
) -> Array:
    """Normals of surfaces towards the spheres that they act on, shape (edges, 3).

    Args:
        surfaces: The scene's.
        senders: Index of the surface of each edge, shape (edges,).
        points: Its closest point [m], shape (edges, 3).
        positions: Centre of the sphere of each edge [m], shape (edges, 3).
    """
    normals = np.array([plane.normal for plane in surfaces]).reshape(-1, 3)[senders]
    behind = np.einsum('ij,ij->i', positions - points, normals) < 0
    turned = behind & ~_one_faced(surfaces)[senders]
    return np.where(turned[:, None], -normals, normals)


@lru_cache(maxsize=64)
def _one_faced(surfaces: tuple[Plane, ...]) -> NDArray[np.bool_]:
    """Half-spaces, and walls without height whose ends are on other surfaces, as in `Plane.box`.

    Behind these is the outside: a sphere that went through one stays connected, however deep.
    Other strips and plates have two faces, and spheres behind them that have nothing to do with
    them.
    """
    return np.array(
        [
            bool(np.isinf(plane.half_lengths).any()) and not free
            for plane, free in zip(surfaces, free_ends(surfaces), strict=True)
        ],
        dtype=bool,
    )


def _closest(surfaces: tuple[Plane, ...], positions: Array) -> tuple[Array, Array]:
    """Closest points [m], shape (n, surfaces, 3), and distances [m], shape (n, surfaces).

    A distance is negative behind a one-faced surface.
    """
    points, heights = closest_points(surfaces, positions)
    apart: Array = np.linalg.norm(positions[:, None] - points, axis=-1)
    return points, np.where(_one_faced(surfaces) & (heights < 0), -apart, apart)
