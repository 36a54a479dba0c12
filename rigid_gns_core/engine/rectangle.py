# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Geometry of a bounded plane: closest points, and when a sphere on its path meets an edge.

The search for that serves for two spheres on paths that bend differently, too.
"""

from __future__ import annotations

import math

from .flight import position_on_path, velocity_on_path
from ..kernels.jit import in_place
from ..kernels.lanes import choose, larger
from ..kernels.vector import dot, length, minus, plus, row, times, Vector
from ..scenes.state import Array

# most steps of the search for a root, which at worst halves the distance in each
_MOST_STEPS = 60
# distance from the root [radii] at which the search ends
_AT_ROOT = 1e-13


@in_place
def to_plane(axes: Array, vector: Vector) -> Vector:
    """Components of a vector along the axes of a plane."""
    return dot(row(axes, 0), vector), dot(row(axes, 1), vector), dot(row(axes, 2), vector)


@in_place
def from_plane(axes: Array, local: Vector) -> Vector:
    """Vector in the world from its components along the axes of a plane."""
    flat = plus(times(local[0], row(axes, 0)), times(local[1], row(axes, 1)))
    return plus(flat, times(local[2], row(axes, 2)))


@in_place
def offset_from_rectangle(local: Vector, half: Array) -> Vector:
    """Vector to a point from the closest one of a rectangle about the origin, normal along z."""
    x = max(min(local[0], half[0]), -half[0])
    y = max(min(local[1], half[1]), -half[1])
    return local[0] - x, local[1] - y, local[2]


@in_place
def is_over_face(offset: Vector) -> bool:
    """Whether the closest point of a rectangle is the foot of the perpendicular, not an edge."""
    return offset[0] == 0 and offset[1] == 0


@in_place
def first_touch_of_plane(gap: float, speed: float, pull: float) -> float:
    """First root t > 0 of d + s t + a t^2 / 2 = 0, in a form that loses no digits.

    t = 2 d / (sqrt(s^2 - 2 a d) - s) where the gap closes, and (s + sqrt(s^2 - 2 a d)) / -a where
    it first opens; infinite where there is none.

    Args:
        gap: d > 0.
        speed: s, at which it opens.
        pull: a, the acceleration of that.
    """
    root = speed * speed - 2.0 * pull * gap
    if root < 0 or (speed >= 0 and pull >= 0):
        return math.inf
    if speed < 0:
        return 2.0 * gap / (math.sqrt(root) - speed)
    return (speed + math.sqrt(root)) / -pull


@in_place
def first_touch_of_rectangle(
    local: Vector,
    velocity: Vector,
    acceleration: Vector,
    half: Array,
    radius: float,
    start: float,
    end: float,
) -> float:
    """First time between start and end at which a sphere on its path touches a rectangle.

    The distance f of the path from a convex body, plus |g| t^2 / 2, is a convex function of time,
    so that f(t + s) >= f + f' s - |g| s^2 / 2. The first root of this bound is never beyond that
    of f, and near it: a search by Newton's method that cannot miss a graze. Infinite where there
    is none.

    Args:
        local: Centre at time 0, in the axes of the plane.
        velocity: At time 0.
        acceleration: Of the path.
        half: Half lengths of the rectangle.
        radius: Of the sphere.
        start: Time at which the search begins.
        end: Time at which it ends.
    """
    weight, time = length(acceleration), start
    for _ in range(_MOST_STEPS):
        offset = offset_from_rectangle(position_on_path(local, velocity, acceleration, time), half)
        distance = length(offset)
        gap = distance - radius
        if gap <= _AT_ROOT * radius:
            return time
        rate = dot(offset, velocity_on_path(velocity, acceleration, time)) / distance
        time += first_touch_of_plane(gap, rate, -weight)
        if time > end:
            return math.inf
    return time


@in_place
def first_touch_of_spheres(
    offset: Vector, velocity: Vector, acceleration: Vector, touching: float, end: float
) -> float:
    """First time up to `end` at which a relative path comes as near as `touching`, or infinite.

    As `first_touch_of_rectangle`: the distance from a point is that from a convex body, too.
    """
    weight, time = length(acceleration), 0.0
    for _ in range(_MOST_STEPS):
        there = position_on_path(offset, velocity, acceleration, time)
        distance = length(there)
        gap = distance - touching
        if gap <= _AT_ROOT * touching:
            return time
        rate = dot(there, velocity_on_path(velocity, acceleration, time)) / distance
        time += first_touch_of_plane(gap, rate, -weight)
        if time > end:
            return math.inf
    return time


@in_place
def crossing_of_edge(half: float, place: float, velocity: float, acceleration: float) -> float:
    """First time t > 0 at which a path along an axis crosses an end of a rectangle, or infinite.

    Args:
        half: Half length along the axis.
        place: At time 0.
        velocity: At time 0.
        acceleration: Of the path.
    """
    if half == math.inf:
        return math.inf
    beyond = math.fabs(place) - half
    if beyond > 0:
        outwards = math.copysign(1.0, place)
        return first_touch_of_plane(beyond, outwards * velocity, outwards * acceleration)
    return min(
        first_touch_of_plane(half - place, -velocity, -acceleration),
        first_touch_of_plane(half + place, velocity, acceleration),
    )


@in_place
def curvature_of_path(offset: Vector, velocity: Vector) -> float:
    """Centrifugal acceleration v_t^2 / d of a path past the closest point of a rectangle.

    Over a face, and along an edge, the distance d does not curve.

    Args:
        offset: From the closest point to the centre, of length d.
        velocity: In the axes of the plane.
    """
    if is_over_face(offset):
        return 0.0
    x = velocity[0] if offset[0] != 0 else 0.0
    y = velocity[1] if offset[1] != 0 else 0.0
    return centrifugal(offset, (x, y, velocity[2]))


@in_place
def centrifugal(offset: Vector, velocity: Vector) -> float:
    """Second derivative of the length d of an offset without acceleration: (v^2 - d'^2) / d."""
    distance = length(offset)
    inverse = 1.0 / larger(distance, 1e-30)
    rate = dot(offset, velocity) * inverse
    across = minus(velocity, times(rate * inverse, offset))
    return choose(distance < 1e-9, 0.0, dot(across, across) * inverse)
