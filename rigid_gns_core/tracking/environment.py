# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What spheres of a scene can touch, and how they fall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .impacts import Surfaces
from ..scenes.scene import Scene
from ..scenes.state import Array


@dataclass(frozen=True)
class Environment:
    """Surfaces, gravity and radii.

    Args:
        surfaces: And gravity, for compiled code.
        radius: Of the spheres [m]: one for all, or one per sphere id.
    """

    surfaces: Surfaces
    radius: Array

    @classmethod
    def of(cls, scene: Scene) -> Environment:
        """Return that of a scene; materials that differ between spheres enter with their mean."""
        planes = scene.surfaces
        x, y, z = np.asarray(scene.gravity, dtype=np.float64).tolist()
        surfaces = Surfaces(
            gravity=(x, y, z),
            points=np.array([plane.point for plane in planes]).reshape(-1, 3),
            axes=np.array([plane.axes for plane in planes]).reshape(-1, 3, 3),
            halves=np.array([(p.length_x / 2, p.length_y / 2) for p in planes]).reshape(-1, 2),
            restitution=scene.surface_values('restitution') * float(np.mean(scene.restitution)),
            friction=scene.surface_values('friction') * float(np.mean(scene.friction)),
            rolling_friction=float(np.mean(scene.rolling_friction)),
            bounce=float(np.mean(scene.restitution)) ** 2,
            known=True,
        )
        return cls(surfaces, np.asarray(scene.radius, dtype=np.float64))

    @classmethod
    def unknown(cls, gravity: ArrayLike, radius: float) -> Environment:
        """Gravity alone, where no scene is given."""
        x, y, z = np.asarray(gravity, dtype=np.float64).tolist()
        none = np.zeros((0, 3))
        surfaces = Surfaces(
            gravity=(x, y, z),
            points=none,
            axes=np.zeros((0, 3, 3)),
            halves=np.zeros((0, 2)),
            restitution=np.zeros(0),
            friction=np.zeros(0),
            rolling_friction=0.0,
            bounce=1.0,
            known=False,
        )
        return cls(surfaces, np.asarray(radius, dtype=np.float64))

    @property
    def gravity(self) -> Array:
        """Acceleration of free flight [m/s^2], shape (3,)."""
        return np.array(self.surfaces.gravity)

    @property
    def known(self) -> bool:
        """Whether the surfaces are known; without, spheres may be held anywhere."""
        return self.surfaces.known

    def radii(self, ids: NDArray[np.int64]) -> Array:
        """Radius of each sphere [m]; one that the scene does not know has the largest."""
        if self.radius.ndim == 0:
            return np.full(len(ids), float(self.radius))
        known = (ids >= 0) & (ids < len(self.radius))
        return np.where(
            known, self.radius[np.clip(ids, 0, len(self.radius) - 1)], self.radius.max()
        )
