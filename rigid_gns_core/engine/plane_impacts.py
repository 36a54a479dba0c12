# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impacts with planes at rest, over their faces, in a vacuum, eight at once."""

from __future__ import annotations

import math

from .broad_phase import Candidates
from .impact import Impact, LARGEST_TURN, LASTING_GAP, LASTING_SPEED, TOUCH
from .impacts import Impacts, store_impacts
from .world import gravity_of, weight_of, World
from ..kernels.jit import in_place
from ..kernels.lanes import bits, choose, columns_of, Lanes, larger, Mask, same, WIDTH
from ..kernels.neighbours import Flags
from ..kernels.vector import dot, minus, times

Vectors = tuple[Lanes, Lanes, Lanes]


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
        impact = _impact_with_face(
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
def _impact_with_face(
    normal: Vectors,
    radius: Lanes,
    height: Lanes,
    rate: Lanes,
    pull: Lanes,
    velocity: Vectors,
    h: float,
    lookback: float,
    margin: float,
    pressed: bool,
) -> Impact:
    """Contacts of eight spheres with planes over whose faces their centres stay within h.

    As `impact_with_plane`, to the bit, without edges.

    Args:
        normal: Of the face, towards the sphere.
        radius: Of the sphere.
        height: Of its centre, at the start of the substep.
        rate: Of the height, there.
        pull: Second derivative of the height.
        velocity: Of the centre, along the axes of the plane.
        h: Length of the substep.
        lookback: See there.
        margin: See there.
        pressed: See there.
    """
    gap, approach_speed = height - radius, -rate
    square = rate * rate - 2.0 * pull * gap
    root, nears = math.sqrt(larger(square, 0.0)), rate < 0.0
    time = choose(nears, 2.0 * gap, rate + root) / choose(nears, root - rate, -pull)
    hits = (gap > 0.0) & (square >= 0.0) & (nears | (pull < 0.0)) & (time <= h)
    tangential = dot(velocity, velocity) - approach_speed * approach_speed
    turn = 0.5 * h * math.sqrt(larger(tangential, 0.0))
    near = LASTING_GAP if pressed else -math.inf
    lasting = (gap <= near * radius) & (turn <= LARGEST_TURN * radius)
    lasting = lasting & (approach_speed <= LASTING_SPEED) & (-approach_speed <= LASTING_SPEED)
    touches = lasting | (gap <= TOUCH * radius)
    missed = (gap < 0.0) & (approach_speed > 0.0)
    since = larger(gap / choose(missed, approach_speed, 1.0), -lookback)
    time = choose(hits, time, choose(missed, since, 0.0))
    before = larger(time, 0.0)
    then = height + before * (rate + 0.5 * before * pull) - radius
    gap_then = choose(lasting, gap, then)
    return Impact(
        found=hits | touches | (gap <= margin),
        edge=False,
        lasting=lasting,
        normal=normal,
        normal_time=choose(lasting, 0.5 * (before + h), before),
        time=time,
        gap=gap_then,
        speculative_gap=choose(hits | touches, 0.0, gap),
        approach_speed=approach_speed - before * pull,
        acceleration=pull,
        turning_speed=same(0.0),
        crossing_time=math.inf,
        rest_gap=choose(hits, 0.0, choose(lasting, larger(gap_then, 0.0), 0.0)),
    )


@in_place
def _stays_within(local: Lanes, rate: Lanes, pull: Lanes, half: Lanes, h: float) -> Mask:
    """Whether a path stays within the ends along one axis for a time, by a bound of its way."""
    within: Mask = _size(local) + h * (_size(rate) + 0.5 * h * _size(pull)) < half
    return within


@in_place
def _size(value: Lanes) -> Lanes:
    return larger(value, -value)
