# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene as one ball meets it: the arrays that `ball_path` takes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .ball_contact import LAW
from .ball_surfaces import BELT
from .jit import plain
from .start_guess import surface_of_start
from .surface_rows import fixed_rows, moving_rows, of_rows, Row
from ..scenes.air import Air
from ..scenes.contact_law import ContactLaw
from ..scenes.obstacle import Obstacle
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array

_VACUUM = Air(density=0.0, drag_coefficient=0.0)


@dataclass(frozen=True)
class BallModel:
    """Laws of one ball.

    Args:
        ball: Flight and inertia factor, shape (1, 16).
        planes: Rows of `surface_rows`, shape (planes, PLANE).
        laws: Shape (planes, 8).
        surfaces: Number of surfaces that stay, the first of the rows.
        obstacles: Those of the scene.
    """

    ball: Array
    planes: Array
    laws: Array
    surfaces: int
    obstacles: tuple[Obstacle, ...] = ()

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
        """Model of one of `count` spheres of a scene."""
        one = {
            name: scene.per_sphere(name, count)[sphere : sphere + 1]
            for name in ('radius', 'mass', 'inertia_factor')
        }
        air = scene.air or _VACUUM
        flight = air.flight(one['radius'], one['mass'], scene.gravity)
        stay = tuple(plane for plane in scene.surfaces if not plane.changes_place)
        rows = fixed_rows(stay, scene.obstacles)
        rows += moving_rows(tuple(plane for plane in scene.surfaces if plane.changes_place))
        return cls(
            plain(np.column_stack([flight, one['inertia_factor']])),
            of_rows(rows),
            _laws_of(scene, rows, sphere, count),
            len(stay),
            scene.obstacles,
        )

    def among(
        self, scene: Scene, moving: tuple[Plane, ...], sphere: int = 0, count: int = 1
    ) -> BallModel:
        """The same with planes that change place besides; the other arguments are as of `of`."""
        rows = moving_rows(moving)
        return replace(
            self,
            planes=np.concatenate([self.planes, of_rows(rows)]),
            laws=np.concatenate([self.laws, _laws_of(scene, rows, sphere, count)]),
        )

    def belt(self, on: int) -> Array:
        """Velocity of the belt on a plane at rest, by its row [m/s], shape (3,)."""
        return self.planes[on, BELT : BELT + 3]

    def heights(self, positions: Array) -> Array:
        """Distance of the ball's surface from what stays [m], shape (surfaces + obstacles, m).

        Of a surface as if it had no end.
        """
        found = np.empty((self.surfaces + len(self.obstacles), len(positions)))
        for k, plane in enumerate(self.planes[: self.surfaces]):
            found[k] = (positions - plane[:3]) @ plane[9:12] - self.radius
        for k, obstacle in enumerate(self.obstacles, self.surfaces):
            found[k] = obstacle.closest(positions)[0] - self.radius
        return found


def _laws_of(scene: Scene, rows: list[Row], sphere: int, count: int) -> Array:
    laws = {plane: law_row(scene, plane, sphere, count) for plane, _ in rows}
    return np.array([laws[plane] for plane, _ in rows]).reshape(-1, len(LAW))


def law_row(scene: Scene, plane: Plane, sphere: int, count: int) -> list[float]:
    """Law of a surface and a sphere, see `LAW`: the surface's own, or products of materials."""
    law = plane.contact
    if law is None:
        own = {
            name: float(scene.per_sphere(name, count)[sphere])
            for name in ('restitution', 'friction', 'rolling_friction')
        }
        law = ContactLaw(
            restitution=own['restitution'] * float(scene.values_of('restitution', (plane,))[0]),
            friction=own['friction'] * float(scene.values_of('friction', (plane,))[0]),
            rolling_friction=own['rolling_friction'],
        )
    curve = law.curve
    rest = [float(getattr(law, name)) for name in LAW[3:]]
    return [curve.slow, curve.fast, curve.speed, *rest]


def surface_under(model: BallModel, times: Array, positions: Array, noise: float) -> int:
    """Surface that a ball is on in the first frames of a window, or FREE; `surface_of_start`."""
    return surface_of_start(model.ball, model.planes, plain(times), plain(positions), noise)
