# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impacts with planes at rest, over their faces, in a vacuum, eight at once."""

from __future__ import annotations

from .broad_phase import Candidates
from .impact import impact_with_face
from .impacts import Impacts, store_impacts
from .world import gravity_of, weight_of, World
from ..kernels.jit import in_place
from ..kernels.lanes import bits, choose, columns_of, Lanes, larger, Mask, same, WIDTH
from ..kernels.neighbours import Flags
from ..kernels.vector import dot, minus, times


@in_place
def find_impacts_with_faces(
    world: World,
    candidates: Candidates,
    first: int,
    last: int,
    chosen: Flags,
    h: float,
    lookback: float,
    impacts_out: Impacts,
) -> None:
    """Find the impacts of candidates with planes whose path stays over the face; see `contacts`.

    The others are marked as `edge`, and are not found yet.

    Args:
        world: What does not move; without air, and without planes that move or stand for solids.
        candidates: All of the frame.
        first: First of those with planes.
        last: Where they end, a multiple of eight farther.
        chosen: Those that count, shape (m,).
        h: Length of the substep.
        lookback: Bodies that overlap are taken to have met at most so long ago.
        impacts_out: With the rows of the spheres; written.
    """
    impacts, rows, weight = impacts_out, impacts_out.rows, weight_of(world)
    gravity, planes = gravity_of(world), len(world.point)
    front, flat = world.faces[: WIDTH * planes], world.faces[WIDTH * planes :]
    for place in range(first, last, WIDTH):
        px, py, pz, radius = columns_of(rows, 0, candidates.a, place)
        vx, vy, vz, _ = columns_of(rows, 4, candidates.a, place)
        nx, ny, nz, half_x = columns_of(front, 0, candidates.plane, place)
        ox, oy, oz, half_y = columns_of(front, 4, candidates.plane, place)
        xx, xy, xz, two_sided = columns_of(flat, 0, candidates.plane, place)
        yx, yy, yz, _ = columns_of(flat, 4, candidates.plane, place)
        offset, velocity = minus((px, py, pz), (ox, oy, oz)), (vx, vy, vz)
        normal, x_axis, y_axis = (nx, ny, nz), (xx, xy, xz), (yx, yy, yz)
        height = dot(normal, offset)
        side = choose((two_sided > 0.0) & (height < 0.0), same(-1.0), same(1.0))
        moving = dot(x_axis, velocity), dot(y_axis, velocity), dot(normal, velocity)
        over = _stays_within(dot(x_axis, offset), moving[0], dot(x_axis, gravity), half_x, h)
        over = over & _stays_within(
            dot(y_axis, offset), moving[1], dot(y_axis, gravity), half_y, h
        )
        impact = impact_with_face(
            normal=times(side, normal),
            radius=radius,
            height=side * height,
            rate=side * moving[2],
            pull=side * dot(normal, gravity),
            velocity=moving,
            h=h,
            lookback=lookback,
            margin=weight * h**2,
            pressed=weight > 0,
        )
        left = bits(over)
        for lane in range(WIDTH):
            k = place + lane
            impacts.edge[k] = left >> lane & 1 == 0
            impacts.found[k] = impacts.lasting[k] = False
        store_impacts(impact, bits(impact.found & over), chosen, place, impacts)


@in_place
def _stays_within(local: Lanes, rate: Lanes, pull: Lanes, half: Lanes, h: float) -> Mask:
    """Whether a path stays within the ends along one axis for a time, by a bound of its way."""
    within: Mask = _size(local) + h * (_size(rate) + 0.5 * h * _size(pull)) < half
    return within


@in_place
def _size(value: Lanes) -> Lanes:
    return larger(value, -value)
