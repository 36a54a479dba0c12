# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What does not move, as tensors: spheres, materials, planes and gravity of one or more scenes.

Body n, one past the last sphere, stands for everything that is fixed: its inverse mass is zero, so
that a contact with a surface is a contact of two bodies like any other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import torch
from torch import Tensor

from ...engine.world import UNIT_GRAVITY, world_of
from ...scenes.scene import Scene

__all__ = ['UNIT_GRAVITY', 'World']


@dataclass(frozen=True)
class World:
    """Static properties in the model's units; n spheres, s planes.

    Args:
        radius: Of spheres and of the fixed body (0), shape (n + 1,).
        inverse_mass: 1 / m, shape (n + 1,).
        inverse_inertia: 1 / (2/5 m r^2), shape (n + 1,).
        restitution, friction, rolling_friction: Of the spheres, shape (n,).
        gravity: Shape (3,).
        point: Of the planes, shape (s, 3).
        axes: Rows direction, normal x direction, normal of each plane, shape (s, 3, 3).
        half: Half lengths along the first two axes, may be infinite, shape (s, 2).
        plate: Planes with an end on all sides, which have two faces, shape (s,).
        surface_restitution, surface_friction: Of the planes, shape (s,).
    """

    radius: Tensor
    inverse_mass: Tensor
    inverse_inertia: Tensor
    restitution: Tensor
    friction: Tensor
    rolling_friction: Tensor
    gravity: Tensor
    point: Tensor
    axes: Tensor
    half: Tensor
    plate: Tensor
    surface_restitution: Tensor
    surface_friction: Tensor

    @property
    def count(self) -> int:
        """Number of spheres n."""
        return len(self.restitution)

    @classmethod
    def of(cls, scene: Scene, count: int, dtype: torch.dtype = torch.float64) -> World:
        """Return the world of `count` spheres in `scene`."""
        values = {}
        for name, array in world_of(scene, count)._asdict().items():
            tensor = torch.from_numpy(array)
            values[name] = tensor if tensor.dtype == torch.bool else tensor.to(dtype)
        return cls(**values)

    @classmethod
    def join(cls, worlds: Sequence[World]) -> World:
        """Worlds side by side, of the same gravity; spheres and planes are numbered through."""
        values = {}
        for field in fields(cls):
            parts = [getattr(world, field.name) for world in worlds]
            if field.name == 'gravity':
                values[field.name] = parts[0]
                continue
            if field.name in ('radius', 'inverse_mass', 'inverse_inertia'):
                parts = [part[:-1] for part in parts] + [parts[0][-1:]]
            values[field.name] = torch.cat(parts)
        return cls(**values)
