# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene as one ball meets it: the arrays that `ball_path` takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .ball_contact import LAW, PLANE
from .jit import plain
from .start_guess import surface_of_start
from ..scenes.air import Air
from ..scenes.contact_law import ContactLaw
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array

_VACUUM = Air(density=0.0, drag_coefficient=0.0)


@dataclass(frozen=True)
class BallModel:
    """Laws of one ball.

    Args:
        ball: Flight and inertia factor, shape (1, 14).
        planes: Shape (planes, 14).
        laws: Shape (planes, 8).
    """

    ball: Array
    planes: Array
    laws: Array

    @property
    def radius(self) -> float:
        """Radius [m]."""
        return float(self.ball[0, 7])

    @property
    def gravity(self) -> Array:
        """Acceleration of a ball at rest in still air [m/s^2], shape (3,)."""
        return self.ball[0, :3]

    @classmethod
    def of(cls, scene: Scene, sphere: int = 0, count: int = 1) -> BallModel:
        """Model of one of `count` spheres of a scene, without surfaces that change place."""
        scene = scene.of_fixed_surfaces()
        one = {
            name: scene.per_sphere(name, count)[sphere : sphere + 1]
            for name in ('radius', 'mass', 'inertia_factor')
        }
        air = scene.air or _VACUUM
        flight = air.flight(one['radius'], one['mass'], scene.gravity)
        laws = [law_row(scene, plane, sphere, count) for plane in scene.surfaces]
        return cls(
            plain(np.column_stack([flight, one['inertia_factor']])),
            plane_rows(scene.surfaces),
            np.array(laws).reshape(-1, len(LAW)),
        )


def law_row(scene: Scene, plane: Plane, sphere: int, count: int) -> list[float]:
    """Law of a surface and a sphere, see `LAW`: the surface's own, or products of materials."""
    law = plane.contact
    if law is None:
        own = {
            name: float(scene.per_sphere(name, count)[sphere])
            for name in ('restitution', 'friction', 'rolling_friction')
        }
        index = scene.surfaces.index(plane)
        law = ContactLaw(
            restitution=own['restitution'] * float(scene.surface_values('restitution')[index]),
            friction=own['friction'] * float(scene.surface_values('friction')[index]),
            rolling_friction=own['rolling_friction'],
        )
    curve = law.curve
    rest = [float(getattr(law, name)) for name in LAW[3:]]
    return [curve.slow, curve.fast, curve.speed, *rest]


def plane_rows(planes: tuple[Plane, ...]) -> Array:
    """Planes as rows of numbers, shape (planes, 14)."""
    rows = np.zeros((len(planes), PLANE))
    for row, plane in zip(rows, planes, strict=True):
        row[:3], row[3:12] = plane.point, plane.axes.ravel()
        row[12:] = plane.length_x / 2, plane.length_y / 2
    return rows


def surface_under(model: BallModel, times: Array, positions: Array, noise: float) -> int:
    """Surface that a ball is on in the first frames of a window, or FREE; `surface_of_start`."""
    return surface_of_start(model.ball, model.planes, plain(times), plain(positions), noise)
