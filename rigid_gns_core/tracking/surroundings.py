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

"""What spheres of a scene can touch. Surfaces only, no ROS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .impacts import Surfaces
from ..scenes.scene import Scene
from ..scenes.state import Array


@dataclass(frozen=True)
class Surroundings:
    """Surfaces, gravity and radii.

    Args:
        gravity: Acceleration of free flight [m/s^2], shape (3,).
        radius: Of the spheres [m]: one for all, or one per sphere id.
        points: A point of each surface [m], shape (k, 3).
        axes: Direction, the other direction and normal of each surface, shape (k, 3, 3).
        halves: Half lengths along the two directions [m], shape (k, 2).
        restitution: Of a sphere on each surface, shape (k,).
        friction: Of a sphere on each surface, shape (k,).
        rolling_friction: Of a sphere.
        bounce: Restitution of two spheres.
        known: Whether the surfaces are known; without, spheres may be carried anywhere.
    """

    gravity: Array
    radius: Array
    points: Array
    axes: Array
    halves: Array
    restitution: Array
    friction: Array
    rolling_friction: float = 0.0
    bounce: float = 1.0
    known: bool = True

    @classmethod
    def of(cls, scene: Scene) -> Surroundings:
        """Those of a scene; materials that differ between spheres enter with their mean."""
        surfaces = scene.surfaces
        return cls(
            gravity=np.asarray(scene.gravity, dtype=np.float64),
            radius=np.asarray(scene.radius, dtype=np.float64),
            points=np.array([plane.point for plane in surfaces]).reshape(-1, 3),
            axes=np.array([plane.axes for plane in surfaces]).reshape(-1, 3, 3),
            halves=np.array([(p.length_x / 2, p.length_y / 2) for p in surfaces]).reshape(-1, 2),
            restitution=scene.surface_values('restitution') * float(np.mean(scene.restitution)),
            friction=scene.surface_values('friction') * float(np.mean(scene.friction)),
            rolling_friction=float(np.mean(scene.rolling_friction)),
            bounce=float(np.mean(scene.restitution)) ** 2,
        )

    @classmethod
    def unknown(cls, gravity: ArrayLike, radius: float) -> Surroundings:
        """Gravity alone, where no scene is given."""
        none = np.zeros((0, 3))
        return cls(
            gravity=np.asarray(gravity, dtype=np.float64),
            radius=np.asarray(radius, dtype=np.float64),
            points=none,
            axes=np.zeros((0, 3, 3)),
            halves=np.zeros((0, 2)),
            restitution=np.zeros(0),
            friction=np.zeros(0),
            known=False,
        )

    def radii(self, ids: NDArray[np.int64]) -> Array:
        """Radius of each sphere [m]; one that the scene does not know has the largest."""
        if self.radius.ndim == 0:
            return np.full(len(ids), float(self.radius))
        known = (ids >= 0) & (ids < len(self.radius))
        return np.where(
            known, self.radius[np.clip(ids, 0, len(self.radius) - 1)], self.radius.max()
        )

    @property
    def surfaces(self) -> Surfaces:
        """The same for compiled code."""
        x, y, z = self.gravity.tolist()
        return Surfaces(
            (x, y, z),
            self.points,
            self.axes,
            self.halves,
            self.restitution,
            self.friction,
            self.rolling_friction,
            self.bounce,
            self.known,
        )
