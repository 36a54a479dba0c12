# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Narrow phase: when and along which normal bodies meet in a substep, on their free paths."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates
from .flight import position_on_path
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import dot, length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

# bodies nearer than this [radii of the smaller one] count as touching
TOUCH = 2e-4


class Contacts(NamedTuple):
    """Contacts of one substep; c of them. The normal points from body b to body a.

    candidate: index of the candidate pair, shape (c,); a, b, plane, side: as there; normal: unit
    normal at the time of impact, shape (c, 3); time: of impact, from the start of the substep,
    negative where the bodies overlap and should have met before; gap: between the surfaces at that
    time; speculative_gap: gap of a speculative contact, of bodies that do not meet on their free
    paths, but are so near that other contacts may bring them together (its time is 0), else 0;
    approach_speed: at the time of impact; acceleration: relative acceleration of the free paths
    along the normal; shape (c,) each.
    """

    candidate: Indices
    a: Indices
    b: Indices
    plane: Indices
    side: Array
    normal: Array
    time: Array
    gap: Array
    speculative_gap: Array
    approach_speed: Array
    acceleration: Array


class Impact(NamedTuple):
    """A contact, with its fields in `Contacts`; `found`: whether there is one."""

    found: bool
    normal: Vector
    time: float
    gap: float
    speculative_gap: float
    approach_speed: float
    acceleration: float


@in_place
def _no_impact() -> Impact:
    return Impact(
        found=False,
        normal=(0.0, 0.0, 1.0),
        time=0.0,
        gap=0.0,
        speculative_gap=0.0,
        approach_speed=0.0,
        acceleration=0.0,
    )


@in_place
def impact_of_spheres(
    offset: Vector,
    velocity: Vector,
    radius_a: float,
    radius_b: float,
    h: float,
    lookback: float,
    margin: float,
) -> Impact:
    """Contact of two spheres that touch or meet within h, on straight relative paths.

    The time of impact is the first root of |x + y t| = R, R = r_a + r_b. With d = |x| - R and
    b = x . y it is t = d (|x| + R) / (sqrt(b^2 - y^2 d (|x| + R)) - b), which loses no digits.

    Args:
        offset: x, position of a relative to b.
        velocity: y, velocity of a relative to b.
        radius_a: r_a.
        radius_b: r_b.
        h: Length of the substep.
        lookback: Spheres that overlap are taken to have met at most so long ago.
        margin: Gap up to which spheres that do not meet are speculative contacts.
    """
    touching, distance = radius_a + radius_b, length(offset)
    gap = distance - touching
    along = dot(offset, velocity)
    hits, ahead = False, 0.0
    if gap > 0 and along < 0:
        inside = along * along - dot(velocity, velocity) * gap * (distance + touching)
        if inside >= 0:
            ahead = gap * (distance + touching) / max(math.sqrt(inside) - along, 1e-30)
            hits = ahead <= h
    touches = gap <= TOUCH * min(radius_a, radius_b)
    if not (hits or touches or gap <= margin):
        return _no_impact()
    time = ahead
    if not hits:
        speed = -along / max(distance, 1e-30)
        time = min(0.0, max(-lookback, gap / speed)) if speed > 0 else 0.0
    at = plus(offset, times(max(time, 0.0), velocity))
    far = length(at)
    normal = times(1.0 / far, at) if far > 1e-9 else (0.0, 0.0, 1.0)
    speculative_gap = 0.0 if hits or touches else gap
    return Impact(
        found=True,
        normal=normal,
        time=time,
        gap=far - touching,
        speculative_gap=speculative_gap,
        approach_speed=-dot(normal, velocity),
        acceleration=0.0,
    )


@in_place
def offset_from_rectangle(local: Vector, half: Array) -> Vector:
    """Vector to a point from the closest one of a rectangle about the origin, normal along z."""
    x = max(min(local[0], half[0]), -half[0])
    y = max(min(local[1], half[1]), -half[1])
    return local[0] - x, local[1] - y, local[2]


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
def impact_with_plane(
    world: World,
    plane: int,
    side: float,
    radius: float,
    position: Vector,
    velocity: Vector,
    h: float,
    lookback: float,
    margin: float,
) -> Impact:
    """Contact of a sphere that touches or meets a bounded plane within h, on its parabola.

    The time of impact is the first root of d + s t + a t^2 / 2 = 0, with the gap d, and s and a
    velocity and gravity along the normal: t = 2 d / (sqrt(s^2 - 2 a d) - s).

    A plane with an infinite side bounds a body: spheres are in front of it, however deep. One that
    ends on all sides is a plate with two faces. An edge is met where the gap, taken as linear
    between start and end of the path, is 0.
    """
    axes, half = world.axes[plane], world.half[plane]
    local = to_plane(axes, minus(position, row(world.point, plane)))
    moving = to_plane(axes, velocity)
    pulling = to_plane(axes, (world.gravity[0], world.gravity[1], world.gravity[2]))
    speed, pull = side * moving[2], side * pulling[2]
    gap = side * local[2] - radius
    hits, ahead = False, 0.0
    inside = speed * speed - 2.0 * pull * gap
    if gap > 0 and inside >= 0:
        denominator = math.sqrt(inside) - speed
        if denominator > 0:
            ahead = 2.0 * gap / max(denominator, 1e-30)
            hits = ahead <= h
    touches = gap <= TOUCH * radius
    time = ahead
    if not hits:
        time = min(0.0, max(-lookback, gap / -speed)) if speed < 0 else 0.0
    there = position_on_path(local, moving, pulling, max(time, 0.0))
    on_face = math.fabs(there[0]) <= half[0] and math.fabs(there[1]) <= half[1]
    face = on_face and (hits or touches or gap <= margin)
    speculative_gap = 0.0 if hits or touches else gap
    if not face:
        # an edge: by the closest points at the start and at the end of the free path
        rim = offset_from_rectangle(local, half)
        rim_end = offset_from_rectangle(position_on_path(local, moving, pulling, h), half)
        if rim[0] == 0 and rim[1] == 0 and rim_end[0] == 0 and rim_end[1] == 0:
            return _no_impact()
        gap, gap_end = length(rim) - radius, length(rim_end) - radius
        if not (gap <= max(margin, TOUCH) or gap_end < 0):
            return _no_impact()
        speculative_gap = gap if gap_end >= 0 else 0.0
        time = 0.0
        if gap > 0 and gap_end < 0:
            time = h * min(1.0, max(0.0, gap / max(gap - gap_end, 1e-30)))
    if speculative_gap <= TOUCH * radius:
        speculative_gap = 0.0
    before = max(time, 0.0)
    at = position_on_path(local, moving, pulling, before)
    normal, distance = (0.0, 0.0, side), side * at[2]
    if not face:
        rim = offset_from_rectangle(at, half)
        distance = max(length(rim), 1e-30)
        normal = times(1.0 / distance, rim)
    velocity_then = plus(moving, times(before, pulling))
    return Impact(
        found=True,
        normal=from_plane(axes, normal),
        time=time,
        gap=distance - radius,
        speculative_gap=speculative_gap,
        approach_speed=-dot(velocity_then, normal),
        acceleration=dot(pulling, normal),
    )


@compiled
def find_contacts(
    world: World,
    positions: Array,
    velocities: Array,
    candidates: Candidates,
    chosen: Flags,
    h: float,
    lookback: float,
) -> Contacts:
    """Contacts of the next substep among the `chosen` candidates.

    Bodies that gravity may bring together within `h`, nearer than g h^2, are speculative contacts.
    """
    size, fixed = len(candidates.a), len(positions)
    margin = length((world.gravity[0], world.gravity[1], world.gravity[2])) * h**2
    which, normal, values = np.empty(size, np.int64), np.empty((size, 3)), np.empty((5, size))
    count = 0
    for k in range(size):
        if not chosen[k]:
            continue
        a, b, plane = candidates.a[k], candidates.b[k], candidates.plane[k]
        if b == fixed:
            impact = impact_with_plane(
                world=world,
                plane=plane,
                side=candidates.side[k],
                radius=world.radius[a],
                position=row(positions, a),
                velocity=row(velocities, a),
                h=h,
                lookback=lookback,
                margin=margin,
            )
        else:
            impact = impact_of_spheres(
                offset=minus(row(positions, a), row(positions, b)),
                velocity=minus(row(velocities, a), row(velocities, b)),
                radius_a=world.radius[a],
                radius_b=world.radius[b],
                h=h,
                lookback=lookback,
                margin=margin,
            )
        if impact.found:
            which[count] = k
            put(normal, count, impact.normal)
            values[0, count], values[1, count] = impact.time, impact.gap
            values[2, count] = impact.speculative_gap
            values[3, count], values[4, count] = impact.approach_speed, impact.acceleration
            count += 1
    which = which[:count]
    side = np.where(candidates.plane[which] < 0, 0.0, candidates.side[which])
    return Contacts(
        candidate=which,
        a=candidates.a[which],
        b=candidates.b[which],
        plane=candidates.plane[which],
        side=side,
        normal=normal[:count],
        time=values[0, :count],
        gap=values[1, :count],
        speculative_gap=values[2, :count],
        approach_speed=values[3, :count],
        acceleration=values[4, :count],
    )


@in_place
def gap_of(world: World, positions: Array, contacts: Contacts, k: int) -> tuple[float, Vector]:
    """Gap and unit normal of contact k at these positions."""
    a, b, plane = contacts.a[k], contacts.b[k], contacts.plane[k]
    sign, place = 1.0, row(positions, a)
    if plane < 0:
        offset = minus(place, row(positions, b))
    else:
        axes = world.axes[plane]
        rim = offset_from_rectangle(
            to_plane(axes, minus(place, row(world.point, plane))), world.half[plane]
        )
        if rim[0] == 0 and rim[1] == 0 and contacts.side[k] * rim[2] < 0:
            sign = -1.0  # the centre is behind the face
        offset = from_plane(axes, rim)
    far = length(offset)
    normal = times(sign / far, offset) if far > 1e-9 else row(contacts.normal, k)
    return sign * far - (world.radius[a] + world.radius[b]), normal
