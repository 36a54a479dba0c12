# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random scenes of each kind, and starts in which nothing overlaps, by seed and number.

The largest radius is 1 m, so that a frame takes 0.1 s at 9.81 m/s^2. Plates that are joined share
an edge but for rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...scenes.plane import closest_points, distances, Plane
from ...scenes.scene import Scene
from ...scenes.state import Array, State

Planes = tuple[Plane, ...]
Rng = np.random.Generator

STEPS = (30, 60)
"""Fewest and most frames of a case."""
MOST_SPHERES = 6
_TOUCHING = 1e-9  # overlap that is rounding [radii]
_FAR = 4.0  # farthest start from what it is aimed at [radii]
_SOON = 2.0  # longest time to where it is aimed at, without gravity [s]
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Case:
    """A drawn scene and start.

    Args:
        seed: Seed of the run.
        number: Number of the case in it; seed and number say all the rest.
        kind: Name in `KINDS`.
        scene: Surfaces, spheres, materials and gravity.
        start: State at time 0; nothing overlaps.
        steps: Number of frames.
    """

    seed: int
    number: int
    kind: str
    scene: Scene
    start: State
    steps: int

    @property
    def closed(self) -> bool:
        """Whether the surfaces enclose the spheres, so that no centre may be behind any."""
        return self.kind == 'room'


def kind_of(number: int) -> str:
    """Kind of a case: each in turn."""
    return list(KINDS)[number % len(KINDS)]


def draw_case(seed: int, number: int) -> Case:
    """Draw case `number`: first one sphere, then more, and faster ones."""
    level, kind = number // len(KINDS), kind_of(number)
    rng = np.random.default_rng([seed, number])
    count = int(rng.integers(1, min(MOST_SPHERES, 1 + level // 2), endpoint=True))
    count = max(count, 2) if kind == 'air' else count
    while True:  # a scene with no room for the spheres is drawn anew
        scene = _scene(rng, KINDS[kind](rng), count)
        start = _start(rng, scene, count, kind, fast=level > 3)
        if start is not None:
            steps = int(rng.integers(*STEPS, endpoint=True))
            return Case(seed, number, kind, scene, start, steps)


def _scene(rng: Rng, planes: Planes, count: int) -> Scene:
    """Scene with random gravity and materials; a third is without any loss."""
    down = _direction(rng) if rng.random() < 0.2 else -_UP
    strength = rng.choice([9.81, 9.81, 9.81, rng.uniform(1.0, 25.0), 0.0, 0.0])
    each = count if rng.random() < 0.5 else None

    def drawn(low: float, high: float) -> float | tuple[float, ...]:
        return (
            float(rng.uniform(low, high)) if each is None else tuple(rng.uniform(low, high, each))
        )

    radii = tuple(np.append(1.0, rng.uniform(0.3, 1.0, count - 1))) if each else 1.0
    lossless, slides, bounces = rng.random() < 0.3, rng.random() < 0.3, rng.random() < 0.8
    if not lossless:
        planes = tuple(
            replace(plane, restitution=rng.uniform(0.3, 1.0), friction=rng.uniform(0.0, 1.0))
            if rng.random() < 0.3
            else plane
            for plane in planes
        )
    return Scene(
        surfaces=planes,
        radius=radii,
        mass=drawn(0.2, 5.0),
        restitution=1.0 if lossless else drawn(0.4, 1.0) if bounces else 0.0,
        friction=0.0 if lossless or slides else drawn(0.1, 1.0),
        rolling_friction=0.0 if lossless or slides else drawn(0.0, 0.05),
        gravity=tuple(strength * down + 0.0),  # no -0 in a file
    )


def _start(rng: Rng, scene: Scene, count: int, kind: str, fast: bool) -> State | None:
    """Spheres thrown at a face or an edge, or lying on a face; None where there is no room."""
    radii = scene.per_sphere('radius', count)
    places, velocities = np.zeros((count, 3)), np.zeros((count, 3))
    for sphere, radius in enumerate(radii):
        for _ in range(200):
            places[sphere], velocities[sphere] = _throw(rng, scene.surfaces, radius, fast)
            if _is_clear(scene.surfaces, places, radii, sphere, kind):
                break
        else:
            return None
    spins = rng.normal(size=(count, 3)) * (rng.random((count, 1)) < 0.5)
    spins *= np.linalg.norm(velocities, axis=1, keepdims=True) / radii[:, None]
    return State(positions=places, velocities=velocities, angular_velocities=spins)


def _throw(rng: Rng, planes: Planes, radius: float, fast: bool) -> tuple[Array, Array]:
    """Place and velocity of a sphere near one of the planes, or near the origin."""
    speed = float(10.0 ** rng.uniform(-1.5, 2.0 if fast else 1.3) * (rng.random() < 0.9))
    if not planes:
        place = _direction(rng) * rng.uniform(1.0, 2 * _FAR)
        return place, speed * (_direction(rng) - place / np.linalg.norm(place))
    plane = planes[rng.integers(len(planes))]
    half = np.minimum([plane.length_x, plane.length_y], 20.0) / 2
    spot = rng.uniform(-half, half)
    away = np.asarray(plane.normal)
    aim = rng.choice(['lying', 'face', 'edge'], p=[0.3, 0.4, 0.3])
    rim = rng.integers(2)
    if aim == 'edge' and np.isfinite((plane.length_x, plane.length_y)[rim]):
        spot[rim] = half[rim] * rng.choice([-1.0, 1.0])
        away = _direction(rng)
    point = plane.point + spot @ plane.axes[:2]
    if aim == 'lying':
        along = rng.normal(size=2) @ plane.axes[:2]
        return point + radius * away, speed * along / np.linalg.norm(along)
    course = _direction(rng)
    course -= away * max(0.0, 1.5 * float(course @ away))  # rather towards the spot than from it
    # past the spot at up to a radius: spheres graze edges
    grazes = away * radius if aim == 'face' else away * radius * rng.uniform(0.0, 1.02)
    before = rng.uniform(0.0, min(_FAR, _SOON * speed))
    return point + grazes - before * course, speed * course


def _is_clear(planes: Planes, places: Array, radii: Array, sphere: int, kind: str) -> bool:
    place, radius = places[sphere], radii[sphere]
    apart = np.linalg.norm(places[:sphere] - place, axis=1) - radii[:sphere] - radius
    if (apart < 0).any():
        return False
    if (distances(planes, place[None]) < radius * (1 - _TOUCHING)).any():
        return False
    in_front = closest_points(planes, place[None])[1][0] > 0
    half_spaces = np.array([plane.is_half_space for plane in planes], bool)
    return bool(
        in_front.all() if kind == 'room' else kind != 'box' or in_front[~half_spaces].any()
    )


def _direction(rng: Rng) -> Array:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def profile(corners: Sequence[tuple[float, float]], width: float) -> Planes:
    """Plates of one width along y between successive corners (x, z), faces left of the way.

    Along +x faces look up, along -x down; a closed way clockwise has its faces outside.
    """
    planes = []
    for (x, z), (x_end, z_end) in pairwise(corners):
        length = float(np.hypot(x_end - x, z_end - z))
        way = ((x_end - x) / length, 0.0, (z_end - z) / length)
        middle = ((x + x_end) / 2, 0.0, (z + z_end) / 2)
        planes.append(Plane(middle, (-way[2], 0.0, way[0]), way, length, width))
    return tuple(planes)


def cuboid(x: float, y: float, z: float, *, inside: bool = False) -> Planes:
    """Six plates of a box around the origin, faces outside, or inside."""
    way = [(-x / 2, z / 2), (x / 2, z / 2), (x / 2, -z / 2), (-x / 2, -z / 2), (-x / 2, z / 2)]
    side = -1.0 if inside else 1.0
    ends = tuple(
        Plane((0.0, s * y / 2, 0.0), (0.0, side * s, 0.0), (1.0, 0.0, 0.0), x, z)
        for s in (-1.0, 1.0)
    )
    return (*profile(way[::-1] if inside else way, y), *ends)


def _plate(rng: Rng) -> Planes:
    normal = _direction(rng) if rng.random() < 0.3 else _UP
    return (Plane((0, 0, 0), tuple(normal), tuple(_direction(rng)), *rng.uniform(1.0, 8.0, 2)),)


def _endless(rng: Rng) -> Planes:
    axes = rng.permutation(np.eye(3))[: rng.integers(1, 4)]  # a wall, a floor, corners
    return tuple(Plane(tuple(-3 * axis), tuple(axis)) for axis in axes)


def _strip(rng: Rng) -> Planes:
    normal = [_UP, _direction(rng), np.array([1.0, 0.0, 0.0])][rng.integers(3)]
    lengths = rng.permutation([rng.uniform(1.0, 8.0), np.inf])
    strip = Plane((0, 0, 0), tuple(normal), tuple(_direction(rng)), *lengths)
    return (strip, *_floor(rng, -rng.uniform(2.0, 8.0)))


def _tiles(rng: Rng) -> Planes:
    x = np.append(0.0, rng.uniform(1.0, 5.0, rng.integers(2, 4)).cumsum()) - 3.0
    return profile([(place, 0.0) for place in x], rng.uniform(2.0, 8.0))


def _ceiling(rng: Rng) -> Planes:
    height, width, end = rng.uniform(2.1, 6.0), rng.uniform(2.0, 8.0), rng.uniform(2.0, 6.0)
    roof = profile([(end, height), (-3.0, height)], width)
    if rng.random() < 0.5:  # with a wall that it hangs out from
        roof += profile([(-3.0, height), (-3.0, 0.0)], width)
    return (*roof, *_floor(rng, 0.0))


def _crest(rng: Rng) -> Planes:
    left, right = rng.uniform(2.0, 6.0, 2)
    fall = rng.uniform(-0.5, 1.5, 2)  # a crest, or a valley
    return profile([(-left, -left * fall[0]), (0.0, 0.0), (right, -right * fall[1])], 6.0)


def _ramp(rng: Rng) -> Planes:
    run, rise = rng.uniform(3.0, 8.0), rng.uniform(0.5, 4.0)
    way = [(-4.0, 0.0), (0.0, 0.0), (run, rise), (run + rng.uniform(1.0, 4.0), rise)]
    if rng.random() < 0.5:  # the end of the platform goes down upright
        way.append((way[-1][0], 0.0))
    return (*profile(way, rng.uniform(2.0, 8.0)), *_floor(rng, -1.0))


def _box(rng: Rng) -> Planes:
    x, y, z = rng.uniform(0.5, 5.0, 3)
    return (*cuboid(x, y, z), *_floor(rng, -z / 2 - rng.choice([0.0, 3.0])))


def _room(rng: Rng) -> Planes:
    return cuboid(*rng.uniform(2.5, 12.0, 3), inside=True)


def _mixed(rng: Rng) -> Planes:
    planes = tuple(
        replace(plane, point=tuple(rng.normal(0.0, 4.0, 3)))
        for _ in range(rng.integers(2, 5))
        for plane in _plate(rng)
    )
    return (*planes, *_floor(rng, -5.0))


def _floor(rng: Rng, height: float) -> Planes:
    return (Plane((0.0, 0.0, height)),) if rng.random() < 0.5 else ()


KINDS: dict[str, Callable[[Rng], Planes]] = {
    'plate': _plate,
    'endless': _endless,
    'air': lambda _: (),
    'tiles': _tiles,
    'strip': _strip,
    'ceiling': _ceiling,
    'crest': _crest,
    'ramp': _ramp,
    'box': _box,
    'room': _room,
    'mixed': _mixed,
}
"""Surfaces of each kind, from the simplest on."""
