"""Which spheres and planes might touch in a frame, whatever happens to them in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..state import Array
from .jit import compiled
from .neighbours import Flags, Indices, find_pairs
from .vector import Vector, dot, length, minus, row
from .world import World


class Candidates(NamedTuple):
    """Pairs of bodies, by the first one; m of them.

    a: sphere, shape (m,); b: the other sphere, a < b, or n for a plane, shape (m,); plane: number
    of the plane, -1 for pairs, shape (m,); side: side of the plane that the sphere is on, -1 behind
    a plate (a plane with an end on all sides), else 1, shape (m,); key: a number that a pair keeps
    from frame to frame; they are sorted by it, shape (m,).
    """

    a: Indices
    b: Indices
    plane: Indices
    side: Array
    key: Indices


@compiled
def reach_of(speed: float, gravity: float, dt: float) -> float:
    """How far a sphere may get in a frame: it can be deflected to any direction."""
    return speed * dt + gravity * dt**2


@compiled
def find_candidates(
    world: World, positions: Array, velocities: Array, dt: float, awake: Flags, before: Array
) -> Candidates:
    """All contacts that this frame may bring.

    One that is struck may get faster; what it then reaches is found when it outruns its reach.

    Args:
        world: What does not move.
        positions: Centres, shape (n, 3).
        velocities: Shape (n, 3).
        dt: Length of the frame.
        awake: Spheres that take part, a pair needs one; shape (n,).
        before: Centres when the frame began, shape (n, 3): a sphere that a substep took through a
            plate is still on the side it was.
    """
    count, planes = len(positions), len(world.point)
    weight = length((world.gravity[0], world.gravity[1], world.gravity[2]))
    extent = np.empty(count)
    for i in range(count):
        pull = weight if awake[i] else 0.0
        reach = reach_of(length(row(velocities, i)), pull, dt)
        extent[i] = 1.01 * world.radius[i] + reach
    first, second = find_pairs(positions, extent, awake)
    meets = np.empty((max(16, count), 2), np.int64)
    sides = np.empty(len(meets))
    others = 0
    for i in range(count):
        if not awake[i]:
            continue
        for k in range(planes):
            near, side = _near_plane(world, k, row(positions, i), row(before, i), extent[i])
            if not near:
                continue
            if others == len(meets):
                more, more_sides = np.empty((2 * others, 2), np.int64), np.empty(2 * others)
                more[:others], more_sides[:others] = meets, sides
                meets, sides = more, more_sides
            meets[others, 0], meets[others, 1], sides[others] = i, k, side
            others += 1
    return _merged(first, second, meets[:others], sides, count, count + planes)


@compiled
def _near_plane(
    world: World, plane: int, position: Vector, before: Vector, reach: float
) -> tuple[bool, float]:
    """Whether a sphere may get there, and on which side of it the sphere was before."""
    offset = minus(position, row(world.point, plane))
    axes, half = world.axes[plane], world.half[plane]
    height, side = dot(row(axes, 2), offset), 1.0
    if world.plate[plane]:
        height = math.fabs(height)
        if dot(row(axes, 2), minus(before, row(world.point, plane))) < 0:
            side = -1.0
    if height > reach:
        return False, side
    for axis in range(2):
        if math.fabs(dot(row(axes, axis), offset)) - half[axis] > reach:
            return False, side
    return True, side


@compiled
def _merged(
    first: Indices, second: Indices, meets: Indices, sides: Array, count: int, bodies: int
) -> Candidates:
    """Pairs and planes of each sphere, one after the other."""
    size = len(first) + len(meets)
    a, b = np.empty(size, np.int64), np.empty(size, np.int64)
    plane, side, key = np.full(size, -1), np.ones(size), np.empty(size, np.int64)
    pair, other = 0, 0
    for k in range(size):
        mine = other == len(meets) or (pair < len(first) and first[pair] <= meets[other, 0])
        if mine:
            a[k], b[k] = first[pair], second[pair]
            key[k] = a[k] * bodies + b[k]
            pair += 1
        else:
            a[k], b[k], plane[k], side[k] = meets[other, 0], count, meets[other, 1], sides[other]
            key[k] = a[k] * bodies + count + plane[k]
            other += 1
    return Candidates(a, b, plane, side, key)
