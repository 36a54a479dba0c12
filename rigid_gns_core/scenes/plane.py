# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bounded planes, and the checks of values that planes and scenes share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .contact_law import checked_law, ContactLaw
from .planned_motion import PlannedMotion
from .state import Array, as_unit, LARGEST, UNIT
from .values import checked_floats, checked_number
from ..errors import shown, UserError

# distance up to which an end of a surface is on another one, as part of its length
_ON = 1e-6

PerSphere = float | tuple[float, ...]
Vector = tuple[float, float, float]

_STILL: Vector = (0.0, 0.0, 0.0)
MOTIONS = ('velocity', 'angular_velocity', 'surface_velocity')
# share of a surface velocity that may lead out of the plane: rounding
_ALONG = 1e-6

SOLID = 0.4
"""Inertia factor of a solid sphere."""

# name: (lowest, highest, lowest is allowed)
RANGES = {
    'radius': (0.0, LARGEST, False),
    'mass': (0.0, LARGEST, False),
    'restitution': (0.0, 1.0, True),
    'friction': (0.0, np.inf, True),
    'rolling_friction': (0.0, np.inf, True),
    'inertia_factor': (0.0, 0.67, False),  # a thin shell has 2/3, and no sphere has more
}


def checked_property(name: str, value: ArrayLike) -> PerSphere:
    """Property as a number, or as a tuple with one per sphere; UserError where out of range."""
    array = checked_floats(name, value)
    if array.ndim > 1 or array.size == 0:
        raise UserError(f'{name} has shape {array.shape}, expected a number or one per sphere')
    low, high, closed = RANGES[name]
    bad = ~((array >= low if closed else array > low) & (array <= high) & np.isfinite(array))
    if bad.any():
        offender = np.atleast_1d(array)[np.atleast_1d(bad)][0]
        bound = f'{"at least" if closed else "greater than"} {low:g}'
        bound += '' if high == np.inf else f' and at most {high:g}'
        raise UserError(f'{name} is {offender:g}, expected {bound}')
    return float(array) if array.ndim == 0 else tuple(array.tolist())


def checked_vector(name: str, value: ArrayLike) -> Vector:
    """Vector of three finite numbers; UserError for anything else."""
    array = checked_floats(name, value)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise UserError(f'{name} is {shown(value)}, expected three finite numbers')
    if np.abs(array).max() > LARGEST:
        raise UserError(f'{name} is {value}, expected numbers of at most {LARGEST:g}')
    return tuple(array.tolist())


def checked_unit(name: str, value: ArrayLike) -> Vector:
    """Vector of length 1 along one of three numbers; UserError for anything else, and for 0."""
    vector = np.asarray(checked_vector(name, value))
    if np.linalg.norm(vector) < 1e-9:
        raise UserError(f'{name} is {value}, expected a vector that is not zero')
    return tuple(as_unit(vector).tolist())


@dataclass(frozen=True)
class Plane:
    """A bounded plane (thesis section 3.1.2), at rest or in motion.

    With both lengths infinite it is a half-space: it bounds a body, and spheres are on the side of
    its normal. With an end, on one axis (a strip) or on both (a plate), it has two faces: spheres
    may be on either side, and it does not act beyond its ends.

    Args:
        point: Centre p_s [m], world frame.
        normal: Normal n_s; normalised here.
        direction: Reference direction d_s, the plane's own x axis; made orthogonal to the normal
            and normalised here. None: any direction in the plane.
        length_x: Full length along `direction` [m]; may be infinite.
        length_y: Full length along normal x direction [m]; may be infinite.
        restitution: Coefficient of restitution of the surface; None: the scene's.
        friction: Coulomb friction coefficient of the surface; None: the scene's.
        contact: Law of the contacts of this surface and any sphere, instead of both and of
            products with those of the sphere; None: these.
        velocity: Of `point` [m/s], world frame: a racket, a tray. The plane is at `point` when a
            rollout starts, and keeps its twist.
        angular_velocity: About `point` [rad/s], world frame.
        surface_velocity: Of the surface along itself while the plane stays, a belt [m/s], world
            frame; it turns with the plane.
        plan: Motion of the body that carries it, from where it is at time 0; `velocity` and
            `angular_velocity` do not count then. None: it keeps its twist.

    Raises:
        UserError: A vector is zero, direction is parallel to normal, a value is out of range, or a
            surface velocity leads out of the plane.
    """

    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)
    direction: Vector | None = None
    length_x: float = np.inf
    length_y: float = np.inf
    restitution: float | None = None
    friction: float | None = None
    contact: ContactLaw | None = None
    velocity: Vector = _STILL
    angular_velocity: Vector = _STILL
    surface_velocity: Vector = _STILL
    plan: PlannedMotion | None = None

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        for name in MOTIONS:
            value = checked_vector(f'{name} of a plane', getattr(self, name))
            set_field(self, name, value)
        set_field(self, 'point', checked_vector('point of a plane', self.point))
        set_field(self, 'normal', checked_unit('normal of a plane', self.normal))
        normal = np.asarray(self.normal)
        direction = self.direction
        if direction is None:
            direction = np.eye(3)[int(np.argmin(np.abs(normal)))]
        direction = np.asarray(checked_unit('direction of a plane', direction))
        while abs(along := direction @ normal) > UNIT:  # else the same bits again, see `as_unit`
            direction = direction - along * normal
            if np.linalg.norm(direction) < 1e-6:
                raise UserError(
                    'direction of a plane is parallel to its normal; choose one across it'
                )
            direction = np.asarray(checked_unit('direction of a plane', direction))
        set_field(self, 'direction', tuple(direction.tolist()))
        for name in ('length_x', 'length_y'):
            length = checked_floats(f'{name} of a plane', getattr(self, name))
            if length.ndim or not length > 0:
                found = shown(getattr(self, name)) if length.ndim else f'{length:g}'
                raise UserError(f'{name} of a plane is {found}, expected more than 0')
            set_field(self, name, float(length))
        for name in ('restitution', 'friction'):
            value = getattr(self, name)
            if value is not None:
                low, high, _ = RANGES[name]
                set_field(self, name, checked_number(name, value, low, high))
        out = float(np.dot(self.surface_velocity, self.normal))
        if abs(out) > _ALONG * float(np.linalg.norm(self.surface_velocity)):
            raise UserError(
                f'surface_velocity of a plane is {self.surface_velocity}, with {out:g} m/s along '
                f'its normal; a belt moves along itself, velocity moves the plane'
            )
        if checked_law('contact of a plane', self.contact) is not None:
            for name in ('restitution', 'friction'):
                if getattr(self, name) is not None:
                    raise UserError(
                        f'a plane has {name} and a contact law, which holds as it stands; leave '
                        f'{name} out, or give the law that value'
                    )

    @cached_property
    def axes(self) -> Array:
        """Rows: direction, normal x direction, normal; shape (3, 3), read-only."""
        direction, normal = np.asarray(self.direction), np.asarray(self.normal)
        axes = np.stack([direction, np.cross(normal, direction), normal])
        axes.setflags(write=False)
        return axes

    @cached_property
    def half_lengths(self) -> Array:
        """Half lengths along the first two `axes` [m], shape (2,), read-only."""
        half = np.array([self.length_x, self.length_y]) / 2
        half.setflags(write=False)
        return half

    @property
    def moves(self) -> bool:
        """Whether it, or its surface, is in motion."""
        return self.plan is not None or any(getattr(self, name) != _STILL for name in MOTIONS)

    @property
    def changes_place(self) -> bool:
        """Whether it moves, other than as a belt."""
        moving = self.velocity != _STILL or self.angular_velocity != _STILL
        return moving or self.plan is not None

    def at_rest(self) -> Plane:
        """This plane where it is now, without its motion."""
        still: dict[str, Any] = dict.fromkeys(MOTIONS, _STILL)
        return replace(self, plan=None, **still) if self.moves else self

    @property
    def is_half_space(self) -> bool:
        """Whether it has no end, and so one face; a strip or a plate has two."""
        return bool(np.isinf(self.half_lengths).all())

    @classmethod
    def box(
        cls,
        length_x: float,
        length_y: float,
        height: float = np.inf,
        *,
        restitution: float | None = None,
        friction: float | None = None,
        contact: ContactLaw | None = None,
    ) -> tuple[Plane, ...]:
        """Ground at z = 0 and four walls around the origin, the thesis' training scene.

        Args:
            length_x: Inner length along x [m].
            length_y: Inner length along y [m].
            height: Height of the walls [m]; infinite by default.
            restitution: Of all five; None: the scene's.
            friction: Of all five; None: the scene's.
            contact: Of all five, see `Plane`.
        """
        for name, value in (('length_x', length_x), ('length_y', length_y), ('height', height)):
            if not value > 0 or (name != 'height' and value == np.inf):
                raise UserError(f'{name} of the box is {value:g}, expected more than 0 and finite')
        x, y = length_x / 2, length_y / 2
        z = height / 2 if np.isfinite(height) else 0.0
        up, materials = (0.0, 0.0, 1.0), (restitution, friction, contact)

        def wall(point: Vector, normal: Vector, width: float) -> Plane:
            # a wall's y axis is normal x direction: with `up` as direction, x runs upwards
            return cls(point, normal, up, height, width, *materials)

        return (
            cls((0.0, 0.0, 0.0), up, (1.0, 0.0, 0.0), np.inf, np.inf, *materials),
            wall((-x, 0.0, z), (1.0, 0.0, 0.0), length_y),
            wall((x, 0.0, z), (-1.0, 0.0, 0.0), length_y),
            wall((0.0, -y, z), (0.0, 1.0, 0.0), length_x),
            wall((0.0, y, z), (0.0, -1.0, 0.0), length_x),
        )


def closest_points(
    surfaces: tuple[Plane, ...], positions: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Closest point of each bounded plane to each position.

    Returns:
        Points [m], shape (n, surfaces, 3), and signed heights (p - p_s) . n_s [m] of the positions
        above the infinite planes, shape (n, surfaces).
    """
    positions = np.asarray(positions, dtype=np.float64)
    points = np.empty((len(positions), len(surfaces), 3))
    heights = np.empty((len(positions), len(surfaces)))
    for index, plane in enumerate(surfaces):
        local = (positions - plane.point) @ plane.axes.T
        heights[:, index] = local[:, 2]
        inside = np.clip(local[:, :2], -plane.half_lengths, plane.half_lengths)
        points[:, index] = np.asarray(plane.point) + inside @ plane.axes[:2]
    return points, heights


def distances(surfaces: tuple[Plane, ...], positions: ArrayLike) -> NDArray[np.float64]:
    """Distance of positions to surfaces [m], shape (n, surfaces).

    That to the closest point of a strip or a plate, from either side. That to a half-space is the
    height above it, negative behind it: what went through it is still in it, however deep.
    """
    positions = np.asarray(positions, dtype=np.float64)
    points, heights = closest_points(surfaces, positions)
    half_spaces = np.array([plane.is_half_space for plane in surfaces], dtype=bool)
    apart = np.linalg.norm(positions[:, None] - points, axis=2)
    return np.asarray(np.where(half_spaces, heights, apart))


@lru_cache(maxsize=64)
def free_ends(surfaces: tuple[Plane, ...]) -> tuple[bool, ...]:
    """Whether each surface has an end that spheres in front of it may meet.

    An end is covered where it is on another surface, or within a half-space, to the front of which
    its own surface is: a wall of `Plane.box` has no free end, a fence has, and so has each face of
    a box seen from outside.
    """
    return tuple(
        any(not _is_covered(end, plane, surfaces) for end in _ends(plane)) for plane in surfaces
    )


def _ends(plane: Plane) -> list[Array]:
    """Middles of the edges [m], two for each axis with an end, shape (3,) each."""
    return [
        np.asarray(plane.point) + side * half * axis
        for half, axis in zip(plane.half_lengths, plane.axes[:2], strict=True)
        for side in (-1.0, 1.0)
        if np.isfinite(half)
    ]


def _is_covered(end: Array, plane: Plane, surfaces: tuple[Plane, ...]) -> bool:
    others = tuple(other for other in surfaces if other is not plane)
    near = _ON * min(plane.length_x, plane.length_y)
    heights = closest_points(others, [plane.point])[1]
    return bool(((distances(others, [end]) <= near) & (heights >= -near)).any())


def seen_from_behind(surfaces: tuple[Plane, ...], positions: ArrayLike) -> NDArray[np.bool_]:
    """Strips and plates of which an end or the back may be met, shape (surfaces,).

    They have free ends, or not all centres [m], shape (n, 3), are in front of them. Engines that
    know only bodies and half-spaces may take any other for the face of one.
    """
    half_spaces = np.array([plane.is_half_space for plane in surfaces], dtype=bool)
    behind = (closest_points(surfaces, positions)[1] <= 0).any(axis=0)
    return ~half_spaces & (behind | np.array(free_ends(surfaces), dtype=bool))
