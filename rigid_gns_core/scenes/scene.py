# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What does not move in a scene: planes, sphere properties, materials, gravity and air."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .air import Air
from .contact_law import checked_law, ContactLaw
from .obstacle import Obstacle
from .plane import checked_property, checked_vector, MOTIONS, PerSphere, RANGES, SOLID, Vector
from .plane import Plane as Plane
from .state import Array
from .tracker import Tracker
from .values import checked_floats
from ..errors import shown, UserError
from ..files.config import ConfigError, from_mapping, to_mapping


@dataclass(frozen=True)
class _Box:
    """Arguments of `Plane.box` in a file."""

    length_x: float
    length_y: float
    height: float = np.inf
    restitution: float | None = None
    friction: float | None = None
    contact: ContactLaw | None = None


@dataclass(frozen=True)
class Scene:
    """Surfaces, sphere properties, materials and gravity.

    Args:
        surfaces: Planes.
        radius: Radius [m]; a number, or one per sphere (as are the next five).
        mass: Mass [kg].
        restitution: Coefficient of restitution of the material, 0 to 1.
        friction: Coulomb friction coefficient of the material.
        rolling_friction: Dimensionless rho: on a surface with normal force N, a torque rho r N
            resists rolling, so a sphere that rolls on a level floor slows by rho g / (1 + i).
        inertia_factor: i of the moment of inertia i m r^2: 2/5 of a solid sphere, 2/3 of a thin
            shell.
        gravity: Acceleration [m/s^2], world frame; one number means along -z.
        air: Air around the spheres; None: a vacuum.
        sphere_contact: Law of the contacts of two spheres, instead of products; None: these.
        tracker: What was learned of the tracker that watches the scene, and of its balls' spins;
            None: nothing. It has no part in motions.
        obstacles: Bodies at rest that are no planes.

    Restitution and friction of a pair are the product of the two values, as in Bullet: two spheres
    of restitution 0.6 collide with 0.36. A plane without a value of its own has the scene's (the
    mean where the scene has one per sphere). A contact law, of a plane or of spheres, holds for
    its pairs as it stands.

    Raises:
        UserError: A value is out of range.
    """

    surfaces: tuple[Plane, ...] = (Plane(),)
    radius: PerSphere = 1.0
    mass: PerSphere = 1.0
    restitution: PerSphere = 0.6
    friction: PerSphere = 0.5
    rolling_friction: PerSphere = 0.02
    inertia_factor: PerSphere = SOLID
    gravity: Vector = (0.0, 0.0, -9.81)
    air: Air | None = None
    sphere_contact: ContactLaw | None = None
    tracker: Tracker | None = None
    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        planes = self.surfaces
        if not isinstance(planes, (Plane, list, tuple)):
            raise UserError(f'surfaces is {shown(planes)}, expected planes; () for none')
        surfaces = (planes,) if isinstance(planes, Plane) else tuple(planes)
        for surface in surfaces:
            if not isinstance(surface, Plane):
                raise UserError(f'surfaces holds {shown(surface)}, expected planes only')
        object.__setattr__(self, 'surfaces', surfaces)
        obstacles = self.obstacles
        obstacles = (obstacles,) if isinstance(obstacles, Obstacle) else obstacles
        if not isinstance(obstacles, (list, tuple)):
            raise UserError(f'obstacles is {shown(obstacles)}, expected obstacles; () for none')
        for obstacle in obstacles:
            if not isinstance(obstacle, Obstacle):
                raise UserError(f'obstacles holds {shown(obstacle)}, expected obstacles only')
        object.__setattr__(self, 'obstacles', tuple(obstacles))
        for name in RANGES:
            object.__setattr__(self, name, checked_property(name, getattr(self, name)))
        gravity = checked_floats('gravity', self.gravity)
        if gravity.ndim == 0:
            if (size := float(gravity)) < 0:
                raise UserError(f'gravity is {size:g}, expected at least 0, or a vector')
            gravity = np.array([0.0, 0.0, -size])
        object.__setattr__(self, 'gravity', checked_vector('gravity', gravity))
        if self.air is not None and not isinstance(self.air, Air):
            raise UserError(f'air is {shown(self.air)}, expected Air(...), or None for a vacuum')
        if self.tracker is not None and not isinstance(self.tracker, Tracker):
            raise UserError(f'tracker is {shown(self.tracker)}, expected Tracker(...), or None')
        law = checked_law('sphere_contact', self.sphere_contact)
        for name in ('rolling_friction', 'rolling_friction_slope', 'spinning_friction'):
            if law is not None and getattr(law, name) > 0:
                raise UserError(
                    f'{name} of sphere_contact is {getattr(law, name):g}, but only surfaces '
                    'resist rolling and spinning here; leave it at 0'
                )

    @property
    def sphere_count(self) -> int | None:
        """Number of spheres that a per-sphere property implies; None where all are scalars."""
        counts = {len(v) for name in RANGES if isinstance(v := getattr(self, name), tuple)}
        if len(counts) > 1:
            raise UserError(f'per-sphere properties differ in length: {sorted(counts)}')
        return counts.pop() if counts else None

    def per_sphere(self, name: str, count: int) -> Array:
        """Property `name` of each of `count` spheres, shape (count,)."""
        value = getattr(self, name)
        if not isinstance(value, tuple):
            return np.full(count, value, dtype=np.float64)
        if len(value) != count:
            raise UserError(
                f'{name} is given for {len(value)} spheres, but there are {count}; '
                'give one number, or one per sphere'
            )
        return np.array(value, dtype=np.float64)

    def surface_values(self, name: str) -> Array:
        """`restitution` or `friction` of each surface, shape (surfaces,); see `values_of`."""
        return self.values_of(name, self.surfaces)

    def values_of(self, name: str, planes: tuple[Plane, ...]) -> Array:
        """`restitution` or `friction` of planes in this scene, shape (planes,).

        Of one with a contact law: what makes the product with the mean of the spheres that of the
        law, a curve at high speed.
        """
        default, values = getattr(self, name), []
        if isinstance(default, tuple):
            default = float(np.mean(default))
        for surface in planes:
            value, law = getattr(surface, name), surface.contact
            if law is not None:
                value = law.curve.fast if name == 'restitution' else getattr(law, name)
                value /= default or 1.0
            values.append(default if value is None else value)
        return np.array(values)

    def of_fixed_surfaces(self) -> Scene:
        """Scene without the surfaces whose place changes: belts stay, rackets do not.

        The plates of boxes are among its surfaces; other obstacles stay obstacles.
        """
        fixed = tuple(surface for surface in self.surfaces if not surface.changes_place)
        boxes = [obstacle for obstacle in self.obstacles if obstacle.shape == 'box']
        if len(fixed) == len(self.surfaces) and not boxes:
            return self
        plates = (plate for box in boxes for plate, _ in box.parts)
        others = tuple(obstacle for obstacle in self.obstacles if obstacle not in boxes)
        return replace(self, surfaces=(*fixed, *plates), obstacles=others)

    @property
    def fixed_materials(self) -> tuple[Plane, ...]:
        """Planes with the materials and laws of the surfaces and, after them, the obstacles."""
        return (*self.surfaces, *(obstacle.parts[0][0] for obstacle in self.obstacles))

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
        for name in RANGES:
            value = getattr(self, name)
            if name == 'inertia_factor' and value == SOLID:
                continue
            mapping[name] = list(value) if isinstance(value, tuple) else value
        mapping['gravity'] = list(self.gravity)
        for surface, plane in zip(mapping['surfaces'], self.surfaces, strict=True):
            if plane.contact is not None:
                surface['contact'] = to_mapping(plane.contact)
            if plane.moves:
                surface |= {name: list(getattr(plane, name)) for name in MOTIONS}
            if plane.plan is not None:
                surface['plan'] = to_mapping(plane.plan)
        if self.sphere_contact is not None:
            mapping['sphere_contact'] = to_mapping(self.sphere_contact)
        if self.air is not None:
            mapping['air'] = air = to_mapping(self.air)
            if self.air.drag_drop == 0.0:
                del air['drag_drop'], air['crisis_speed']
        if self.tracker is not None:
            mapping['tracker'] = _tracker_mapping(self.tracker)
        if self.obstacles:
            mapping['obstacles'] = [_obstacle_mapping(obstacle) for obstacle in self.obstacles]
        for surface in mapping['surfaces']:
            for name in ('length_x', 'length_y'):
                if np.isinf(surface[name]):
                    surface[name] = 'inf'  # JSON has no infinity
        return mapping

    @classmethod
    def from_mapping(cls, mapping: dict[str, Any], where: str = 'scene') -> Scene:
        """Read a scene from YAML or JSON; `box: {length_x, length_y, ...}` may stand for surfaces.

        Raises:
            UserError: An unknown key, with the allowed ones, or a value out of range.
        """
        if not isinstance(mapping, Mapping):
            raise ConfigError(f'{where} is {shown(mapping)}, expected a mapping')
        mapping = dict(mapping)
        planes: tuple[Plane, ...] = ()
        if 'box' in mapping:
            box = from_mapping(_Box, mapping.pop('box'), f'{where}.box')
            planes = Plane.box(**vars(box))
        if 'surfaces' in mapping or planes:
            surfaces = mapping.pop('surfaces', ())
            if not isinstance(surfaces, (list, tuple)):
                raise ConfigError(
                    f'{where}.surfaces is {shown(surfaces)}, expected a list of planes'
                )
            planes += tuple(
                from_mapping(Plane, plane, f'{where}.surfaces[{index}]')
                for index, plane in enumerate(surfaces)
            )
            mapping['surfaces'] = planes
        if isinstance(mapping.get('gravity'), (int, float)):
            size = float(checked_floats(f'{where}.gravity', mapping['gravity']))
            mapping['gravity'] = [0.0, 0.0, -size]
        return from_mapping(cls, mapping, where)


def checked_scene(scene: object) -> Scene:
    """Scene; UserError for anything else, such as the name of one."""
    if not isinstance(scene, Scene):
        raise UserError(
            f'scene is {shown(scene)}, expected Scene(...), or what load_scene makes of a name'
        )
    return scene


def _obstacle_mapping(obstacle: Obstacle) -> dict[str, Any]:
    given = {name: v for name, v in to_mapping(obstacle).items() if v is not None}
    return given | ({'contact': to_mapping(obstacle.contact)} if obstacle.contact else {})


def _tracker_mapping(tracker: Tracker) -> dict[str, Any]:
    mapping = to_mapping(tracker)
    if tracker.spins is not None:
        windows = [list(row) for row in tracker.spins.windows]
        bandwidth: Any = tracker.spins.bandwidth
        bandwidth = 'inf' if np.isinf(bandwidth) else bandwidth  # JSON has no infinity
        mapping['spins'] = to_mapping(tracker.spins) | {'windows': windows, 'bandwidth': bandwidth}
    if tracker.correction is not None:
        windows = [list(row) for row in tracker.correction.windows]
        own = {'windows': windows, 'scales': list(tracker.correction.scales)}
        mapping['correction'] = to_mapping(tracker.correction) | own
    if tracker.regions is not None:
        mapping['regions'] = {'rows': [list(row) for row in tracker.regions.rows]}
    return mapping
