# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles at rest: fixed spheres, boxes, cylinders, rings and tubes.

A box is six plates. Each other shape is a solid of revolution: the points within its rounding of a
core, a rectangle of the half plane beside its axis, turned about that (`Profile`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .contact_law import ContactLaw
from .plane import checked_unit, checked_vector, Plane, Vector
from .state import Array, LARGEST
from .values import checked_floats
from ..errors import shown, UserError

# angles about the axis, from the half plane of a sphere, in which it may touch a shape with a hole
_THIRDS = (0.0, 2.0 * math.pi / 3.0, -2.0 * math.pi / 3.0)

# lengths that a shape has; all are needed but a thickness, and no other one may be given
_LENGTHS: dict[str, tuple[str, ...]] = {
    'sphere': ('radius',),
    'box': ('size',),
    'cylinder': ('radius', 'length'),
    'ring': ('radius', 'thickness'),
    'tube': ('radius', 'length', 'thickness'),
}


class Profile(NamedTuple):
    """Section of a solid of revolution.

    inner, outer: distances of the core from the axis [m]; half: half its length along the axis
    [m]; rounding: what is within it of the core belongs to the solid [m]; cosine, sine: of the
    angle about the axis from the half plane of a sphere to that of the contact.
    """

    inner: float
    outer: float
    half: float
    rounding: float
    cosine: float = 1.0
    sine: float = 0.0


@dataclass(frozen=True)
class Obstacle:
    """A body at rest, with a hard surface.

    Args:
        shape: sphere, box, cylinder, ring (a wire in a circle: a hoop, the rim of a basket) or
            tube (a wall around a circle, open at both ends: a bin).
        point: Centre [m], world frame.
        axis: Axis of a cylinder, ring or tube, and the third one of a box; normalised here.
        direction: First axis of a box; made orthogonal to `axis`. None: any.
        size: Lengths of a box along `direction`, `axis` x `direction` and `axis` [m].
        radius: Of a sphere or cylinder, and of the middle of a wire or wall [m].
        length: Of a cylinder or tube along its axis [m].
        thickness: Of the wire of a ring, or the wall of a tube, whose rims are round [m].
        restitution: Coefficient of restitution; None: the scene's.
        friction: Coulomb friction coefficient; None: the scene's.
        contact: Law of its contacts with any sphere, see `Plane`.

    Raises:
        UserError: The shape is unknown, a length is missing, is not one of the shape or out of
            range, or a value is none that a `Plane` may have.
    """

    shape: str
    point: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    direction: Vector | None = None
    size: Vector | None = None
    radius: float | None = None
    length: float | None = None
    thickness: float | None = None
    restitution: float | None = None
    friction: float | None = None
    contact: ContactLaw | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.shape, str) or self.shape not in _LENGTHS:
            known = ', '.join(_LENGTHS)
            raise UserError(
                f'shape of an obstacle is {shown(self.shape)}, expected one of {known}'
            )
        what = f'of a {self.shape}'
        own = _LENGTHS[self.shape]
        for name in ('size', 'radius', 'length', 'thickness'):
            value = getattr(self, name)
            if value is None and name in own and name != 'thickness':
                raise UserError(f'{name} {what} is not given; give it [m]')
            if value is not None and name not in own:
                raise UserError(f'{name} is given, but a {self.shape} has none; leave it out')
            if value is None:
                continue
            if name == 'size':
                value = checked_vector(f'size {what}', value)
            else:
                value = checked_floats(f'{name} {what}', value)
                if value.ndim:
                    raise UserError(f'{name} {what} has shape {value.shape}, expected a number')
                value = float(value)
            least, most = np.min(value), np.max(value)
            if not (least > 0 or (name == 'thickness' and least == 0)) or not most <= LARGEST:
                bound = 'at least' if name == 'thickness' else 'more than'
                raise UserError(f'{name} {what} is {value}, expected {bound} 0 and finite')
            object.__setattr__(self, name, value)
        if self._rounding >= (self.radius or np.inf) and self.shape != 'sphere':
            raise UserError(
                f'thickness {what} is {self.thickness:g} m, expected less than twice its radius '
                f'of {self.radius:g} m'
            )
        object.__setattr__(self, 'point', checked_vector(f'point {what}', self.point))
        object.__setattr__(self, 'axis', checked_unit(f'axis {what}', self.axis))
        _ = self.parts  # all that planes check

    @property
    def _rounding(self) -> float:
        return (self.radius or 0.0) if self.shape == 'sphere' else (self.thickness or 0.0) / 2

    @cached_property
    def axes(self) -> Array:
        """Rows: the first axis, the second one, `axis`; shape (3, 3), read-only."""
        return self._plane(self.point, self.axis, self.direction, 1.0, 1.0).axes

    @cached_property
    def parts(self) -> tuple[tuple[Plane, Profile | None], ...]:
        """What bounds it: plates, or solids about the normal of a plane, with their profiles.

        A shape with a hole is there three times. The plane of a solid gives its place and its
        materials.
        """
        frame = self._plane(self.point, self.axis, self.direction, 1.0, 1.0)
        if self.shape == 'box':
            return tuple((plate, None) for plate in self._plates(frame))
        if not self._profile.inner:
            return ((frame, self._profile),)
        turns = [{'cosine': math.cos(turn), 'sine': math.sin(turn)} for turn in _THIRDS]
        return tuple((frame, self._profile._replace(**turn)) for turn in turns)

    def scaled(self, factor: float) -> Obstacle:
        """So many times as large, and as far from the origin."""
        lengths = {name: getattr(self, name) for name in ('point', 'size')}
        single = {name: getattr(self, name) for name in ('radius', 'length', 'thickness')}
        given: dict[str, Any] = {name: v and factor * v for name, v in single.items()}
        for name, vector in lengths.items():
            given[name] = vector and tuple(factor * value for value in vector)
        return replace(self, **given)

    def closest(self, positions: ArrayLike) -> tuple[Array, Array]:
        """Distance [m] of positions from its surface, negative inside, and normal there.

        Args:
            positions: Shape (n, 3) [m].

        Returns:
            Shapes (n,) and (n, 3); the normal points away from the nearest surface.
        """
        local = (np.asarray(positions, dtype=np.float64) - self.point) @ self.axes.T
        if self.shape == 'box':
            core, sides = local, np.array([[-x / 2, x / 2] for x in self._size])
        else:
            far = np.hypot(local[:, 0], local[:, 1])
            core = np.stack([far, local[:, 2]], axis=1)
            inner, outer, half = self._profile[:3]
            sides = np.array([[inner, outer], [-half, half]])
        away = core - np.clip(core, *sides.T)
        distance = np.linalg.norm(away, axis=1)
        depths = np.abs(sides[None] - core[..., None])
        depths[:, :, 0][:, sides[:, 0] == 0] = np.inf  # the axis is no side
        inside, rows = distance == 0, np.arange(len(core))
        axis, side = np.divmod(depths.reshape(len(core), -1).argmin(axis=1), 2)
        away[inside, axis[inside]] = 2.0 * side[inside] - 1.0
        away /= np.linalg.norm(away, axis=1)[:, None]
        distance = np.where(inside, -depths[rows, axis, side], distance) - self._rounding
        if self.shape != 'box':
            angles = np.arctan2(local[:, 1], local[:, 0])
            x, y = away[:, 0] * np.cos(angles), away[:, 0] * np.sin(angles)
            away = np.column_stack([x, y, away[:, 1]])
        return distance, away @ self.axes

    @property
    def _profile(self) -> Profile:
        radius, half = self.radius or 0.0, (self.length or 0.0) / 2
        if self.shape == 'sphere':
            return Profile(0.0, 0.0, 0.0, radius)
        if self.shape == 'cylinder':
            return Profile(0.0, radius, half, 0.0)
        return Profile(radius, radius, half, self._rounding)

    def _plates(self, frame: Plane) -> list[Plane]:
        plates = []
        for axis in range(3):
            x, y = (axis + 1) % 3, (axis + 2) % 3
            for side in (-1.0, 1.0):
                normal = side * frame.axes[axis]
                point = np.asarray(self.point) + 0.5 * self._size[axis] * normal
                plates.append(
                    self._plane(
                        tuple(point.tolist()), tuple(normal.tolist()),
                        tuple(frame.axes[x].tolist()), self._size[x], self._size[y],
                    )
                )  # fmt: skip
        return plates

    @property
    def _size(self) -> Vector:
        assert self.size is not None  # of a box
        return self.size

    def _plane(
        self,
        point: Vector,
        normal: Vector,
        direction: Vector | None,
        length_x: float,
        length_y: float,
    ) -> Plane:
        return Plane(
            point, normal, direction, length_x, length_y,
            self.restitution, self.friction, self.contact,
        )  # fmt: skip
