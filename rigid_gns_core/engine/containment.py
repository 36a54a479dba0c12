# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""No centre passes through a plane, at any speed and whatever presses on it.

Blows are solved on the free paths of a substep; a path that several of them bend may still lead
through a plane. So the straight way of each centre over a substep is cut where it would, and the
side of a plane that a sphere is on needs no memory. A plane without end, which has one face, cuts
only ways that begin in front of it: it pushes out what is behind it. The way is that in the frame
of the plane, where it moves.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates, PAD, with_planes
from .flight import reach_of
from .plane_motion import carried, moves, velocity_of_plane
from .rectangle import to_plane
from .restitution import restitution_on_plane
from .solids import is_beside, is_solid, nearest_in_world, share_to_solid
from .world import weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import dot, length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

# share of its size by which a plane is taken larger, so that planes that meet leave no gap
_OVERLAP = 1e-9
# distance [radii] from a solid up to which a centre goes through its surface
_THROUGH = 1e-6


class Cuts(NamedTuple):
    """Ways that planes cut: the share of each that is left, and which plane, shape (n,)."""

    share: Array
    plane: Indices


@compiled
def new_cuts(spheres: int) -> Cuts:
    """Room for the ways of so many spheres."""
    return Cuts(share=np.empty(spheres), plane=np.empty(spheres, np.int64))


@in_place
def keep_sides(
    world: World,
    candidates: Candidates,
    members: Indices,
    pairs: Indices,
    before: Array,
    speeds: Array,
    h: float,
    cuts_out: Cuts,
    positions_out: Array,
    velocities_out: Array,
) -> None:
    """Stop centres that passed through a plane on their side of it; they bounce off.

    Args:
        world: What does not move.
        candidates: All pairs of the frame.
        members: The spheres.
        pairs: Candidates of theirs.
        before: Centres at the start of the substep, shape (n, 3).
        speeds: Speeds there, shape (n,): within what they allow, a sphere meets candidates only.
        h: Length of the substep.
        cuts_out: Scratch.
        positions_out: At its end; corrected in place.
        velocities_out: At its end, shape (n, 3); corrected in place.
    """
    first, plane = cuts_out.share, cuts_out.plane
    for i in members:
        first[i], plane[i] = 1.0, -1
    for k in pairs[with_planes(candidates, pairs) :]:
        i, p = candidates.a[k], candidates.plane[k]
        if p >= 0:
            _cut(world, p, i, before, positions_out, h, first, plane)
    gravity = weight_of(world)
    for i in members:
        way = length(minus(row(positions_out, i), row(before, i)))
        if way > reach_of(speeds[i], gravity, h) + 0.5 * PAD * world.radius[i]:
            for p in range(len(world.point)):  # it was struck, and meets what it could not before
                _cut(world, p, i, before, positions_out, h, first, plane)
    for i in members:
        p = plane[i]
        if p < 0:
            continue
        start, velocity = carried(world, p, row(before, i), h), row(velocities_out, i)
        given = (0.0, 0.0, 0.0)
        if moves(world, p):
            given = velocity_of_plane(world, p, start)
            velocity = minus(velocity, given)
        way = minus(row(positions_out, i), start)
        put(positions_out, i, plus(start, times(first[i], way)))
        normal = row(world.axes[p], 2)
        if is_solid(world, p):
            _, normal = nearest_in_world(world, p, row(positions_out, i))
        if dot(normal, way) * dot(normal, velocity) > 0:
            e = restitution_on_plane(world, i, p, math.fabs(dot(normal, velocity)))
            turned = times((1.0 + e) * dot(normal, velocity), normal)
            put(velocities_out, i, plus(minus(velocity, turned), given))


@in_place
def _cut(
    world: World,
    plane: int,
    i: int,
    before: Array,
    after: Array,
    h: float,
    share_out: Array,
    plane_out: Indices,
) -> None:
    """Shorten the way of a sphere where a plane stops it first."""
    if is_solid(world, plane):
        share = _share_to_solid(world, plane, i, row(before, i), row(after, i))
    else:
        start = carried(world, plane, row(before, i), h)
        share = _share_of_way(world, plane, i, start, row(after, i))
    if share < share_out[i]:
        share_out[i], plane_out[i] = share, plane


@in_place
def _share_of_way(world: World, plane: int, i: int, start: Vector, end: Vector) -> float:
    """Share of its way that a sphere may go until a plane stops its centre, a radius before it.

    1 where the way does not lead through the plane.
    """
    axes, half, point = world.axes[plane], world.half[plane], row(world.point, plane)
    local, there = to_plane(axes, minus(start, point)), to_plane(axes, minus(end, point))
    side = -1.0 if local[2] < 0 and world.two_sided[plane] else 1.0
    height, depth = side * local[2], -side * there[2]
    if height < 0 or depth < 0 or height + depth <= 0:
        return 1.0
    share = height / (height + depth)
    for axis in range(2):
        across = local[axis] + share * (there[axis] - local[axis])
        if math.fabs(across) > half[axis] * (1.0 + _OVERLAP):
            return 1.0
    return (height - min(height, world.radius[i])) / (height + depth)


@in_place
def _share_to_solid(world: World, plane: int, i: int, start: Vector, end: Vector) -> float:
    """As `_share_of_way`, for a solid."""
    radius = world.radius[i]
    if is_beside(world.solids[plane]):
        return 1.0
    if share_to_solid(world, plane, start, end, _THROUGH * radius) == 1.0:
        return 1.0
    share = share_to_solid(world, plane, start, end, radius)
    return share if share < 1.0 else 0.0  # it begins nearer
