# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impacts of candidates in memory; those of two spheres in a vacuum are found eight at once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates, PAD, with_planes
from .flight import Paths
from .impact import Impact
from .sphere_impact import impact_of_spheres, straight_meeting
from .world import weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.lanes import bits, columns_of, skip_lines, store, WIDTH
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import dot, minus
from ..scenes.state import Array

# sine of the angle up to which two planes are one
PARALLEL = 1e-7


class Impacts(NamedTuple):
    """Impacts of all candidates, shape (m,) and (12, m) at least.

    values: those of `Impact`, by the columns below; flat: the same in a row; rows: paths of
    the spheres, see `write_rows`, shape (8 n,); surface_velocity: of planes that
    move, at the contact, shape (m, 3), or (0, 3) where none does.
    """

    found: Flags
    edge: Flags
    lasting: Flags
    values: Array
    flat: Array
    rows: Array
    surface_velocity: Array


# columns of `Impacts.values`
(
    X,
    Y,
    Z,
    NORMAL_TIME,
    TIME,
    GAP,
    SPECULATIVE_GAP,
    APPROACH_SPEED,
    ACCELERATION,
    TURNING_SPEED,
    CROSSING_TIME,
    REST_GAP,
) = range(12)


@compiled
def new_impacts(spheres: int, moving: int, candidates: int) -> Impacts:
    """Room for so many, to be written; moving: how many may be of planes that move."""
    flags, values = np.empty((3, candidates), np.bool_), np.empty((12, candidates))
    rows = np.empty(8 * (spheres + 1))
    return Impacts(
        found=flags[0],
        edge=flags[1],
        lasting=flags[2],
        values=values,
        flat=values.reshape(-1),
        rows=rows[skip_lines(rows) :],
        surface_velocity=np.empty((moving, 3)),
    )


@in_place
def write_rows(world: World, paths: Paths, impacts_out: Impacts) -> None:
    """Write positions, radii and velocities of the spheres as rows of eight."""
    rows = impacts_out.rows
    for i in range(len(paths.positions)):
        for axis in range(3):
            rows[WIDTH * i + axis] = paths.positions[i, axis]
            rows[WIDTH * i + 4 + axis] = paths.velocities[i, axis]
        rows[WIDTH * i + 3], rows[WIDTH * i + 7] = world.radius[i], 0.0


@in_place
def find_impacts_of_spheres(
    world: World,
    candidates: Candidates,
    count: int,
    chosen: Flags,
    h: float,
    lookback: float,
    impacts_out: Impacts,
) -> None:
    """Find the impacts of the first candidates, which are of two spheres; see `find_impacts`.

    Args:
        world: What does not move; without air.
        candidates: All of the frame.
        count: How many of them, a multiple of eight.
        chosen: Those that count, shape (m,).
        h: Length of the substep.
        lookback: Bodies that overlap are taken to have met at most so long ago.
        impacts_out: With the rows; written.
    """
    impacts, weight = impacts_out, weight_of(world)
    fall, pressed, rows = weight * h * h, weight > 0, impacts.rows
    for first in range(0, count, WIDTH):
        for k in range(first, first + WIDTH):
            impacts.found[k] = impacts.edge[k] = impacts.lasting[k] = False
        ax, ay, az, radius_a = columns_of(rows, 0, candidates.a, first)
        bx, by, bz, radius_b = columns_of(rows, 0, candidates.b, first)
        aux, auy, auz, _ = columns_of(rows, 4, candidates.a, first)
        bux, buy, buz, _ = columns_of(rows, 4, candidates.b, first)
        offset = minus((ax, ay, az), (bx, by, bz))
        velocity = minus((aux, auy, auz), (bux, buy, buz))
        touching = radius_a + radius_b
        reach = (1.0 + PAD) * touching + fall
        reach = reach + math.sqrt(dot(velocity, velocity)) * h
        near = dot(offset, offset) <= reach * reach
        if bits(near) == 0:
            continue
        hits, time = straight_meeting(offset, velocity, touching, h)
        impact = impact_of_spheres(
            offset=offset,
            velocity=velocity,
            acceleration=(0.0, 0.0, 0.0),
            bends=False,
            radius_a=radius_a,
            radius_b=radius_b,
            hits=hits,
            time=time,
            h=h,
            lookback=lookback,
            margin=weight * h**2,
            pressed=pressed,
        )
        store_impacts(impact, bits(impact.found & near), chosen, first, impacts)


@in_place
def store_impacts(
    impact: Impact, found: int, chosen: Flags, place: int, impacts_out: Impacts
) -> None:
    """Write eight impacts, of those that were found, as bits, those that are chosen."""
    if found == 0:
        return
    impacts, lasting = impacts_out, bits(impact.lasting)
    for lane in range(WIDTH):
        k = place + lane
        impacts.found[k] = (found >> lane & 1 > 0) & chosen[k]
        impacts.lasting[k] = lasting >> lane & 1 > 0
        impacts.values[CROSSING_TIME, k] = math.inf
    flat, size = impacts.flat, impacts.values.shape[1]
    store(flat, X * size + place, impact.normal[0])
    store(flat, Y * size + place, impact.normal[1])
    store(flat, Z * size + place, impact.normal[2])
    store(flat, NORMAL_TIME * size + place, impact.normal_time)
    store(flat, TIME * size + place, impact.time)
    store(flat, GAP * size + place, impact.gap)
    store(flat, SPECULATIVE_GAP * size + place, impact.speculative_gap)
    store(flat, APPROACH_SPEED * size + place, impact.approach_speed)
    store(flat, ACCELERATION * size + place, impact.acceleration)
    store(flat, TURNING_SPEED * size + place, impact.turning_speed)
    store(flat, REST_GAP * size + place, impact.rest_gap)


@in_place
def drop_doubles(candidates: Candidates, pairs: Indices, impacts_out: Impacts) -> None:
    """Keep one contact of a sphere over the seam of planes that are one, that of the least gap."""
    impacts = impacts_out
    for k in pairs[with_planes(candidates, pairs) :]:
        if not impacts.found[k] or candidates.plane[k] < 0:
            continue
        q = k - 1
        while q >= 0 and candidates.a[q] == candidates.a[k] and candidates.plane[q] >= 0:
            if impacts.found[q] and _is_parallel(impacts, q, k):
                farther = impacts.values[GAP, q] > impacts.values[GAP, k] + PARALLEL
                impacts.found[q if farther else k] = False
                if not farther:
                    break
            q -= 1


@in_place
def _is_parallel(impacts: Impacts, q: int, k: int) -> bool:
    v = impacts.values
    cosine = v[X, q] * v[X, k] + v[Y, q] * v[Y, k] + v[Z, q] * v[Z, k]
    return cosine > 1.0 - PARALLEL**2
