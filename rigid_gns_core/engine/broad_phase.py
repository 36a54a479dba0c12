# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Broad phase: pairs of bodies that might touch in a frame, whatever contacts do to them in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .flight import reach_in_wind, reach_of
from .islands import connect, no_islands, root_of
from .plane_motion import speed_of_plane
from .solids import is_near_solid, is_solid
from .world import weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import find_pairs, Flags, Indices
from ..kernels.vector import dot, length, minus, row
from ..scenes.state import Array

# margin [radii] of the reach of a sphere, for speculative contacts and push-out
PAD = 0.01


class Candidates(NamedTuple):
    """Candidate pairs of bodies, sorted by their keys; m of them, shape (m,) each.

    a: sphere; b: the other sphere, a < b, or n for a plane; plane: index of the plane, -1 for two
    spheres; key: number of the pair, the same in all frames; pairs: how many are of two spheres,
    which are first.
    """

    a: Indices
    b: Indices
    plane: Indices
    key: Indices
    pairs: int


@compiled
def find_candidates(
    world: World, positions: Array, velocities: Array, dt: float, awake: Flags, spare: float
) -> Candidates:
    """All pairs that may touch in a frame, or a part of one.

    A sphere that is struck may outrun its reach: `frame.advance` then looks for pairs again.

    Args:
        world: What does not move.
        positions: Centres, shape (n, 3).
        velocities: Shape (n, 3).
        dt: How long it is.
        awake: Spheres that are awake, at least one of a pair; shape (n,).
        spare: How much farther out pairs are looked for [radii], since blows make spheres faster.
    """
    count, planes = len(positions), len(world.point)
    weight = weight_of(world)
    extent = np.empty(count)
    for i in range(count):
        pull = weight if awake[i] else 0.0
        reach = reach_of(length(row(velocities, i)), pull, dt)
        if world.in_air and awake[i]:
            reach += reach_in_wind(world, i, row(velocities, i), weight, dt)
        extent[i] = (1.0 + PAD + spare) * world.radius[i] + reach
    first, second = find_pairs(positions, extent, awake)
    near = np.zeros((count, planes), np.bool_)
    for k in range(planes):
        _mark_near_plane(world, k, positions, extent, dt, awake, near)
    return _merged(first, second, near)


@in_place
def _mark_near_plane(
    world: World,
    plane: int,
    positions: Array,
    extent: Array,
    dt: float,
    awake: Flags,
    near_out: Flags,
) -> None:
    """Mark spheres that may reach a plane."""
    if is_solid(world, plane):
        for i in range(len(positions)):
            near = is_near_solid(world, plane, row(positions, i), extent[i])
            near_out[i, plane] = awake[i] and near
        return
    axes, half = world.axes[plane], world.half[plane]
    point, two_sided = row(world.point, plane), world.two_sided[plane]
    x_axis, y_axis, up = row(axes, 0), row(axes, 1), row(axes, 2)
    half_x, half_y = half[0], half[1]
    for i in range(len(positions)):
        offset, reach = minus(row(positions, i), point), extent[i]
        if world.moving:
            reach += speed_of_plane(world, plane, row(positions, i)) * dt
        height = dot(up, offset)
        if two_sided:
            height = math.fabs(height)
        if height <= reach and awake[i]:
            beyond = max(
                math.fabs(dot(x_axis, offset)) - half_x, math.fabs(dot(y_axis, offset)) - half_y
            )
            near_out[i, plane] = beyond <= reach


@compiled
def _merged(first: Indices, second: Indices, near: Flags) -> Candidates:
    """Candidates in the order of their keys: those of two spheres, then those with planes."""
    count, planes = near.shape
    pairs = len(first)
    size, k = pairs + near.sum(), pairs
    a, b = np.empty(size, np.int64), np.full(size, count)
    plane, key = np.full(size, -1), np.empty(size, np.int64)
    for j in range(pairs):  # an assignment of slices would compile its errors, for two seconds
        a[j], b[j], key[j] = first[j], second[j], first[j] * count + second[j]
    for i in range(count):
        for surface in range(planes):
            if near[i, surface]:
                a[k], plane[k] = i, surface
                key[k] = count * count + i * planes + surface
                k += 1
    return Candidates(a=a, b=b, plane=plane, key=key, pairs=pairs)


@compiled
def linked_to(candidates: Candidates, chosen: Flags, asleep: Flags) -> tuple[Candidates, Flags]:
    """Candidates of the spheres that candidates link to chosen ones, and which spheres these are.

    Args:
        candidates: Of a frame.
        chosen: Spheres, shape (n,).
        asleep: Spheres that link none, shape (n,).

    Returns:
        The candidates, and flags of shape (n + 1,), the last of which, for planes, is False.
    """
    count, size = len(chosen), len(candidates.a)
    links, linked = no_islands(count), np.zeros(count + 1, np.bool_)
    for k in range(candidates.pairs):
        if not (asleep[candidates.a[k]] or asleep[candidates.b[k]]):
            connect(links, candidates.a[k], candidates.b[k])
    for i in range(count):
        if chosen[i]:
            linked[root_of(links.parent, i)] = True
    for i in range(count):
        linked[i] = linked[root_of(links.parent, i)] and not asleep[i]
    kept, pairs = 0, 0
    a, b = np.empty(size, np.int64), np.empty(size, np.int64)
    plane, key = np.empty(size, np.int64), np.empty(size, np.int64)
    for k in range(size):
        if linked[candidates.a[k]] or linked[candidates.b[k]]:
            a[kept], b[kept] = candidates.a[k], candidates.b[k]
            plane[kept], key[kept] = candidates.plane[k], candidates.key[k]
            kept += 1
            pairs += k < candidates.pairs
    found = Candidates(a=a[:kept], b=b[:kept], plane=plane[:kept], key=key[:kept], pairs=pairs)
    return found, linked


@in_place
def with_planes(candidates: Candidates, pairs: Indices) -> int:
    """Place in some candidates, sorted, from which on those with planes are, or one before it."""
    return candidates.pairs if len(pairs) == len(candidates.a) else 0


@in_place
def sphere_of(key: int, count: int, planes: int) -> int:
    """The sphere a of a candidate, by its key."""
    return key // count if key < count * count else (key - count * count) // planes
