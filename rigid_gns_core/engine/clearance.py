# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether what flies for a frame can touch nothing in it; of one sphere, or of eight as lanes."""

from __future__ import annotations

from .broad_phase import PAD
from .plane_motion import speed_of_plane
from .solids import is_near_solid, is_solid
from .spheres import Spheres
from .world import weight_of, World
from ..kernels.jit import in_place
from ..kernels.lanes import larger, Mask, smaller
from ..kernels.vector import dot, length, minus, plus, row, times, Vector

# margin [radii] within which a sphere counts as touched here; more than that of the engine
_MARGIN = 2.0 * PAD


@in_place
def margin_of_flight(
    world: World, i: int, velocity: Vector, after: Vector, dt: float
) -> tuple[Mask, float]:
    """How far a flight of sphere i is to be from what it does not touch.

    Args:
        world: What does not move.
        i: The sphere.
        velocity: At the start.
        after: Velocity at the end.
        dt: Length of the flight.

    Returns:
        Whether air bends the path no more than the margin holds; and the margin, of the straight
        way between the ends.
    """
    push = length(minus(minus(after, velocity), times(dt, row(world.flight, i))))
    weight = weight_of(world)
    # sag of the path, at most |a| dt^2 / 8, |a| at most the weight and four times the mean push
    sag = 0.125 * dt * (weight * dt + 4.0 * push)
    is_light = 2.0 * push <= length(velocity) + weight * dt
    return is_light, (1.0 + _MARGIN) * world.radius[i] + sag


@in_place
def is_clear(world: World, plane: int, p: Vector, q: Vector, margin: float) -> Mask:
    """Whether all of the way from p to q is farther than `margin` from a plane."""
    axes, point = world.axes[plane], row(world.point, plane)
    begin, end = minus(p, point), minus(q, point)
    first, last = dot(row(axes, 2), begin), dot(row(axes, 2), end)
    clear = smaller(first, last) > margin
    if world.two_sided[plane]:
        clear = clear | (larger(first, last) < -margin)
        for axis in range(2):
            edge = margin + world.half[plane, axis]
            first, last = dot(row(axes, axis), begin), dot(row(axes, axis), end)
            clear = clear | (smaller(first, last) > edge) | (larger(first, last) < -edge)
    return clear


@in_place
def pass_clear(offset: Vector, way: Vector, near: float) -> Mask:
    """Whether two spheres stay farther apart than `near` while one passes the other.

    Args:
        offset: Position of one relative to the other, at the start.
        way: How that changes, on a straight line.
        near: Least distance; the sum of both margins.
    """
    share = -dot(offset, way) / larger(dot(way, way), 1e-300)
    nearest = plus(offset, times(smaller(larger(share, 0.0), 1.0), way))
    return length(nearest) > near


@in_place
def flies_clear_of_surface(
    world: World, plane: int, before: Spheres, after: Spheres, i: int, margin: float, dt: float
) -> bool:
    """Whether sphere i flies from one state to another clear of a surface, which may move."""
    p, q = row(before.positions, i), row(after.positions, i)
    if world.moving:
        speed = max(speed_of_plane(world, plane, p), speed_of_plane(world, plane, q))
        margin += 1.1 * speed * dt  # its path bends as it turns
    if is_solid(world, plane):
        return not is_near_solid(world, plane, p, margin + length(minus(q, p)))
    return is_clear(world, plane, p, q, margin)


@in_place
def fly_clear_of_each_other(
    before: Spheres, after: Spheres, i: int, j: int, margin: float
) -> bool:
    """Whether two spheres fly from one state to another clear of each other."""
    offset = minus(row(before.positions, i), row(before.positions, j))
    end = minus(row(after.positions, i), row(after.positions, j))
    return pass_clear(offset, minus(end, offset), margin)
