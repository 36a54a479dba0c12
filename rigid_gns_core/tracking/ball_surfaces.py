# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surfaces that one ball meets: planes at rest, planes that move, and solids of revolution.

They are rows of `planes`: point [m], rows of `Plane.axes` and half lengths [m] of each, then its
kind, and what the kind has besides. A plane has one face here.
"""

from __future__ import annotations

import math

from .jit import in_place
from ..engine.flight import position_on_path, velocity_on_path
from ..engine.plane_motion import turned
from ..engine.solids import first_touch_of_solid, Nearest, nearest_of, radial_of
from ..kernels.vector import cross, dot, minus, plus, times, Vector
from ..scenes.state import Array

KIND = 14
AT_REST, SOLID, MOVES = 0.0, 1.0, 2.0
# a solid: the first columns of `engine.world.World.solids`
SECTION, SECTION_END = 15, 22
# a plane at rest: velocity of a belt on it [m/s]; one that moves: that, velocity of its point and
# spin at a time [s], their rates of change, and between which times [s] all that holds
VELOCITY, SPIN, PUSH, TWIST, BELT, SINCE, BEGIN, END = 15, 18, 21, 24, 27, 30, 31, 32
PLANE = 33
# a sphere that leaves a solid is looked for anew after this time [s]
_LEAVES = 1e-6
# gap at which a sphere touches a solid [radii]; times of two rows of one motion agree to this [s]
_TOUCH, _SAME = 1e-13, 1e-9

_STILL = (0.0, 0.0, 0.0)


@in_place
def columns(planes: Array, k: int, first: int) -> Vector:
    """Three columns of a row."""
    return planes[k, first], planes[k, first + 1], planes[k, first + 2]


@in_place
def normal_of(planes: Array, k: int) -> Vector:
    """Unit normal of a plane at rest."""
    return planes[k, 9], planes[k, 10], planes[k, 11]


@in_place
def belt(planes: Array, k: int) -> Vector:
    """Velocity of the belt on a plane at rest [m/s], which may be none."""
    return columns(planes, k, BELT)


@in_place
def height(planes: Array, k: int, p: Vector, radius: float) -> float:
    """Distance of the ball's surface from an endless plane at rest [m]."""
    d = minus(p, (planes[k, 0], planes[k, 1], planes[k, 2]))
    return dot(d, normal_of(planes, k)) - radius


@in_place
def beside(planes: Array, k: int, p: Vector) -> bool:
    """Whether a centre is beyond an end of a plane at rest."""
    d = minus(p, (planes[k, 0], planes[k, 1], planes[k, 2]))
    along = d[0] * planes[k, 3] + d[1] * planes[k, 4] + d[2] * planes[k, 5]
    side = d[0] * planes[k, 6] + d[1] * planes[k, 7] + d[2] * planes[k, 8]
    return abs(along) > planes[k, 12] or abs(side) > planes[k, 13]


@in_place
def facing(
    planes: Array, k: int, p: Vector, now: float, radius: float
) -> tuple[float, Vector, Vector]:
    """Distance of the ball's surface [m], unit normal at the closest point, its velocity [m/s].

    Of a plane as if it had no end.
    """
    if planes[k, KIND] == AT_REST:
        return height(planes, k, p, radius), normal_of(planes, k), belt(planes, k)
    if planes[k, KIND] == SOLID:
        near = _nearest(planes, k, _local(planes, k, minus(p, columns(planes, k, 0))))
        normal = plus(
            times(near.normal[0], columns(planes, k, 3)),
            times(near.normal[1], columns(planes, k, 6)),
        )
        normal = plus(normal, times(near.normal[2], columns(planes, k, 9)))
        return near.distance - radius, normal, _STILL
    late = now - planes[k, SINCE]
    arm = minus(p, _point_then(planes, k, late))
    spin, twist = columns(planes, k, SPIN), columns(planes, k, TWIST)
    mean = plus(spin, times(0.5 * late, twist))
    normal = turned(normal_of(planes, k), mean, late)
    velocity = plus(columns(planes, k, VELOCITY), times(late, columns(planes, k, PUSH)))
    velocity = plus(velocity, turned(columns(planes, k, BELT), mean, late))
    off = dot(arm, normal)
    foot = minus(arm, times(off, normal))
    velocity = plus(velocity, cross(plus(spin, times(late, twist)), foot))
    return off - radius, normal, velocity


@in_place
def touch_of(
    planes: Array, k: int, p: Vector, v: Vector, a: Vector, now: float, h: float, radius: float
) -> float:
    """Time up to h at which p + v t + a t^2 / 2 meets what is no plane at rest, or infinite."""
    if planes[k, KIND] == SOLID:
        return _touch_of_solid(planes, k, p, v, a, h, radius)
    return _touch_of_moving(planes, k, p, v, a, now, h, radius)


@in_place
def _touch_of_solid(
    planes: Array, k: int, p: Vector, v: Vector, a: Vector, h: float, radius: float
) -> float:
    section, begin = planes[k, SECTION:SECTION_END], 0.0
    local = _local(planes, k, minus(p, columns(planes, k, 0)))
    v, a = _local(planes, k, v), _local(planes, k, a)
    near, far = _nearest(planes, k, local), (1.0 + _TOUCH) * radius
    if near.distance <= far:
        rate, bend = dot(near.normal, v), dot(near.normal, a)
        if rate < 0.0:  # not one whose centre is in the solid
            return 0.0 if near.distance > 0.0 else math.inf
        begin = _LEAVES
        near = _nearest(planes, k, position_on_path(local, v, a, begin))
        if near.distance <= far and bend < 0.0:  # until it turns back
            begin = rate / -bend
            near = _nearest(planes, k, position_on_path(local, v, a, begin))
        if begin > h or near.distance <= far:
            return begin if begin <= h and bend < 0.0 else math.inf
        local, v = position_on_path(local, v, a, begin), velocity_on_path(v, a, begin)
    return begin + first_touch_of_solid(
        section, local, v, a, near.radial, False, radius, h - begin
    )


@in_place
def narrowed(
    low: float, high: float, time: float, off: float, speed: float
) -> tuple[float, float, float, bool]:
    """Bracket of a touch after one more look, the time of the next, and whether it is found.

    By Newton's method; where that leaves the bracket, by bisection.

    Args:
        low: A time at which the ball is off the surface.
        high: One at which it is beyond it.
        time: Between them.
        off: Distance of the ball's surface from the other then [m].
        speed: Rate of change of that.
    """
    if off > 0.0:
        low = time
    else:
        high = time
    if abs(off) < 1e-13 or high - low < 1e-14:
        return low, high, time, True
    time = time - off / speed if speed < 0.0 else low
    if not low < time < high:
        time = 0.5 * (low + high)
    return low, high, time, False


@in_place
def _touch_of_moving(
    planes: Array, k: int, p: Vector, v: Vector, a: Vector, now: float, h: float, radius: float
) -> float:
    """By Newton's method from a chord; where that leaves the bracket, by bisection."""
    if now > planes[k, END] or now + h < planes[k, BEGIN]:
        return math.inf
    at_low, _, _ = facing(planes, k, p, now, radius)
    if at_low < -radius:  # from behind
        return math.inf
    at_high, normal, surface = facing(planes, k, position_on_path(p, v, a, h), now + h, radius)
    speed = dot(minus(velocity_on_path(v, a, h), surface), normal)
    if at_high >= 0.0 or speed >= 0.0:
        return math.inf
    low, high, time = 0.0, h, 0.0
    if at_low > 0.0:
        time = h * at_low / (at_low - at_high)
    for _ in range(50 if at_low > 0.0 else 0):
        q = position_on_path(p, v, a, time)
        off, normal, surface = facing(planes, k, q, now + time, radius)
        speed = dot(minus(velocity_on_path(v, a, time), surface), normal)
        low, high, time, found = narrowed(low, high, time, off, speed)
        if found:
            break
    when = now + time
    if when < planes[k, BEGIN] - _SAME or when > planes[k, END] + _SAME:
        return math.inf
    return time if over(planes, k, position_on_path(p, v, a, time), when, 0.0) else math.inf


@in_place
def _point_then(planes: Array, k: int, late: float) -> Vector:
    """Point of a plane that moves, so much later than `SINCE`."""
    return position_on_path(
        columns(planes, k, 0), columns(planes, k, VELOCITY), columns(planes, k, PUSH), late
    )


@in_place
def over(planes: Array, k: int, p: Vector, now: float, reach: float) -> bool:
    """Whether a centre is over a plane that moves, or beside it by less than `reach`."""
    late = now - planes[k, SINCE]
    arm = minus(p, _point_then(planes, k, late))
    mean = plus(columns(planes, k, SPIN), times(0.5 * late, columns(planes, k, TWIST)))
    along = dot(arm, turned(columns(planes, k, 3), mean, late))
    side = dot(arm, turned(columns(planes, k, 6), mean, late))
    return abs(along) <= planes[k, 12] + reach and abs(side) <= planes[k, 13] + reach


@in_place
def _local(planes: Array, k: int, vector: Vector) -> Vector:
    """Components of a vector along the axes of a row."""
    return (
        dot(vector, columns(planes, k, 3)),
        dot(vector, columns(planes, k, 6)),
        dot(vector, columns(planes, k, 9)),
    )


@in_place
def _nearest(planes: Array, k: int, local: Vector) -> Nearest:
    """Closest point of a solid, in its axes."""
    section = planes[k, SECTION:SECTION_END]
    return nearest_of(section, local, radial_of(section, local), False)
