# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Edges that another plane shields: no sphere touches an edge inside a face (ghost collisions).

A sphere touches a union of surfaces where the distance to it has a local minimum. A point of an
edge that lies on another plane is none if that plane, which is convex, is nearer elsewhere.
"""

from __future__ import annotations

from .rectangle import from_plane, is_over_face, offset_from_rectangle, to_plane
from .solids import is_solid
from .world import SLIDE, SLOW, World
from ..kernels.jit import in_place
from ..kernels.vector import length, minus, row, Vector

# distance [lengths] up to which a point lies on a plane: tiles and boxes meet but for rounding
_ON_PLANE = 1e-6
# differences of distances [lengths] up to which they are equal
_EQUAL = 1e-9


@in_place
def offset_from_plane(world: World, plane: int, point: Vector) -> Vector:
    """Vector to a point from the closest one of a plane, in the axes of the plane."""
    local = to_plane(world.axes[plane], minus(point, row(world.point, plane)))
    return offset_from_rectangle(local, world.half[plane])


@in_place
def is_shielded(world: World, edge_of: int, other: int, centre: Vector) -> bool:
    """Whether a sphere cannot touch the edge of one plane, because of another plane there.

    Of two edges that are one line, as at a crest, only one counts: that of the plane which takes
    less energy, so that the order of the planes does not matter.
    """
    if is_solid(world, other):
        return False
    offset = offset_from_plane(world, edge_of, centre)
    closest = minus(centre, from_plane(world.axes[edge_of], offset))
    if length(offset_from_plane(world, other, closest)) > _ON_PLANE:
        return False
    there = offset_from_plane(world, other, centre)
    farther = length(offset) - length(there)
    tie = is_over_face(there) or _precedes(world, other, edge_of)
    return farther > _EQUAL or (farther >= -_EQUAL and tie)


@in_place
def _precedes(world: World, one: int, other: int) -> bool:
    restitution = world.laws[one, SLOW] - world.laws[other, SLOW]
    if restitution != 0:
        return restitution > 0
    friction = world.laws[one, SLIDE] - world.laws[other, SLIDE]
    if friction != 0:
        return friction < 0
    return one < other
