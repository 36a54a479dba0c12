# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which spheres and planes might touch in a frame, whatever happens to them in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import find_pairs, Flags, Indices
from ..kernels.vector import dot, length, minus, row
from ..scenes.state import Array


class Candidates(NamedTuple):
    """Pairs of bodies, by the first one; m of them.

    a: sphere, shape (m,); b: the other sphere, a < b, or n for a plane, shape (m,); plane: number
    of the plane, -1 for pairs, shape (m,); side: side of the plane that the sphere is on, -1
    behind a plate (a plane with an end on all sides), else 1, shape (m,); key: a number that a
    pair keeps from frame to frame; they are sorted by it, shape (m,).
    """

    a: Indices
    b: Indices
    plane: Indices
    side: Array
    key: Indices


@in_place
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
    near, side = np.zeros((count, planes), np.bool_), np.ones((count, planes))
    for k in range(planes):
        _mark_near_plane(world, k, positions, before, extent, awake, near, side)
    return _merged(first, second, near, side)


@in_place
def _mark_near_plane(
    world: World,
    plane: int,
    positions: Array,
    before: Array,
    extent: Array,
    awake: Flags,
    near_out: Flags,
    side_out: Array,
) -> None:
    """Which spheres may get to a plane, shape (n, s), and on which side of it they were before."""
    axes, half = world.axes[plane], world.half[plane]
    point, plate = row(world.point, plane), world.plate[plane]
    one, two, up = row(axes, 0), row(axes, 1), row(axes, 2)
    half_one, half_two = half[0], half[1]
    for i in range(len(positions)):
        offset, reach = minus(row(positions, i), point), extent[i]
        height = dot(up, offset)
        if plate:
            height = math.fabs(height)
            if dot(up, minus(row(before, i), point)) < 0:
                side_out[i, plane] = -1.0
        if height <= reach and awake[i]:
            beyond = max(
                math.fabs(dot(one, offset)) - half_one, math.fabs(dot(two, offset)) - half_two
            )
            near_out[i, plane] = beyond <= reach


@compiled
def _merged(first: Indices, second: Indices, near: Flags, sides: Array) -> Candidates:
    """Pairs and planes of each sphere, one after the other."""
    count, planes = near.shape
    size, pair, k = len(first) + near.sum(), 0, 0
    a, b = np.empty(size, np.int64), np.empty(size, np.int64)
    plane, side, key = np.full(size, -1), np.ones(size), np.empty(size, np.int64)
    for i in range(count):
        while pair < len(first) and first[pair] == i:
            a[k], b[k] = i, second[pair]
            key[k] = i * (count + planes) + b[k]
            pair += 1
            k += 1
        for other in range(planes):
            if near[i, other]:
                a[k], b[k], plane[k], side[k] = i, count, other, sides[i, other]
                key[k] = i * (count + planes) + count + other
                k += 1
    return Candidates(a=a, b=b, plane=plane, side=side, key=key)
