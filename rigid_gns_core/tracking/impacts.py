# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a flight meets a surface, and what the impact makes of it."""

from __future__ import annotations

import math
from typing import NamedTuple

from .jit import in_place
from ..kernels.vector import across, cross, dot, length, minus, plus, row, times, Vector
from ..scenes.state import Array


class Surfaces(NamedTuple):
    """What spheres can touch, for compiled code.

    Args:
        gravity: Acceleration of free flight [m/s^2].
        points: A point of each surface [m], shape (k, 3).
        axes: Direction, the other direction and normal of each surface, shape (k, 3, 3).
        halves: Half lengths along the two directions [m], shape (k, 2).
        restitution: Of a sphere on each surface, shape (k,).
        friction: Of a sphere on each surface, shape (k,).
        rolling_friction: Of a sphere.
        bounce: Restitution of two spheres.
        known: Whether these are all; without, spheres may be held anywhere.
    """

    gravity: Vector
    points: Array
    axes: Array
    halves: Array
    restitution: Array
    friction: Array
    rolling_friction: float
    bounce: float
    known: bool


class Impact(NamedTuple):
    """Where a flight first meets a surface.

    Args:
        time: Of the contact [s], infinite where there is none.
        normal: Of the surface.
        restitution: Of the pair.
        friction: Of the pair.
    """

    time: float
    normal: Vector
    restitution: float
    friction: float


@in_place
def nearest(surfaces: Surfaces, place: Vector, radius: float) -> tuple[int, float]:
    """Return the surface nearest above or below a sphere, and its distance [m], else infinite."""
    index, least = 0, math.inf
    for k in range(len(surfaces.points)):
        offset = minus(place, row(surfaces.points, k))
        gap = abs(dot(offset, row(surfaces.axes[k], 2)) - radius)
        if gap < least and _on(surfaces, k, offset):
            index, least = k, gap
    return index, least


@in_place
def _on(surfaces: Surfaces, k: int, offset: Vector) -> bool:
    """Whether an offset from the middle of surface k is above or below it."""
    axes, halves = surfaces.axes[k], surfaces.halves[k]
    x, y = dot(offset, row(axes, 0)), dot(offset, row(axes, 1))
    return bool(abs(x) <= halves[0] and abs(y) <= halves[1])


@in_place
def placed(place: Vector, speed: Vector, acceleration: Vector, time: float) -> Vector:
    """Where a motion is after some time."""
    return plus(plus(place, times(time, speed)), times(0.5 * time * time, acceleration))


@in_place
def first_impact(
    surfaces: Surfaces, place: Vector, speed: Vector, radius: float, begin: float, end: float
) -> Impact:
    """First descent on to a surface of a flight.

    Args:
        surfaces: And gravity.
        place: Centre at time 0 [m].
        speed: Velocity at time 0 [m/s].
        radius: [m].
        begin: Earliest time [s].
        end: Latest time [s].
    """
    index, first = -1, math.inf
    for k in range(len(surfaces.points)):
        normal, point = row(surfaces.axes[k], 2), row(surfaces.points, k)
        a = 0.5 * dot(normal, surfaces.gravity)
        b = dot(speed, normal)
        c = dot(minus(place, point), normal) - radius
        square = b * b - 4.0 * a * c
        if not square > 0:
            continue
        root = math.sqrt(square)
        # the same root, each form where its terms do not cancel
        when = (-b - root) / (2.0 * a) if b > 0 else 2.0 * c / (root - b)
        if not (when >= begin and when <= end and when < first):
            continue
        at = placed(place, speed, surfaces.gravity, when)
        if _on(surfaces, k, minus(at, point)):
            index, first = k, when
    if index < 0:
        return Impact(math.inf, (0.0, 0.0, 0.0), 0.0, 0.0)
    return Impact(
        first, row(surfaces.axes[index], 2), surfaces.restitution[index], surfaces.friction[index]
    )


@in_place
def after_impact(
    speed: Vector, spin: Vector, impact: Impact, radius: float
) -> tuple[Vector, Vector]:
    """Velocity and spin of a solid sphere after an impact, by restitution and Coulomb friction."""
    normal = impact.normal
    into = min(dot(speed, normal), 0.0)
    slip = minus(across(speed, normal), times(radius, cross(spin, normal)))
    kick = (1.0 + impact.restitution) * into
    # 2/7 of the slip stops it; friction may not reach that far
    part = min(2.0 / 7.0, -impact.friction * kick / max(length(slip), 1e-300))
    push = times(-part, slip)
    after = plus(minus(speed, times(kick, normal)), push)
    return after, minus(spin, times(2.5 / radius, cross(normal, push)))
