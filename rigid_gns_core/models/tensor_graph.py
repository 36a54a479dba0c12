"""Which bodies are connected, found on a device: the same edges as `rigid_gns_core.graph`.

All pairs of a scene are looked at, n x n numbers per scene: right for the hundreds of spheres of
training scenes on a device made for it, and wrong for prediction, which has a tree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ..scene import Scene
from ..state import Array
from .configs import GNSConfig
from .tensor_features import Links


class SceneTensors(NamedTuple):
    """Surfaces and reaches of scenes; rows of surfaces that a scene does not have are not `there`.

    points: shape (scenes, surfaces, 3); axes: rows direction, normal x direction, normal, shape
    (scenes, surfaces, 3, 3); half: half lengths, shape (scenes, surfaces, 2); there, endless,
    ground: shape (scenes, surfaces); gravity: shape (scenes, 3); epsilon, margin: lengths of
    `Reach`, shape (scenes,).
    """

    points: Tensor
    axes: Tensor
    half: Tensor
    there: Tensor
    endless: Tensor
    ground: Tensor
    gravity: Tensor
    epsilon: Tensor
    margin: Tensor

    @classmethod
    def of(cls, scenes: Sequence[Scene], config: GNSConfig, device: torch.device) -> SceneTensors:
        """Scenes as tensors on a device."""
        shape = len(scenes), max(len(scene.surfaces) for scene in scenes)
        points, axes, half = np.zeros((*shape, 3)), np.zeros((*shape, 3, 3)), np.zeros((*shape, 2))
        there, ground = np.zeros(shape, dtype=bool), np.zeros(shape, dtype=bool)
        for index, scene in enumerate(scenes):
            for surface, plane in enumerate(scene.surfaces):
                points[index, surface] = plane.point
                axes[index, surface] = plane.axes
                half[index, surface] = plane.length_x / 2, plane.length_y / 2
                there[index, surface] = True
                ground[index, surface] = config.ground_edge and surface == scene.ground
        reaches = [config.reach(float(np.max(scene.radius))) for scene in scenes]

        def tensor(array: Array) -> Tensor:
            return torch.from_numpy(array).to(device)

        return cls(
            points=tensor(points),
            axes=tensor(axes),
            half=tensor(half),
            there=torch.from_numpy(there).to(device),
            endless=torch.from_numpy(np.isinf(half).any(axis=2)).to(device),
            ground=torch.from_numpy(ground).to(device),
            gravity=tensor(np.array([scene.gravity for scene in scenes])),
            epsilon=tensor(np.array([reach.epsilon for reach in reaches])),
            margin=tensor(np.array([reach.margin for reach in reaches])),
        )

    def take(self, index: Tensor) -> SceneTensors:
        """Scenes by index, which may repeat."""
        return SceneTensors(*(values[index] for values in self))


class Spheres(NamedTuple):
    """Spheres of scenes side by side: n in all.

    owner: scene of each, shape (n,); first: its first sphere, shape (scenes,); most: spheres of
    the largest scene; radius: shape (n,).
    """

    owner: Tensor
    first: Tensor
    most: int
    radius: Tensor


def connect(
    config: GNSConfig,
    scenes: SceneTensors,
    spheres: Spheres,
    positions: Tensor,
    velocities: Tensor,
    dt: float,
) -> Links:
    """Graph of the step that starts now, of all scenes; positions, velocities: shape (n, 3)."""
    travel = torch.linalg.vector_norm(velocities, dim=1) * dt
    fastest = travel.new_zeros(len(scenes.points))
    fastest = fastest.scatter_reduce(0, spheres.owner, travel, 'amax')
    low, high = _pairs(config, scenes, spheres, positions, velocities * dt, travel, fastest)
    receivers, surfaces, points = _surface_edges(
        config, scenes, spheres, positions, velocities, travel, fastest, dt
    )
    pairs = torch.arange(len(low), device=low.device)
    return Links(
        senders=torch.cat([low, high]),
        receivers=torch.cat([high, low]),
        reverse=torch.cat([pairs + len(low), pairs]),
        surface_receivers=receivers,
        surface_points=points,
        surface_normals=scenes.axes[spheres.owner[receivers], surfaces, 2],
    )


def _pairs(
    config: GNSConfig,
    scenes: SceneTensors,
    spheres: Spheres,
    positions: Tensor,
    moved: Tensor,
    travel: Tensor,
    fastest: Tensor,
) -> tuple[Tensor, Tensor]:
    """Pairs i < j of one scene, sorted; shapes (pairs,) and (pairs,)."""
    owner, radius = spheres.owner, spheres.radius
    largest = torch.zeros_like(fastest).scatter_reduce(0, owner, radius, 'amax')
    furthest = {
        'epsilon': scenes.epsilon,
        'vmax': fastest + scenes.margin,
        'vi': fastest + scenes.margin,
        'swept': 2 * fastest + scenes.margin,
    }[config.connectivity]
    within = (2 * largest + furthest) * (1 + 1e-9)  # a superset; rounding is decided below
    # NaN where a scene has fewer spheres than the largest one: near to nothing
    padded = positions.new_full((len(largest), spheres.most, 3), torch.nan)
    padded[owner, torch.arange(len(owner), device=owner.device) - spheres.first[owner]] = positions
    square = positions.new_zeros(len(largest), spheres.most, spheres.most)
    for axis in padded.unbind(-1):
        square += (axis[:, :, None] - axis[:, None, :]).square()
    scene, i, j = torch.triu(square <= within[:, None, None].square(), 1).nonzero(as_tuple=True)
    low, high = spheres.first[scene] + i, spheres.first[scene] + j
    offset, touching = positions[high] - positions[low], radius[low] + radius[high]
    if config.connectivity == 'swept':
        between = moved[high] - moved[low]
        along = -(offset * between).sum(1) / between.square().sum(1).clamp(min=1e-300)
        offset = offset + along.clamp(0.0, 1.0)[:, None] * between
        limit = scenes.margin[scene]
    elif config.connectivity == 'vi':
        limit = torch.maximum(travel[low], travel[high]) + scenes.margin[scene]
    else:
        limit = furthest[scene]
    near = torch.linalg.vector_norm(offset, dim=1) - touching <= limit
    return low[near], high[near]


def _surface_edges(
    config: GNSConfig,
    scenes: SceneTensors,
    spheres: Spheres,
    positions: Tensor,
    velocities: Tensor,
    travel: Tensor,
    fastest: Tensor,
    dt: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Spheres, surfaces of their scene and closest points [m] of the surface edges."""
    owner, radius = spheres.owner, spheres.radius[:, None]
    own = scenes.take(owner)
    local = _local(own, positions)
    points, gap = _closest(own, positions, local)
    gap = gap - radius
    margin = own.margin[:, None]
    if config.connectivity == 'epsilon':
        near = gap <= own.epsilon[:, None]
    elif config.connectivity == 'vmax':
        near = gap <= fastest[owner][:, None] + margin
    elif config.connectivity == 'vi':
        near = gap <= travel[:, None] + margin
    else:
        ahead = positions + velocities * dt + 0.5 * own.gravity * dt**2
        there = _local(own, ahead)
        near = torch.minimum(gap, _closest(own, ahead, there)[1] - radius) <= margin
        near |= _crosses(own, local, there, radius + margin)
    near = (near | own.ground) & own.there
    receivers, surfaces = near.nonzero(as_tuple=True)
    return receivers, surfaces, points[receivers, surfaces]


def _local(own: SceneTensors, positions: Tensor) -> Tensor:
    """Positions in the axes of each surface, shape (n, surfaces, 3)."""
    return torch.einsum('nsc,nsac->nsa', positions[:, None] - own.points, own.axes)


def _closest(own: SceneTensors, positions: Tensor, local: Tensor) -> tuple[Tensor, Tensor]:
    """Closest points, shape (n, surfaces, 3), and distances: negative behind an endless plane."""
    inside = torch.maximum(torch.minimum(local[..., :2], own.half), -own.half)
    points = own.points + torch.einsum('nsa,nsac->nsc', inside, own.axes[:, :, :2])
    distance = torch.linalg.vector_norm(positions[:, None] - points, dim=-1)
    return points, torch.where(own.endless & (local[..., 2] < 0), -distance, distance)


def _crosses(own: SceneTensors, here: Tensor, there: Tensor, reach: Tensor) -> Tensor:
    """Whether the straight way crosses a plane within `reach` [m] of its rectangle."""
    passes = here[..., 2] * there[..., 2] < 0
    share = here[..., 2] / torch.where(passes, here[..., 2] - there[..., 2], 1.0)
    place = here[..., :2] + share[..., None] * (there[..., :2] - here[..., :2])
    return passes & (place.abs() <= own.half + reach[..., None]).all(-1)
