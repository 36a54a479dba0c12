# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planes that move: rackets, trays and belts, with a twist that stays or that a plan changes.

A sphere is followed in the frame of its plane, which turns with W about its point, so that the
time of impact is on the path that it has there (r from the point of the plane, V its velocity):

    v' = v - V - W x r,    a' = a - dV/dt - dW/dt x r - W x (W x r) - 2 W x v'.

Twists change at a constant rate within a substep, see `planned_planes`.
"""

from __future__ import annotations

import math

from .flight import position_on_path
from .impact import Impact
from .world import AXES, BELT, PLANNED, POINT, PUSH, RATE, SPEED, TURNING, TWIST, VELOCITY, World
from ..kernels.jit import in_place
from ..kernels.vector import across, cross, dot, length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

# share of a substep by which a time may be before it: rounding
_ROUNDED = 1e-6


@in_place
def moves(world: World, plane: int) -> bool:
    """Whether a plane moves; -1: none."""
    return world.moving and plane >= 0 and world.twists.moves[plane]


@in_place
def turned(vector: Vector, spin: Vector, time: float) -> Vector:
    """Vector after a time at an angular velocity, by Rodrigues' formula."""
    speed = length(spin)
    if speed == 0:
        return vector
    axis, cosine, sine = times(1.0 / speed, spin), math.cos(speed * time), math.sin(speed * time)
    along = times((1.0 - cosine) * dot(axis, vector), axis)
    return plus(plus(times(cosine, vector), times(sine, cross(axis, vector))), along)


@in_place
def set_clock(world_out: World, time: float) -> None:
    """Put all planes where they are a time after the start of the rollout."""
    if not world_out.moving:
        return
    twists = world_out.twists
    twists.clock[0] = time
    step = 0
    if len(twists.path):
        step = math.floor(time / twists.step + _ROUNDED) - twists.first
        step = min(max(step, 0), len(twists.path) - 1)
    for plane in range(len(world_out.point)):
        if len(twists.path) and twists.path[step, plane, PLANNED] > 0:
            _put_on_path(world_out, plane, step, time)
        elif twists.moves[plane]:
            gone, spin = times(time, row(twists.velocity, plane)), row(twists.spin, plane)
            put(world_out.point, plane, plus(row(twists.point, plane), gone))
            for axis in range(3):
                own = row(twists.axes[plane], axis)
                put(world_out.axes[plane], axis, turned(own, spin, time))


@in_place
def _put_on_path(world_out: World, plane: int, step: int, time: float) -> None:
    """Put a plane where its plan has it within a substep, with its twist then."""
    twists, path = world_out.twists, world_out.twists.path[step, plane]
    late = time - (twists.first + step) * twists.step
    velocity, push = _three(path, VELOCITY), _three(path, PUSH)
    spin, twist = _three(path, TURNING), _three(path, TWIST)
    mean = plus(spin, times(0.5 * late, twist))
    gone = times(late, plus(velocity, times(0.5 * late, push)))
    put(world_out.point, plane, plus(_three(path, POINT), gone))
    for axis in range(3):
        put(world_out.axes[plane], axis, turned(_three(path, AXES + 3 * axis), mean, late))
    put(twists.velocity, plane, plus(velocity, times(late, push)))
    put(twists.spin, plane, plus(spin, times(late, twist)))
    put(twists.acceleration, plane, push)
    put(twists.spin_rate, plane, twist)
    put(twists.belt, plane, turned(_three(path, BELT), mean, late))
    twists.since[plane] = time
    twists.fastest[plane, 0], twists.fastest[plane, 1] = path[SPEED], path[RATE]


@in_place
def _three(values: Array, first: int) -> Vector:
    return values[first], values[first + 1], values[first + 2]


@in_place
def advance_planes(world_out: World, h: float) -> None:
    """Move all planes on by a time."""
    if world_out.moving:
        set_clock(world_out, world_out.twists.clock[0] + h)


@in_place
def velocity_of_plane(world: World, plane: int, place: Vector) -> Vector:
    """Velocity V + W x r of a plane at a place, without that of a belt."""
    arm = minus(place, row(world.point, plane))
    return plus(row(world.twists.velocity, plane), cross(row(world.twists.spin, plane), arm))


@in_place
def speed_of_plane(world: World, plane: int, place: Vector) -> float:
    """Most speed of a plane near a place within a frame, |V| + |W| |r|."""
    twists, arm = world.twists, length(minus(place, row(world.point, plane)))
    speed = max(length(row(twists.velocity, plane)), twists.fastest[plane, 0])
    return speed + arm * max(length(row(twists.spin, plane)), twists.fastest[plane, 1])


@in_place
def path_on_plane(
    world: World, plane: int, place: Vector, velocity: Vector, acceleration: Vector
) -> tuple[Vector, Vector]:
    """Velocity and acceleration of a sphere in the frame of a plane, with the axes of the world.

    Those given, where the plane stays.
    """
    if not moves(world, plane):
        return velocity, acceleration
    spin, arm = row(world.twists.spin, plane), minus(place, row(world.point, plane))
    velocity = minus(velocity, velocity_of_plane(world, plane, place))
    turning = plus(cross(spin, cross(spin, arm)), times(2.0, cross(spin, velocity)))
    changing = cross(row(world.twists.spin_rate, plane), arm)
    changing = plus(changing, row(world.twists.acceleration, plane))
    return velocity, minus(minus(acceleration, turning), changing)


@in_place
def in_world(
    world: World, plane: int, radius: float, place: Vector, velocity: Vector, pull: Vector,
    acceleration: Vector, impact: Impact, h: float,
) -> tuple[Vector, float, Vector]:  # fmt: skip
    """Turn the impact with a plane that moves from its frame into the world.

    Args:
        world: With the plane as it is now.
        plane: The plane.
        radius: Of the sphere.
        place: Its centre now.
        velocity: Of the sphere now.
        pull: Acceleration of its path.
        acceleration: That in the frame of the plane.
        impact: In the frame of the plane.
        h: Length of the substep.

    Returns:
        The normal, the turning speed, and the velocity of the surface at the contact.
    """
    time, far = impact.normal_time, radius + impact.gap
    # bodies gain no separation by the turn of the frame, contacts do
    turning = impact.turning_speed + dot(impact.normal, minus(acceleration, pull)) * (h - time)
    normal = turned(impact.normal, row(world.twists.spin, plane), time)
    surface = _surface_velocity(world, plane, place, velocity, pull, time, normal, far)
    if impact.lasting:  # what sticks has the velocity of the surface at the end
        end = _surface_velocity(world, plane, place, velocity, pull, h, normal, far)
        surface = plus(surface, across(minus(end, surface), normal))
    return normal, turning, surface


@in_place
def _surface_velocity(
    world: World, plane: int, place: Vector, velocity: Vector, acceleration: Vector, time: float,
    normal: Vector, far: float,
) -> Vector:  # fmt: skip
    """Velocity of a surface at a contact after a time, V + W x r + s, s that of a belt.

    Args:
        world: With the plane as it is now.
        plane: The plane.
        place: Centre of the sphere now.
        velocity: Of the sphere now.
        acceleration: Of its path.
        time: The time.
        normal: Of the contact, then.
        far: Distance of the centre from the plane, then.
    """
    twists = world.twists
    spin, push = row(twists.spin, plane), row(twists.acceleration, plane)
    then = minus(position_on_path(place, velocity, acceleration, time), times(far, normal))
    own = row(twists.velocity, plane)
    point = position_on_path(row(world.point, plane), own, push, time)
    belt = turned(row(twists.belt, plane), spin, twists.clock[0] - twists.since[plane] + time)
    spin = plus(spin, times(time, row(twists.spin_rate, plane)))
    moving = plus(plus(own, times(time, push)), cross(spin, minus(then, point)))
    return plus(moving, belt)


@in_place
def carried(world: World, plane: int, place: Vector, h: float) -> Vector:
    """Where what was at a place a time ago is now, had it moved with the plane."""
    if not moves(world, plane):
        return place
    gone, point = times(h, row(world.twists.velocity, plane)), row(world.point, plane)
    arm = plus(minus(place, point), gone)
    return plus(point, turned(arm, row(world.twists.spin, plane), h))
