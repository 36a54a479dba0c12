# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Dynamic similarity: any radius and gravity in the units of a model (Froude scaling).

But for materials, which have no units and carry over, motion depends on g dt^2 / r alone. With
the scales of length L = r / r_m and time T = sqrt(L g_m / g), m for the model, and the rotation R
that turns gravity to -z:

    p_m = R p / L,  v_m = R v T / L,  w_m = R w T,  dt = dt_m T.

Masses carry over, so that the density of air becomes rho L^3, its wind scales as velocities, and
its spin decay as 1 / T; the coefficients of drag and lift have no units. Of a contact law, only
the speed of a restitution curve and the slope of rolling friction have units.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from .air import Air
from .contact_law import ContactLaw
from .obstacle import Obstacle
from .plane import Vector
from .planned_motion import Moments, PlannedMotion
from .scene import Plane, Scene
from .state import Array, as_unit, LARGEST, quaternion_multiply, State
from ..errors import UserError


@dataclass(frozen=True)
class ModelUnits:
    """Radius [m], gravity [m/s^2] and time step [s] that a model was made for."""

    radius: float
    gravity: float
    dt: float

    def __post_init__(self) -> None:
        for name in ('radius', 'gravity', 'dt'):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise UserError(f'{name} is {getattr(self, name)}, expected a positive number')


@dataclass(frozen=True)
class Similarity:
    """Maps a scene and its states to a model's units and back.

    Args:
        length: L, length of the world per length of the model.
        time: T, time of the world per time of the model.
        rotation: Rows are the model's axes in the world frame, shape (3, 3).
        quaternion: The same rotation, world to model, (x, y, z, w).
    """

    length: float
    time: float
    rotation: Array
    quaternion: Array

    @classmethod
    def between(cls, scene: Scene, units: ModelUnits) -> Similarity:
        """Similarity of `scene` to a model, whose radius is that of the largest sphere.

        Without gravity, which sets the scale of time, the scene's is taken to be the model's.
        """
        gravity = float(np.linalg.norm(scene.gravity)) or units.gravity
        length = float(np.max(scene.radius)) / units.radius
        time = float(np.sqrt(length * units.gravity / gravity))
        return cls(length, time, *_upright(scene.up))

    def scene(self, scene: Scene) -> Scene:
        """Scene in the model's units."""
        surfaces = tuple(
            replace(
                plane,
                point=tuple(self.rotation @ plane.point / self.length),
                normal=tuple(self.rotation @ plane.normal),
                direction=tuple(self.rotation @ plane.axes[0]),
                length_x=plane.length_x / self.length,
                length_y=plane.length_y / self.length,
                contact=self._law(plane.contact),
                velocity=self._velocity(plane.velocity),
                angular_velocity=self._turned(plane.angular_velocity, self.time),
                surface_velocity=self._velocity(plane.surface_velocity),
                plan=plane.plan and self._plan(plane.plan),
            )
            for plane in scene.surfaces
        )
        gravity = np.asarray(scene.gravity) * self.time**2 / self.length
        return replace(
            scene,
            surfaces=tuple[Plane, ...](surfaces),
            gravity=tuple(self.rotation @ gravity),
            radius=_divide(scene.radius, self.length),
            obstacles=tuple(self._obstacle(obstacle) for obstacle in scene.obstacles),
            air=None if scene.air is None else self._air(scene.air),
            sphere_contact=self._law(scene.sphere_contact),
            tracker=None,  # of the world, and of no part in motions
        )

    def _obstacle(self, obstacle: Obstacle) -> Obstacle:
        near = obstacle.scaled(1.0 / self.length)
        return replace(
            near,
            point=self._turned(near.point, 1.0),
            axis=self._turned(near.axis, 1.0),
            direction=near.direction and self._turned(near.direction, 1.0),
            contact=self._law(near.contact),
        )

    def _plan(self, plan: PlannedMotion) -> PlannedMotion:
        moved = self.to_model(State.unchecked(**plan.moments._asdict()))
        return PlannedMotion.of(np.array(plan.times) / self.time, Moments(**vars(moved)))

    def _velocity(self, velocity: Vector) -> Vector:
        return self._turned(velocity, self.time / self.length)

    def _turned(self, vector: Vector, scale: float) -> Vector:
        x, y, z = (self.rotation @ vector * scale).tolist()
        return x, y, z

    def _law(self, law: ContactLaw | None) -> ContactLaw | None:
        return None if law is None else law.scaled(self.time / self.length)

    def _air(self, air: Air) -> Air:
        return replace(
            air,
            density=air.density * self.length**3,
            wind=self._velocity(air.wind),
            spin_decay=air.spin_decay * self.time,
            crisis_speed=air.crisis_speed * self.time / self.length,
        )

    def to_model(self, state: State) -> State:
        """State of the world in the model's units; fields may have more axes before (n, k)."""
        turn = self.rotation.T
        turned = state.quaternions + 0.0  # a copy, as of the next
        if self.quaternion[3] < 1.0:
            turned = quaternion_multiply(self.quaternion, turned)
        fields = {
            'positions': state.positions @ turn / self.length,
            'quaternions': as_unit(turned),
            'velocities': state.velocities @ turn * (self.time / self.length),
            'angular_velocities': state.angular_velocities @ turn * self.time,
        }
        if state.positions.ndim > 2 or all(
            np.abs(fields[name]).max(initial=0.0) <= LARGEST
            for name in ('positions', 'velocities', 'angular_velocities')
        ):
            return State.unchecked(**fields)
        return State(**fields)  # says which value is too large

    def to_world(self, state: State, *, in_place: bool = False) -> State:
        """State of the model in the world's units; inverse of `to_model`.

        `in_place`: in its own arrays, which many states need not have twice.
        """
        speed, rate = self.length / self.time, 1.0 / self.time
        p, v, w = state.positions, state.velocities, state.angular_velocities
        q, own = state.quaternions, (p, v, w) if in_place else (None, None, None)
        if self.quaternion[3] >= 1.0:  # many small products of matrices take ten times as long
            return State.unchecked(
                np.multiply(p, self.length, out=own[0]),
                q,
                np.multiply(v, speed, out=own[1]),
                np.multiply(w, rate, out=own[2]),
            )
        turn, back = self.rotation, self.quaternion * [-1.0, -1.0, -1.0, 1.0]
        turned = quaternion_multiply(back, q)
        if in_place:
            q[...] = turned
        return State.unchecked(
            np.matmul(p, turn * self.length, out=own[0]),
            q if in_place else turned,
            np.matmul(v, turn * speed, out=own[1]),
            np.matmul(w, turn * rate, out=own[2]),
        )


@lru_cache(maxsize=64)
def in_units(scene: Scene, units: ModelUnits) -> tuple[Similarity, Scene]:
    """Similarity to a model, and the scene in its units; cached, as rollouts share scenes."""
    similarity = Similarity.between(scene, units)
    return similarity, similarity.scene(scene)


def _divide(value: float | tuple[float, ...], by: float) -> float | tuple[float, ...]:
    return tuple(v / by for v in value) if isinstance(value, tuple) else value / by


def _upright(up: Array) -> tuple[Array, Array]:
    """Rotation matrix and quaternion that turn `up` to +z by the shortest way."""
    z = np.array([0.0, 0.0, 1.0])
    axis, cosine = np.cross(up, z), float(up @ z)
    if cosine < -1 + 1e-12:
        quaternion = np.array([1.0, 0.0, 0.0, 0.0])  # half a turn about x
    else:
        quaternion = np.array([*axis, 1.0 + cosine])
        quaternion /= np.linalg.norm(quaternion)
    x, y, z_, w = quaternion
    matrix = np.array(
        [
            [1 - 2 * (y * y + z_ * z_), 2 * (x * y - w * z_), 2 * (x * z_ + w * y)],
            [2 * (x * y + w * z_), 1 - 2 * (x * x + z_ * z_), 2 * (y * z_ - w * x)],
            [2 * (x * z_ - w * y), 2 * (y * z_ + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return matrix, quaternion
