# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Narrow phase: contacts of a substep among the candidates."""

from __future__ import annotations

import math
from typing import NamedTuple

from .broad_phase import Candidates, PAD
from .flight import Paths, position_on_path
from .impact import impact_with_plane
from .impacts import (
    ACCELERATION,
    APPROACH_SPEED,
    CROSSING_TIME,
    drop_doubles,
    find_impacts_of_spheres,
    GAP,
    Impacts,
    NORMAL_TIME,
    PARALLEL,
    REST_GAP,
    SPECULATIVE_GAP,
    TIME,
    TURNING_SPEED,
    write_rows,
    X,
    Y,
    Z,
)
from .plane_impacts import find_impacts_with_faces
from .plane_motion import in_world, moves, path_on_plane
from .rectangle import first_touch_of_spheres, is_over_face
from .shielding import is_shielded, offset_from_plane
from .solid_impact import impact_with_solid
from .solids import is_near_solid, is_solid
from .sphere_impact import impact_of_spheres, straight_meeting
from .world import gravity_of, weight_of, World
from ..kernels.jit import in_place
from ..kernels.lanes import WIDTH
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import cross, dot, length, minus, put, row, Vector
from ..scenes.state import Array

# most planes in a row to which a contact is handed on within a substep
_HANDS = 4


class Contacts(NamedTuple):
    """Contacts of one substep; c of them. The normal points from body b to body a.

    candidate: index of the candidate pair, shape (c,); a, b, plane: as there; normal, time, gap,
    speculative_gap, approach_speed, acceleration, turning_speed, crossing_time, rest_gap: as in
    `Impact`, shape (c, 3) or (c,).
    """

    candidate: Indices
    a: Indices
    b: Indices
    plane: Indices
    normal: Array
    time: Array
    gap: Array
    speculative_gap: Array
    approach_speed: Array
    acceleration: Array
    turning_speed: Array
    crossing_time: Array
    rest_gap: Array


@in_place
def find_impacts(
    world: World,
    paths: Paths,
    candidates: Candidates,
    pairs: Indices,
    chosen: Flags,
    h: float,
    lookback: float,
    impacts_out: Impacts,
) -> None:
    """Find the impacts of the next substep among candidates, on paths in flight.

    Bodies that gravity may bring together within `h`, nearer than g h^2, are speculative contacts.

    Args:
        world: What does not move.
        paths: Of all spheres.
        candidates: All of the frame.
        pairs: Which of them to consider: with one of a sphere and a plane, all of that sphere.
        chosen: Those that count, shape (m,).
        h: Length of the substep.
        lookback: Bodies that overlap are taken to have met at most so long ago.
        impacts_out: Those of the pairs are written.
    """
    impacts, edges, weight, lanes, first, last = impacts_out, False, weight_of(world), 0, 0, 0
    if len(pairs) == len(candidates.a) and not world.in_air:
        lanes, first, last = candidates.pairs // WIDTH * WIDTH, candidates.pairs, candidates.pairs
        if not (world.moving or world.has_solids):
            last += (len(pairs) - first) // WIDTH * WIDTH
        if lanes > 0 or last > first:
            write_rows(world, paths, impacts)
        find_impacts_of_spheres(world, candidates, lanes, chosen, h, lookback, impacts)
        find_impacts_with_faces(world, candidates, first, last, chosen, h, lookback, impacts)
    for k in pairs[lanes:]:  # all of them, or none of the first
        if first <= k < last and not impacts.edge[k]:
            continue
        impacts.found[k] = impacts.edge[k] = impacts.lasting[k] = False
        if chosen[k] and _may_meet(world, paths, candidates, k, h, weight):
            _find(world, paths, candidates, k, h, lookback, False, impacts)
            edges |= impacts.edge[k]
    if edges:
        for k in pairs:
            if impacts.found[k] and impacts.edge[k]:
                _shield(world, paths, candidates, k, h, lookback, impacts)
    drop_doubles(candidates, pairs, impacts)


@in_place
def _may_meet(
    world: World, paths: Paths, candidates: Candidates, k: int, h: float, weight: float
) -> bool:
    """Whether a candidate pair is near enough to meet within h, at a glance."""
    a, b, plane = candidates.a[k], candidates.b[k], candidates.plane[k]
    fall = weight * h * h
    if world.in_air:
        fall += length(row(paths.accelerations, a)) * h * h
        if plane < 0:
            fall += length(row(paths.accelerations, b)) * h * h
    if is_solid(world, plane):
        reach = (1.0 + PAD) * world.radius[a] + length(row(paths.velocities, a)) * h + fall
        return is_near_solid(world, plane, row(paths.positions, a), reach)
    if plane >= 0:
        normal, velocity = row(world.axes[plane], 2), row(paths.velocities, a)
        height = dot(normal, minus(row(paths.positions, a), row(world.point, plane)))
        if world.two_sided[plane]:
            height = math.fabs(height)
        if moves(world, plane):
            velocity, turning = path_on_plane(
                world, plane, row(paths.positions, a), velocity, (0.0, 0.0, 0.0)
            )
            fall += length(turning) * h * h
        reach = math.fabs(dot(normal, velocity)) * h + fall
        return height <= (1.0 + PAD) * world.radius[a] + reach
    offset = minus(row(paths.positions, a), row(paths.positions, b))
    velocity = minus(row(paths.velocities, a), row(paths.velocities, b))
    reach = (1.0 + PAD) * (world.radius[a] + world.radius[b]) + fall
    reach += math.sqrt(dot(velocity, velocity)) * h
    return dot(offset, offset) <= reach * reach


@in_place
def _find(
    world: World,
    paths: Paths,
    candidates: Candidates,
    k: int,
    h: float,
    lookback: float,
    lasts: bool,
    impacts_out: Impacts,
) -> None:
    a, b, plane = candidates.a[k], candidates.b[k], candidates.plane[k]
    weight = weight_of(world)
    margin, pressed = weight * h**2, weight > 0
    if is_solid(world, plane):
        impact = impact_with_solid(
            world=world,
            plane=plane,
            radius=world.radius[a],
            position=row(paths.positions, a),
            velocity=row(paths.velocities, a),
            acceleration=row(paths.accelerations, a) if world.in_air else gravity_of(world),
            h=h,
            lookback=lookback,
            margin=margin,
            pressed=pressed,
        )
    elif plane >= 0:
        velocity, acceleration = path_on_plane(
            world, plane, row(paths.positions, a), row(paths.velocities, a),
            row(paths.accelerations, a) if world.in_air else gravity_of(world),
        )  # fmt: skip
        impact = impact_with_plane(
            world=world,
            plane=plane,
            radius=world.radius[a],
            position=row(paths.positions, a),
            velocity=velocity,
            acceleration=acceleration,
            h=h,
            lookback=lookback,
            margin=margin,
            pressed=pressed,
            lasts=lasts,
        )
    else:
        relative = (0.0, 0.0, 0.0)  # in a vacuum both fall alike
        if world.in_air:
            relative = minus(row(paths.accelerations, a), row(paths.accelerations, b))
        offset = minus(row(paths.positions, a), row(paths.positions, b))
        velocity = minus(row(paths.velocities, a), row(paths.velocities, b))
        touching, bends = world.radius[a] + world.radius[b], dot(relative, relative) > 0
        hits, time = straight_meeting(offset, velocity, touching, h)
        if bends:
            time = first_touch_of_spheres(offset, velocity, relative, touching, h)
            hits = length(offset) > touching and time <= h
        impact = impact_of_spheres(
            offset=offset,
            velocity=velocity,
            acceleration=relative,
            bends=bends,
            radius_a=world.radius[a],
            radius_b=world.radius[b],
            hits=hits,
            time=time,
            h=h,
            lookback=lookback,
            margin=margin,
            pressed=pressed,
        )
    impacts, values = impacts_out, impacts_out.values
    impacts.found[k], impacts.edge[k] = impact.found, impact.edge
    if impact.found:
        impacts.lasting[k] = impact.lasting
        values[X, k], values[Y, k], values[Z, k] = impact.normal
        values[NORMAL_TIME, k], values[TIME, k] = impact.normal_time, impact.time
        values[GAP, k], values[SPECULATIVE_GAP, k] = impact.gap, impact.speculative_gap
        values[APPROACH_SPEED, k] = impact.approach_speed
        values[ACCELERATION, k] = impact.acceleration
        values[TURNING_SPEED, k] = impact.turning_speed
        values[CROSSING_TIME, k], values[REST_GAP, k] = impact.crossing_time, impact.rest_gap
        if moves(world, plane):
            normal, turning, surface = in_world(
                world, plane, world.radius[a], row(paths.positions, a), row(paths.velocities, a),
                row(paths.accelerations, a) if world.in_air else gravity_of(world), acceleration,
                impact, h,
            )  # fmt: skip
            values[X, k], values[Y, k], values[Z, k] = normal
            values[TURNING_SPEED, k] = turning
            put(impacts.surface_velocity, k, surface)
        if impact.crossing_time < h and _continues(world, paths, candidates, k, h):
            values[CROSSING_TIME, k] = math.inf


@in_place
def _shield(
    world: World,
    paths: Paths,
    candidates: Candidates,
    k: int,
    h: float,
    lookback: float,
    impacts_out: Impacts,
) -> None:
    """Drop an edge contact that another plane shields.

    A sphere that rolls over a seam hands its contact on: it lasts on the other plane.
    """
    impacts, a, current = impacts_out, candidates.a[k], k
    start = row(paths.positions, a)
    for hand in range(_HANDS):
        time = impacts.values[NORMAL_TIME, current]
        velocity, pull = path_on_plane(
            world, candidates.plane[current], start, row(paths.velocities, a),
            row(paths.accelerations, a),
        )  # fmt: skip
        centre = position_on_path(start, velocity, pull, time)
        other = _shielding(world, candidates, current, centre)
        if other < 0:
            return
        impacts.found[current] = False
        if not impacts.lasting[current]:
            return
        if hand == 0 and _is_ghost(world, candidates, current, row(paths.positions, a)):
            return
        if impacts.found[other] and not (impacts.edge[other] or impacts.lasting[other]):
            impacts.found[current] = True
            return  # it meets that face only later, and is held until then
        _find(world, paths, candidates, other, h, lookback, True, impacts)
        # a sphere that leaves a face within h is on it until then, whose ever its edge is
        crossing = impacts.values[CROSSING_TIME, current]
        if crossing < h:
            bound = min(impacts.values[CROSSING_TIME, other], crossing)
            impacts.values[CROSSING_TIME, other] = bound
            speed = impacts.values[APPROACH_SPEED, current]
            impacts.values[APPROACH_SPEED, other] = speed
        if not impacts.edge[other]:
            return
        current = other


@in_place
def _is_ghost(world: World, candidates: Candidates, k: int, centre: Vector) -> bool:
    """Whether a sphere touches another plane before the edge of that of a candidate."""
    if is_over_face(offset_from_plane(world, candidates.plane[k], centre)):
        return False
    return _shielding(world, candidates, k, centre) >= 0


@in_place
def _continues(world: World, paths: Paths, candidates: Candidates, k: int, h: float) -> bool:
    """Whether the plane of a contact goes on in another one where the sphere leaves it."""
    a = candidates.a[k]
    start, velocity = row(paths.positions, a), row(paths.velocities, a)
    velocity, pull = path_on_plane(
        world, candidates.plane[k], start, velocity, row(paths.accelerations, a)
    )
    centre = position_on_path(start, velocity, pull, h)
    other = _shielding(world, candidates, k, centre)
    if other < 0:
        return False
    normals = row(world.axes[candidates.plane[k]], 2), row(world.axes[candidates.plane[other]], 2)
    return length(cross(normals[0], normals[1])) < PARALLEL


@in_place
def _shielding(world: World, candidates: Candidates, k: int, centre: Vector) -> int:
    """Candidate whose plane shields the edge of candidate k; -1: none."""
    a, first = candidates.a[k], k
    while first > 0 and candidates.a[first - 1] == a and candidates.plane[first - 1] >= 0:
        first -= 1
    q = first
    while q < len(candidates.a) and candidates.a[q] == a:
        if q != k and is_shielded(world, candidates.plane[k], candidates.plane[q], centre):
            return q
        q += 1
    return -1
