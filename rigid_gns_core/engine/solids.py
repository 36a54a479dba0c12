# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Geometry of solids of revolution: the closest point, and when a sphere on its path meets one.

A solid is what lies within its rounding of a core: a rectangle of the half plane beside the axis,
turned about that. With s the distance from the axis and z the height, the closest point of the
core is (clip(s), clip(z)) in the half plane of the sphere.

A sphere may lie in a hole, as an egg in a ring, and touch its rim all around. So a solid with a
hole stands for three: in the half plane of the sphere, and in those a third of a turn on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .flight import position_on_path, velocity_on_path
from .rectangle import centrifugal, first_touch_of_plane, from_plane, to_plane
from .world import COSINE, HALF, INNER, IS_SOLID, OUTER, ROUNDING, SINE, World
from ..kernels.jit import in_place
from ..kernels.vector import dot, length, minus, row, Vector
from ..scenes.state import Array

# most steps of the search for a root: a path past a graze of a shape with a hole is long
_MOST_STEPS = 100
# distance from the root [radii] at which the search ends
_AT_ROOT = 1e-13
# share of the radius of a hole about its axis in which a sphere may touch its rim all around
_MIDDLE = 0.25


class Nearest(NamedTuple):
    """Point of a solid next to a point, in a half plane beside the axis.

    distance: from the surface, negative inside; offset: from the core; normal: unit vector; both
    in the axes of the solid; radial: unit vector of the half plane; along: of the point, along it.
    """

    distance: float
    offset: Vector
    normal: Vector
    radial: Vector
    along: float


@in_place
def is_solid(world: World, plane: int) -> bool:
    """Whether a plane, -1 for none, stands for a solid."""
    return world.has_solids and plane >= 0 and world.solids[plane, IS_SOLID] > 0


@in_place
def is_beside(solid: Array) -> bool:
    """Whether a row of `World.solids` is of half planes beside that of the sphere."""
    return solid[SINE] != 0


@in_place
def may_lie_in(solid: Array, local: Vector, radius: float) -> bool:
    """Whether a sphere may touch the rim of a hole all around: too large for it, and over it."""
    middle = _MIDDLE * solid[INNER]
    if radius + solid[ROUNDING] < solid[INNER]:
        return False
    return local[0] * local[0] + local[1] * local[1] <= middle * middle


@in_place
def radial_of(solid: Array, local: Vector) -> Vector:
    """Half plane in which a row of `World.solids` is: that of a point, or a third of a turn on."""
    far, x, y = math.sqrt(local[0] * local[0] + local[1] * local[1]), 1.0, 0.0
    if far > 0:
        x, y = local[0] / far, local[1] / far
    cosine, sine = solid[COSINE], solid[SINE]
    return cosine * x - sine * y, sine * x + cosine * y, 0.0


@in_place
def nearest_of(solid: Array, local: Vector, radial: Vector, fixed: bool) -> Nearest:
    """Point of a solid next to a point, in a half plane.

    Args:
        solid: Row of `World.solids`.
        local: The point, in the axes of the solid.
        radial: Unit vector of the half plane.
        fixed: Whether that need not be the half plane of the point.
    """
    inner, outer, half = solid[INNER], solid[OUTER], solid[HALF]
    x, y, z = local
    along, across = x * radial[0] + y * radial[1], y * radial[0] - x * radial[1]
    if not fixed:
        across = 0.0  # but for rounding
    away, height = along - max(min(along, outer), inner), z - max(min(z, half), -half)
    offset = (away * radial[0] - across * radial[1], away * radial[1] + across * radial[0], height)
    distance = length(offset)
    normal = radial
    if distance > 0:
        normal = offset[0] / distance, offset[1] / distance, offset[2] / distance
    else:  # in the core: out by the shortest way
        distance = -min(outer - along, half - math.fabs(z))
        if half - math.fabs(z) <= outer - along:
            normal = 0.0, 0.0, math.copysign(1.0, z)
    return Nearest(
        distance=distance - solid[ROUNDING],
        offset=offset,
        normal=normal,
        radial=radial,
        along=along,
    )


@in_place
def curvature_of_distance(
    solid: Array, height: float, nearest: Nearest, turns: bool, velocity: Vector
) -> float:
    """Second derivative of the distance on a straight path.

    In the half plane (v^2 - d'^2) / d past a corner of the core, and 0 along a side of it; around
    the axis v_t^2 n_s / s, with n_s the component of the normal away from it.

    Args:
        solid: Row of `World.solids`.
        height: Of the point, along the axis.
        nearest: Closest point to it.
        turns: Whether that follows the point around the axis.
        velocity: In the axes of the solid.
    """
    x, y, along = nearest.radial[0], nearest.radial[1], nearest.along
    out, around = velocity[0] * x + velocity[1] * y, velocity[1] * x - velocity[0] * y
    rise, turning = velocity[2] if math.fabs(height) >= solid[HALF] else 0.0, 0.0
    if turns and along > 0:
        leaning = nearest.normal[0] * x + nearest.normal[1] * y
        turning, around = around * around * leaning / along, 0.0
    elif along == 0 and solid[INNER] == 0 and solid[OUTER] > 0:
        around = 0.0  # over the middle of a flat end
    if solid[INNER] <= along < solid[OUTER]:
        out = 0.0
    offset = nearest.offset
    away, across = offset[0] * x + offset[1] * y, offset[1] * x - offset[0] * y
    return turning + centrifugal((away, across, offset[2]), (out, around, rise))


@in_place
def first_touch_of_solid(
    solid: Array,
    local: Vector,
    velocity: Vector,
    acceleration: Vector,
    radial: Vector,
    fixed: bool,
    radius: float,
    end: float,
) -> float:
    """First time up to `end` at which a sphere on its path touches a solid, or infinite.

    Around a convex one as `rectangle.first_touch_of_rectangle`. Where there is a hole, the
    distance may also bend by the turn around the axis, f'' >= -|a| - v^2 / s, which holds for as
    far as the path keeps a distance of s from the axis. A step up to f / v is always safe.

    Args:
        solid: Row of `World.solids`.
        local: Centre at time 0, in the axes of the solid.
        velocity: At time 0.
        acceleration: Of the path.
        radial: Half plane at time 0.
        fixed: Whether it stays; if not, it follows the sphere.
        radius: Of the sphere.
        end: Time at which the search ends.
    """
    pull, time = length(acceleration), 0.0
    for _ in range(_MOST_STEPS):
        there = position_on_path(local, velocity, acceleration, time)
        now = velocity_on_path(velocity, acceleration, time)
        section = radial if fixed else radial_of(solid, there)
        nearest = nearest_of(solid, there, section, fixed)
        gap = nearest.distance - radius
        if gap <= _AT_ROOT * (radius + solid[ROUNDING]):
            return time
        rate = dot(nearest.normal, now)
        if solid[INNER] == 0 or fixed:
            time += first_touch_of_plane(gap, rate, -pull)
        else:
            speed = max(length(now) + pull * (end - time), 1e-300)
            trusted = max(0.5 * nearest.along, 1e-300)
            step = first_touch_of_plane(gap, rate, -pull - speed * speed / trusted)
            time += max(min(step, trusted / speed), gap / speed)
        if time > end:
            return math.inf
    return time


@in_place
def nearest_in_world(world: World, plane: int, place: Vector) -> tuple[float, Vector]:
    """Distance of a place from the surface of a solid, and the normal there, in the world."""
    axes, solid = world.axes[plane], world.solids[plane]
    local = to_plane(axes, minus(place, row(world.point, plane)))
    nearest = nearest_of(solid, local, radial_of(solid, local), is_beside(solid))
    return nearest.distance, from_plane(axes, nearest.normal)


@in_place
def is_near_solid(world: World, plane: int, place: Vector, reach: float) -> bool:
    """Whether a solid is within reach of a place, in whichever half plane."""
    axes, solid = world.axes[plane], world.solids[plane]
    x, y, z = to_plane(axes, minus(place, row(world.point, plane)))
    along, reach = math.sqrt(x * x + y * y), reach + solid[ROUNDING]
    away = max(along - solid[OUTER], solid[INNER] - along, 0.0)
    height = max(math.fabs(z) - solid[HALF], 0.0)
    return away * away + height * height <= reach * reach


@in_place
def share_to_solid(world: World, plane: int, start: Vector, end: Vector, radius: float) -> float:
    """Share of a straight way before a point of it is as near as `radius` to a solid, at most 1.

    1 where it begins nearer.
    """
    axes, solid = world.axes[plane], world.solids[plane]
    local = to_plane(axes, minus(start, row(world.point, plane)))
    radial, still = radial_of(solid, local), (0.0, 0.0, 0.0)
    if nearest_of(solid, local, radial, False).distance <= radius:
        return 1.0
    way = to_plane(axes, minus(end, start))
    return min(first_touch_of_solid(solid, local, way, still, radial, False, radius, 1.0), 1.0)
