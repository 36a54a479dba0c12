# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The known surroundings of tracked spheres: surfaces, gravity and radii."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .impacts import Surfaces
from ..scenes.obstacle import Obstacle
from ..scenes.plane import SOLID
from ..scenes.scene import Scene
from ..scenes.state import Array

# of impacts and of rolling [m/s]
_SPEED = 1.0


@dataclass(frozen=True)
class Environment:
    """Surfaces and gravity of a scene, and the radii of its spheres.

    Args:
        surfaces: Surfaces and gravity, for compiled code.
        radius: Radius [m]: one for all spheres, shape (), or one per sphere id, shape (n,).
        obstacles: Obstacles but boxes, whose plates are surfaces.
    """

    surfaces: Surfaces
    radius: Array
    obstacles: tuple[Obstacle, ...] = ()

    @classmethod
    def of(cls, scene: Scene) -> Environment:
        """Environment of a scene; materials that differ between spheres enter by their mean.

        A surface with a contact law has that of it, at the speed `_SPEED`. Without the surfaces
        that change place: only a rollout knows where they are.
        """
        scene = scene.of_fixed_surfaces()
        planes = scene.surfaces
        restitution = scene.surface_values('restitution') * float(np.mean(scene.restitution))
        friction = scene.surface_values('friction') * float(np.mean(scene.friction))
        resistance = float(np.mean(scene.rolling_friction))
        for k, plane in enumerate(planes):
            law = plane.contact
            if law is None:
                continue
            restitution[k], friction[k] = float(law.curve.at(_SPEED)), law.friction
            if np.dot(plane.axes[2], scene.gravity) < 0:  # a ball may roll on it
                resistance = law.rolling_friction + law.rolling_friction_slope * _SPEED
        x, y, z = np.asarray(scene.gravity, dtype=np.float64).tolist()
        surfaces = Surfaces(
            gravity=(x, y, z),
            points=np.array([plane.point for plane in planes]).reshape(-1, 3),
            axes=np.array([plane.axes for plane in planes]).reshape(-1, 3, 3),
            half_lengths=np.array([plane.half_lengths for plane in planes]).reshape(-1, 2),
            two_sided=np.array([not plane.is_half_space for plane in planes], dtype=bool),
            restitution=restitution,
            friction=friction,
            rolling_friction=resistance,
            sphere_restitution=float(np.mean(scene.restitution)) ** 2,
            inertia=float(np.mean(scene.inertia_factor)),
            known=True,
        )
        return cls(surfaces, np.asarray(scene.radius, dtype=np.float64), scene.obstacles)

    @classmethod
    def unknown(cls, gravity: ArrayLike, radius: float) -> Environment:
        """Environment of gravity alone [m/s^2], shape (3,), where no scene is given."""
        x, y, z = np.asarray(gravity, dtype=np.float64).tolist()
        no_points = np.zeros((0, 3))
        surfaces = Surfaces(
            gravity=(x, y, z),
            points=no_points,
            axes=np.zeros((0, 3, 3)),
            half_lengths=np.zeros((0, 2)),
            two_sided=np.zeros(0, dtype=bool),
            restitution=np.zeros(0),
            friction=np.zeros(0),
            rolling_friction=0.0,
            sphere_restitution=1.0,
            inertia=SOLID,
            known=False,
        )
        return cls(surfaces, np.asarray(radius, dtype=np.float64))

    @property
    def gravity(self) -> Array:
        """Acceleration of free flight [m/s^2], shape (3,)."""
        return np.array(self.surfaces.gravity)

    @property
    def known(self) -> bool:
        """Whether the surfaces are known; if not, spheres may be supported anywhere."""
        return self.surfaces.known

    def overlaps_origin(self) -> bool:
        """Whether a sphere at the origin would reach into something by a fifth of its radius."""
        surfaces = self.surfaces
        least = 0.8 * float(self.radius.min())
        for k, point in enumerate(surfaces.points):
            x, y, height = surfaces.axes[k] @ -point
            over = (np.abs([x, y]) <= surfaces.half_lengths[k]).all()
            if over and (abs(height) if surfaces.two_sided[k] else height) < least:
                return True
        return any(one.closest(np.zeros((1, 3)))[0][0] < least for one in self.obstacles)

    def radii(self, ids: NDArray[np.int64]) -> Array:
        """Radius of each sphere [m], shape (n,); an id that the scene lacks gets the largest."""
        if self.radius.ndim == 0:
            return np.full(len(ids), float(self.radius))
        known = (ids >= 0) & (ids < len(self.radius))
        return np.where(
            known, self.radius[np.clip(ids, 0, len(self.radius) - 1)], self.radius.max()
        )
