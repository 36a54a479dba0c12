# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impacts of a sphere in flight on a surface: time of contact, velocity and spin after it."""

from __future__ import annotations

import math
from typing import NamedTuple

from .jit import in_place
from ..kernels.neighbours import Flags
from ..kernels.vector import across, cross, dot, length, minus, plus, row, times, Vector
from ..scenes.state import Array


class Surfaces(NamedTuple):
    """Surfaces and gravity, for compiled code.

    Args:
        gravity: Acceleration of free flight [m/s^2].
        points: A point of each surface [m], shape (k, 3).
        axes: First and second tangent and normal of each surface, shape (k, 3, 3).
        half_lengths: Half lengths along the two tangents [m], shape (k, 2).
        two_sided: Strips and plates, which have two faces, shape (k,).
        restitution: Restitution of a sphere on each surface, shape (k,).
        friction: Friction of a sphere on each surface, shape (k,).
        rolling_friction: Rolling friction of a sphere.
        sphere_restitution: Restitution of two spheres.
        inertia: Inertia factor of a sphere, see `Scene`.
        known: Whether these are all surfaces; if not, spheres may be supported anywhere.
    """

    gravity: Vector
    points: Array
    axes: Array
    half_lengths: Array
    two_sided: Flags
    restitution: Array
    friction: Array
    rolling_friction: float
    sphere_restitution: float
    inertia: float
    known: bool


class Impact(NamedTuple):
    """First contact of a flight with a surface.

    Args:
        time: Time of the contact [s], infinite where there is none.
        normal: Normal of the surface, out of the face that is met.
        restitution: Restitution of the pair.
        friction: Friction of the pair.
    """

    time: float
    normal: Vector
    restitution: float
    friction: float


@in_place
def nearest_surface(surfaces: Surfaces, position: Vector, radius: float) -> tuple[int, float]:
    """Index of the surface whose face is nearest to a sphere over it, and their gap [m].

    The gap is infinite where the sphere is over none.
    """
    index, least = 0, math.inf
    for k in range(len(surfaces.points)):
        offset = minus(position, row(surfaces.points, k))
        gap = abs(dot(offset, normal_towards(surfaces, k, position)) - radius)
        if gap < least and _is_over(surfaces, k, offset):
            index, least = k, gap
    return index, least


@in_place
def normal_towards(surfaces: Surfaces, k: int, position: Vector) -> Vector:
    """Normal of surface k, out of the face on whose side a position is [m]."""
    normal = row(surfaces.axes[k], 2)
    height = dot(minus(position, row(surfaces.points, k)), normal)
    return times(-1.0, normal) if surfaces.two_sided[k] and height < 0 else normal


@in_place
def _is_over(surfaces: Surfaces, k: int, offset: Vector) -> bool:
    """Whether an offset from the middle of surface k [m] lies above or below its rectangle."""
    axes, half_lengths = surfaces.axes[k], surfaces.half_lengths[k]
    x, y = dot(offset, row(axes, 0)), dot(offset, row(axes, 1))
    return bool(abs(x) <= half_lengths[0] and abs(y) <= half_lengths[1])


@in_place
def position_after(
    position: Vector, velocity: Vector, acceleration: Vector, time: float
) -> Vector:
    """Position after `time` [s] at constant acceleration [m/s^2]."""
    return plus(plus(position, times(time, velocity)), times(0.5 * time * time, acceleration))


@in_place
def first_impact(
    surfaces: Surfaces,
    position: Vector,
    velocity: Vector,
    radius: float,
    before: float,
    begin: float,
    end: float,
) -> Impact:
    """First impact of a flight on a surface.

    Args:
        surfaces: Surfaces and gravity.
        position: Centre at time 0 [m].
        velocity: Velocity at time 0 [m/s].
        radius: Radius [m].
        before: Time at which it is on the side of the faces that it may meet [s].
        begin: Earliest time [s].
        end: Latest time [s].
    """
    found = Impact(math.inf, (0.0, 0.0, 0.0), 0.0, 0.0)
    for k in range(len(surfaces.points)):
        normal, point = row(surfaces.axes[k], 2), row(surfaces.points, k)
        a = 0.5 * dot(normal, surfaces.gravity)
        b = dot(velocity, normal)
        height = dot(minus(position, point), normal)
        if surfaces.two_sided[k] and height + before * (b + before * a) < 0:
            normal, a, b, height = times(-1.0, normal), -a, -b, -height
        c = height - radius
        discriminant = b * b - 4.0 * a * c
        if not discriminant > 0:
            continue
        root = math.sqrt(discriminant)
        # one root in two forms, each where its terms do not cancel
        when = (-b - root) / (2.0 * a) if b > 0 else 2.0 * c / (root - b)
        if not (when >= begin and when <= end and when < found.time):
            continue
        at = position_after(position, velocity, surfaces.gravity, when)
        if _is_over(surfaces, k, minus(at, point)):
            found = Impact(when, normal, surfaces.restitution[k], surfaces.friction[k])
    return found


@in_place
def after_impact(
    velocity: Vector, spin: Vector, impact: Impact, radius: float, inertia: float
) -> tuple[Vector, Vector]:
    """Velocity [m/s] and spin [rad/s] of a sphere after an impact, of its inertia factor i.

    Newton's restitution along the normal, Coulomb friction across it.
    """
    normal = impact.normal
    approach = min(dot(velocity, normal), 0.0)
    slip = minus(across(velocity, normal), times(radius, cross(spin, normal)))
    kick = (1.0 + impact.restitution) * approach
    # an impulse of i / (1 + i) m stops the slip; Coulomb's bound may be lower
    part = min(inertia / (1.0 + inertia), -impact.friction * kick / max(length(slip), 1e-300))
    push = times(-part, slip)
    after = plus(minus(velocity, times(kick, normal)), push)
    return after, minus(spin, times(1.0 / (inertia * radius), cross(normal, push)))
