# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that tracks may tell, and the laws of a ball with given values of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..scenes.air import Air
from ..scenes.contact_law import ContactLaw, RestitutionCurve
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array
from ..tracking.ball_contact import LAW
from ..tracking.ball_model import BallModel
from ..tracking.surface_rows import fixed_rows, of_rows, parts_of


@dataclass(frozen=True)
class Parameter:
    """One shared parameter.

    Args:
        name: `air.FIELD`, `gravity.AXIS`, `contact N.FIELD` of the N-th group of bodies, or
            `surface N.height`, `.tilt_x`, `.tilt_y` of the N-th surface. `contact N.lean` turns
            the walls of a group over the ball: how far above its middle they meet it.
        start: Value at the start, and the mean of a weak prior.
        width: Standard deviation of that prior; a thousandth of it is the step of slopes.
        low, high: Bounds.
        unit: Unit, for tables.
    """

    name: str
    start: float
    width: float
    low: float = -np.inf
    high: float = np.inf
    unit: str = ''


# a wall's normal has this part along the vertical at most
WALL = 0.7
# of a mass that is far off, a coefficient makes up for it
_MOST = 50.0
AIR = {
    'drag_coefficient': Parameter('air.drag_coefficient', 0.45, 0.3, 0.0, _MOST),
    'drag_drop': Parameter('air.drag_drop', 0.1, 0.2, 0.0, _MOST),
    'crisis_speed': Parameter('air.crisis_speed', 10.0, 4.0, 1.0, 100.0, 'm/s'),
    'drag_slope': Parameter('air.drag_slope', 0.0, 1.0, 0.0, _MOST),
    'lift_coefficient': Parameter('air.lift_coefficient', 0.37, 0.3, 0.0, _MOST),
    'lift_half_ratio': Parameter('air.lift_half_ratio', 0.25, 0.2, 0.02, 2.0),
    'spin_decay': Parameter('air.spin_decay', 0.0, 0.3, 0.0, 3.0, '1/s'),
    **{f'wind_{a}': Parameter(f'air.wind_{a}', 0.0, 1.0, -30.0, 30.0, 'm/s') for a in 'xyz'},
}
# width, low, high, unit; a restitution that falls by `restitution_drop` from high to low speed
CONTACT = {
    'restitution': (0.15, 0.0, 1.0, ''),
    'restitution_drop': (0.3, -1.0, 1.0, ''),
    'restitution_speed': (0.5, 0.02, 10.0, 'm/s'),
    'friction': (0.15, 0.0, 2.0, ''),
    'tangential_restitution': (0.5, -1.0, 1.0, ''),
    'rolling_friction': (0.01, 0.0, 0.5, ''),
    'rolling_friction_slope': (0.01, 0.0, 0.5, 's/m'),
    'spinning_friction': (0.02, 0.0, 0.5, ''),
}


class Laws:
    """Laws of the balls of a scene as functions of parameters' values.

    Args:
        scene: Surfaces, spheres and gravity; what is not fitted stays.
        count: Number of spheres.

    Attributes:
        groups: Bodies by their contact laws, each a number: of the surfaces, and of the obstacles
            after them.
        rows: Of each body, its rows in `BallModel.planes`.
        shown: Values that tracks show without a fit, where fits begin, by parameter.
    """

    def __init__(self, scene: Scene, count: int = 1) -> None:
        self.scene, self.count = scene, count
        self.models = [BallModel.of(scene, i, count) for i in range(count)]
        self.groups = _groups(scene)
        sizes = [1] * len(scene.surfaces) + [parts_of(one) for one in scene.obstacles]
        ends = np.cumsum(sizes, dtype=int).tolist()
        self.rows = [range(end - size, end) for size, end in zip(sizes, ends, strict=True)]
        self.shown: dict[str, float] = {}

    def start_of(self, name: str) -> Parameter:
        """Parameter of a name, that starts from the scene's value."""
        if name in self.shown:
            return replace(self._start_of(name), start=self.shown[name])
        return self._start_of(name)

    def _start_of(self, name: str) -> Parameter:
        part, field = name.split('.')
        if part == 'air':
            parameter = AIR[field]
            # without a crisis in the scene, its speed would have no slope
            air = self.scene.air or Air()
            crisis = field in ('drag_drop', 'crisis_speed') and air.drag_drop == 0.0
            if self.scene.air is None or field == 'lift_coefficient' or crisis:
                return parameter
            if field.startswith('wind'):
                start = self.scene.air.wind['xyz'.index(field[-1])]
            else:
                start = getattr(self.scene.air, field)
            return replace(parameter, start=float(start))
        if part == 'gravity':
            gravity = self.scene.gravity['xyz'.index(field)]
            return Parameter(name, gravity, 0.5, unit='m/s2')
        if part.startswith('surface'):
            width, unit = (0.003, 'm') if field == 'height' else (0.01, 'rad')
            return Parameter(name, 0.0, width, unit=unit)
        if field == 'lean':
            return Parameter(name, 0.0, 0.05, -0.4, 0.4, 'rad')
        width, low, high, unit = CONTACT[field]
        first = self.rows[self.groups[int(part.split()[1])][0]][0]
        law = dict(zip(LAW, self.models[0].laws[first], strict=True))
        drop = law['restitution'] - law['restitution_slow']
        start = drop if field == 'restitution_drop' else law[field]
        return Parameter(name, float(np.clip(start, low, high)), width, low, high, unit)

    def models_at(self, values: Mapping[str, float]) -> list[BallModel]:
        """Laws of each sphere with these values; parameters that are absent stay the scene's."""
        rows = self._planes(values)
        laws = self.models[0].laws.copy()
        for name, value in values.items():
            part, field = name.split('.')
            if not part.startswith('contact') or field == 'lean':
                continue
            for body in self.groups[int(part.split()[1])]:
                for k in self.rows[body]:
                    _set_law(laws[k], field, value)
        # as `scene_at` writes them: a fit beyond the bounds would be another one than the scene's
        np.clip(laws[:, :2], 0.0, 1.0, out=laws[:, :2])
        return [
            replace(model, ball=self._ball(i, values), planes=rows, laws=laws)
            for i, model in enumerate(self.models)
        ]

    def air_at(self, values: Mapping[str, float]) -> Air | None:
        """Air with these values; None where the scene has none and no value is of air."""
        fields: dict[str, Any] = {
            n.split('.')[1]: v for n, v in values.items() if n.startswith('air.')
        }
        if not fields:
            return self.scene.air
        base = self.scene.air or Air(drag_coefficient=0.0)
        blowing = [
            fields.pop(f'wind_{axis}', still) for axis, still in zip('xyz', base.wind, strict=True)
        ]
        if 'drag_drop' in fields:  # drag is never below 0
            least = fields.get('drag_coefficient', base.drag_coefficient)
            fields['drag_drop'] = min(fields['drag_drop'], least)
        return replace(base, wind=tuple(blowing), **fields)

    def gravity_at(self, values: Mapping[str, float]) -> Array:
        """Gravity with these values [m/s^2], shape (3,)."""
        return np.array(
            [values.get(f'gravity.{a}', g) for a, g in zip('xyz', self.scene.gravity, strict=True)]
        )

    def surfaces_at(self, values: Mapping[str, float]) -> tuple[Plane, ...]:
        """Planes with these heights and tilts: about the axes of the plane, at its point."""
        planes = list(self.scene.surfaces)
        for group, numbers in enumerate(self.groups):
            lean = values.get(f'contact {group}.lean', 0.0)
            for k in numbers if lean else ():
                if k < len(planes) and abs(np.dot(planes[k].normal, self.scene.up)) < WALL:
                    normal = np.asarray(planes[k].normal) - lean * self.scene.up
                    planes[k] = replace(planes[k], normal=tuple(normal))
        for k, plane in enumerate(planes):
            height = values.get(f'surface {k}.height', 0.0)
            x, y = values.get(f'surface {k}.tilt_x', 0.0), values.get(f'surface {k}.tilt_y', 0.0)
            if height or x or y:
                axes = plane.axes
                normal = axes[2] + x * axes[0] + y * axes[1]
                point = np.asarray(plane.point) + height * axes[2]
                planes[k] = replace(plane, point=tuple(point), normal=tuple(normal))
        return tuple(planes)

    def scene_at(self, values: Mapping[str, float]) -> Scene:
        """The scene with these values; bodies whose law is fitted get one of their own."""
        planes, obstacles = list(self.surfaces_at(values)), list(self.scene.obstacles)
        rows, count = self.models_at(values)[0].laws, len(planes)
        for number, group in enumerate(self.groups):
            if any(name.startswith(f'contact {number}.') for name in values):
                for k in group:
                    own: dict[str, Any] = {'contact': _law_of(rows[self.rows[k][0]])}
                    own |= {'restitution': None, 'friction': None}
                    if k < count:
                        planes[k] = replace(planes[k], **own)
                    else:
                        obstacles[k - count] = replace(obstacles[k - count], **own)
        return replace(
            self.scene,
            surfaces=tuple(planes),
            obstacles=tuple(obstacles),
            gravity=tuple(self.gravity_at(values)),
            air=self.air_at(values),
        )

    def _planes(self, values: Mapping[str, float]) -> Array:
        if any(name.startswith('surface') or name.endswith('.lean') for name in values):
            return of_rows(fixed_rows(self.surfaces_at(values), self.scene.obstacles))
        return self.models[0].planes

    def _ball(self, i: int, values: Mapping[str, float]) -> Array:
        old = self.models[i].ball
        air = self.air_at(values) or Air(density=0.0, drag_coefficient=0.0)
        mass = self.scene.per_sphere('mass', self.count)[i : i + 1]
        flight = air.flight(old[0, 7:8], mass, self.gravity_at(values))
        return np.column_stack([flight, old[:, 15:]])


def _law_of(row: Array) -> ContactLaw:
    slow, fast, speed = (float(value) for value in np.clip(row[:3], 0.0, [1.0, 1.0, np.inf]))
    rest = {name: float(value) for name, value in zip(LAW[3:], row[3:], strict=True)}
    restitution = fast if slow == fast else RestitutionCurve(slow, fast, speed)
    return ContactLaw(restitution=restitution, **rest)


def _set_law(law: Array, field: str, value: float) -> None:
    if field == 'restitution':
        law[0] += value - law[1]
        law[1] = value
    elif field == 'restitution_drop':
        law[0] = law[1] - value
    else:
        law[LAW.index(field)] = value


def _groups(scene: Scene) -> list[list[int]]:
    """Bodies by their contact laws: those of equal values in the scene share one.

    No obstacle shares that of a surface: a rim is of another material than a table.
    """
    groups: dict[tuple[object, ...], list[int]] = {}
    for k, plane in enumerate(scene.fixed_materials):
        apart = k >= len(scene.surfaces)
        key = (apart, plane.contact, plane.restitution, plane.friction)
        groups.setdefault(key, []).append(k)
    return list(groups.values())
