"""What does not move in a scene: planes, sphere properties, materials and gravity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .config import from_mapping
from .state import Array

PerSphere = float | tuple[float, ...]
Vector = tuple[float, float, float]

# name: (lowest, highest, lowest is allowed)
_RANGES = {
    'radius': (0.0, np.inf, False),
    'mass': (0.0, np.inf, False),
    'restitution': (0.0, 1.0, True),
    'friction': (0.0, np.inf, True),
    'rolling_friction': (0.0, np.inf, True),
}


def _per_sphere(name: str, value: ArrayLike) -> PerSphere:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim > 1:
        raise ValueError(f'{name} has shape {array.shape}, expected a number or one per sphere')
    low, high, closed = _RANGES[name]
    bad = ~((array >= low if closed else array > low) & (array <= high) & np.isfinite(array))
    if bad.any():
        offender = np.atleast_1d(array)[np.atleast_1d(bad)][0]
        bound = f'{"at least" if closed else "greater than"} {low:g}'
        bound += '' if high == np.inf else f' and at most {high:g}'
        raise ValueError(f'{name} is {offender:g}, expected {bound}')
    return float(array) if array.ndim == 0 else tuple(array.tolist())


def _vector(name: str, value: ArrayLike) -> Vector:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f'{name} is {value}, expected three finite numbers')
    return tuple(array.tolist())


def _unit(name: str, value: ArrayLike) -> Vector:
    vector = np.asarray(_vector(name, value))
    norm = float(np.linalg.norm(vector))
    if norm < 1e-9:
        raise ValueError(f'{name} is {value}, expected a vector that is not zero')
    if abs(norm - 1.0) > 1e-15:  # else the same bits again, for a scene that is read back
        vector = vector / norm
    return tuple(vector.tolist())


@dataclass(frozen=True)
class Plane:
    """A static, bounded plane (thesis section 3.1.2). Spheres live on the side of its normal.

    Args:
        point: Centre p_s [m], world frame.
        normal: Normal n_s; normalised here.
        direction: Reference direction d_s, the plane's own x axis; made orthogonal to the normal
            and normalised here. None: any direction in the plane.
        length_x: Full length along `direction` [m]; may be infinite.
        length_y: Full length along normal x direction [m]; may be infinite.
        restitution: Coefficient of restitution of the surface; None: the scene's.
        friction: Coulomb friction coefficient of the surface; None: the scene's.

    Raises:
        ValueError: A vector is zero, direction is parallel to normal, or a value is out of range.
    """

    point: Vector = (0.0, 0.0, 0.0)
    normal: Vector = (0.0, 0.0, 1.0)
    direction: Vector | None = None
    length_x: float = np.inf
    length_y: float = np.inf
    restitution: float | None = None
    friction: float | None = None

    def __post_init__(self) -> None:
        set_field = object.__setattr__
        set_field(self, 'point', _vector('point of a plane', self.point))
        set_field(self, 'normal', _unit('normal of a plane', self.normal))
        normal = np.asarray(self.normal)
        direction = self.direction
        if direction is None:
            direction = np.eye(3)[int(np.argmin(np.abs(normal)))]
        direction = np.asarray(_unit('direction of a plane', direction))
        direction = direction - normal * (direction @ normal)
        if np.linalg.norm(direction) < 1e-6:
            raise ValueError('direction of a plane is parallel to its normal; choose one across it')
        set_field(self, 'direction', _unit('direction of a plane', direction))
        for name in ('length_x', 'length_y'):
            length = float(getattr(self, name))
            if not length > 0:
                raise ValueError(f'{name} of a plane is {length:g}, expected more than 0')
            set_field(self, name, length)
        for name in ('restitution', 'friction'):
            value = getattr(self, name)
            if value is not None:
                set_field(self, name, float(np.asarray(_per_sphere(name, float(value)))))

    @property
    def axes(self) -> Array:
        """Rows: direction, normal x direction, normal; shape (3, 3)."""
        direction, normal = np.asarray(self.direction), np.asarray(self.normal)
        return np.stack([direction, np.cross(normal, direction), normal])

    @classmethod
    def box(
        cls,
        length_x: float,
        length_y: float,
        height: float = np.inf,
        *,
        restitution: float | None = None,
        friction: float | None = None,
    ) -> tuple[Plane, ...]:
        """Ground at z = 0 and four walls around the origin, the thesis' training scene.

        Args:
            length_x: Inner length along x [m].
            length_y: Inner length along y [m].
            height: Height of the walls [m]; infinite by default.
            restitution: Of all five; None: the scene's.
            friction: Of all five; None: the scene's.
        """
        for name, value in (('length_x', length_x), ('length_y', length_y), ('height', height)):
            if not value > 0:
                raise ValueError(f'{name} of the box is {value:g}, expected more than 0')
        x, y = length_x / 2, length_y / 2
        z = height / 2 if np.isfinite(height) else 0.0
        up = (0.0, 0.0, 1.0)

        def wall(point: Vector, normal: Vector, width: float) -> Plane:
            # a wall's y axis is normal x direction: with `up` as direction, x runs upwards
            return cls(point, normal, up, height, width, restitution, friction)

        return (
            cls((0.0, 0.0, 0.0), up, (1.0, 0.0, 0.0), restitution=restitution, friction=friction),
            wall((-x, 0.0, z), (1.0, 0.0, 0.0), length_y),
            wall((x, 0.0, z), (-1.0, 0.0, 0.0), length_y),
            wall((0.0, -y, z), (0.0, 1.0, 0.0), length_x),
            wall((0.0, y, z), (0.0, -1.0, 0.0), length_x),
        )


@dataclass(frozen=True)
class Scene:
    """Surfaces, sphere properties, materials and gravity.

    Args:
        surfaces: Static planes.
        radius: Radius [m]; a number, or one per sphere (as are the next four).
        mass: Mass [kg]; spheres are solid, moment of inertia 2/5 m r^2.
        restitution: Coefficient of restitution of the material, 0 to 1.
        friction: Coulomb friction coefficient of the material.
        rolling_friction: Dimensionless rho: on a surface with normal force N, a torque rho r N
            resists rolling, so a sphere that rolls on a level floor slows by rho g / 1.4.
        gravity: Acceleration [m/s^2], world frame.

    Restitution and friction of a pair are the product of the two values, as in Bullet: two spheres
    of restitution 0.6 collide with 0.36. A plane without a value of its own has the scene's (the
    mean where the scene gives one per sphere).

    Raises:
        ValueError: A value is out of range.
    """

    surfaces: tuple[Plane, ...] = (Plane(),)
    radius: PerSphere = 1.0
    mass: PerSphere = 1.0
    restitution: PerSphere = 0.6
    friction: PerSphere = 0.5
    rolling_friction: PerSphere = 0.02
    gravity: Vector = (0.0, 0.0, -9.81)

    def __post_init__(self) -> None:
        surfaces = (self.surfaces,) if isinstance(self.surfaces, Plane) else tuple(self.surfaces)
        for surface in surfaces:
            if not isinstance(surface, Plane):
                raise ValueError(f'surfaces holds {surface!r}, expected only Plane')
        object.__setattr__(self, 'surfaces', surfaces)
        for name in _RANGES:
            object.__setattr__(self, name, _per_sphere(name, getattr(self, name)))
        gravity = self.gravity
        if np.ndim(gravity) == 0:
            gravity = (0.0, 0.0, -float(np.asarray(gravity)))
        object.__setattr__(self, 'gravity', _vector('gravity', gravity))

    @property
    def sphere_count(self) -> int | None:
        """Number of spheres that a per-sphere property implies; None where all are scalars."""
        counts = {len(v) for name in _RANGES if isinstance(v := getattr(self, name), tuple)}
        if len(counts) > 1:
            raise ValueError(f'per-sphere properties differ in length: {sorted(counts)}')
        return counts.pop() if counts else None

    def per_sphere(self, name: str, count: int) -> Array:
        """Property `name` of each of `count` spheres, shape (count,)."""
        value = np.asarray(getattr(self, name), dtype=np.float64)
        if value.ndim and len(value) != count:
            raise ValueError(
                f'{name} is given for {len(value)} spheres, but there are {count}; '
                'give one number, or one per sphere'
            )
        return np.broadcast_to(value, (count,)).copy()

    def surface_values(self, name: str) -> Array:
        """`restitution` or `friction` of each surface, shape (surfaces,)."""
        default = float(np.mean(getattr(self, name)))
        own = [getattr(surface, name) for surface in self.surfaces]
        return np.array([default if value is None else value for value in own])

    @property
    def up(self) -> Array:
        """Unit vector against gravity, shape (3,); z where there is no gravity."""
        gravity = np.asarray(self.gravity)
        norm = np.linalg.norm(gravity)
        return -gravity / norm if norm > 0 else np.array([0.0, 0.0, 1.0])

    @property
    def ground(self) -> int | None:
        """Index of the lowest level surface, None where there is none."""
        up = self.up
        level = [
            (float(np.asarray(plane.point) @ up), index)
            for index, plane in enumerate(self.surfaces)
            if np.asarray(plane.normal) @ up > 1 - 1e-9
        ]
        return min(level)[1] if level else None

    def to_mapping(self) -> dict[str, Any]:
        """Plain numbers, lists and None, as `from_mapping` and JSON take them."""
        mapping: dict[str, Any] = {
            'surfaces': [
                {
                    'point': list(s.point),
                    'normal': list(s.normal),
                    'direction': list(s.direction or ()),
                    'length_x': s.length_x,
                    'length_y': s.length_y,
                    'restitution': s.restitution,
                    'friction': s.friction,
                }
                for s in self.surfaces
            ]
        }
        for name in _RANGES:
            value = getattr(self, name)
            mapping[name] = list(value) if isinstance(value, tuple) else value
        mapping['gravity'] = list(self.gravity)
        for surface in mapping['surfaces']:
            for name in ('length_x', 'length_y'):
                if np.isinf(surface[name]):
                    surface[name] = 'inf'  # JSON has no infinity
        return mapping

    @classmethod
    def from_mapping(cls, mapping: dict[str, Any], where: str = 'scene') -> Scene:
        """Read a scene from YAML or JSON; `box: {length_x, length_y, ...}` may stand for surfaces.

        Raises:
            ValueError: An unknown key, with the allowed ones, or a value out of range.
        """
        mapping = dict(mapping)
        planes: tuple[Plane, ...] = ()
        if 'box' in mapping:
            box = dict(mapping.pop('box'))
            allowed = {'length_x', 'length_y', 'height', 'restitution', 'friction'}
            if unknown := set(box) - allowed:
                raise ValueError(
                    f'{where}.box: unknown key {sorted(unknown)}, allowed: {sorted(allowed)}'
                )
            planes = Plane.box(**{key: float(value) for key, value in box.items()})
        if 'surfaces' in mapping or planes:
            planes += tuple(
                from_mapping(Plane, plane, f'{where}.surfaces[{index}]')
                for index, plane in enumerate(mapping.pop('surfaces', ()))
            )
            mapping['surfaces'] = planes
        return from_mapping(cls, mapping, where)


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
        half = np.array([plane.length_x, plane.length_y]) / 2
        inside = np.clip(local[:, :2], -half, half)
        points[:, index] = np.asarray(plane.point) + inside @ plane.axes[:2]
    return points, heights
