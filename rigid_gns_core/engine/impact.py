# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""When and along which normal two bodies meet in a substep, on their free paths.

A blow acts along the normal at its time of impact. A contact that lasts turns: its normal is that
at the middle of the rest of the substep, since an impulse along that does no work on a body that
rolls around another, to the second order. What is left of the turn until the end,
v_t^2 / d (h - t_n) of separation velocity, is in `turning_speed`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .flight import position_on_path, velocity_on_path
from .rectangle import (
    crossing_of_edge,
    curvature_of_path,
    first_touch_of_plane,
    first_touch_of_rectangle,
    from_plane,
    is_over_face,
    offset_from_rectangle,
    to_plane,
)
from .world import THRESHOLD_TIME, UNIT_GRAVITY, World
from ..kernels.jit import in_place
from ..kernels.vector import dot, length, minus, row, times, Vector

# gaps [radii of the smaller one] up to which bodies touch: rounding
TOUCH = 1e-10
# bodies nearer than this [radii], that approach slower than this speed, stay in contact
LASTING_GAP = 2e-4
LASTING_SPEED = UNIT_GRAVITY * THRESHOLD_TIME
# largest turn [rad] of a contact until the middle of a substep; one that turns farther flies off
LARGEST_TURN = 0.3


class Impact(NamedTuple):
    """A contact of two bodies.

    found: whether there is one; edge: whether it is with an edge of a plane; lasting: whether the
    bodies touch and hardly approach; normal: unit vector from body b to a, at the time
    `normal_time`; time: of impact, from the start of the substep, negative where the bodies
    overlap and should have met before; gap: between the surfaces at that time; speculative_gap:
    gap of a speculative contact, of bodies that do not meet on their free paths, but are so near
    that other contacts may bring them together (its time is 0), else 0; approach_speed: at the
    time of impact; acceleration: second derivative of the gap on the free paths; turning_speed:
    separation velocity that the turn of the normal after `normal_time` adds until the end;
    crossing_time: when a lasting contact crosses over between a face and an edge within h, else
    infinite; rest_gap: gap of a lasting contact that its free path does not close, else 0.
    """

    found: bool
    edge: bool
    lasting: bool
    normal: Vector
    normal_time: float
    time: float
    gap: float
    speculative_gap: float
    approach_speed: float
    acceleration: float
    turning_speed: float
    crossing_time: float
    rest_gap: float


@in_place
def no_impact() -> Impact:
    """None."""
    return Impact(
        found=False,
        edge=False,
        lasting=False,
        normal=(0.0, 0.0, 1.0),
        normal_time=0.0,
        time=0.0,
        gap=0.0,
        speculative_gap=0.0,
        approach_speed=0.0,
        acceleration=0.0,
        turning_speed=0.0,
        crossing_time=math.inf,
        rest_gap=0.0,
    )


@in_place
def missed_time(gap: float, approach_speed: float, lookback: float) -> float:
    """Time, 0 or before, at which bodies that overlap by -gap have met."""
    if gap >= 0 or approach_speed <= 0:
        return 0.0
    return max(-lookback, gap / approach_speed)


@in_place
def lasts_in_contact(
    gap: float,
    radius: float,
    pressed: bool,
    approach_speed: float,
    velocity: Vector,
    distance: float,
    h: float,
) -> bool:
    """Whether bodies are so near, and so slow along the normal, that they stay in contact."""
    if gap > LASTING_GAP * radius or not pressed:
        return False
    tangential = math.sqrt(max(dot(velocity, velocity) - approach_speed**2, 0.0))
    slow = math.fabs(approach_speed) <= LASTING_SPEED
    return slow and 0.5 * h * tangential <= LARGEST_TURN * distance


@in_place
def impact_with_plane(
    world: World,
    plane: int,
    radius: float,
    position: Vector,
    velocity: Vector,
    acceleration: Vector,
    h: float,
    lookback: float,
    margin: float,
    pressed: bool,
    lasts: bool,
) -> Impact:
    """Contact of a sphere that touches or meets a bounded plane within h, on its parabola.

    A plane without end bounds a body: spheres are in front of it, however deep. One with an end
    has two faces, and a sphere is on the side of its centre. The time of impact is the first root
    of the gap, in closed form where the sphere meets the face (`first_touch_of_plane`).

    Args:
        world: What does not move.
        plane: Its index.
        radius: Of the sphere.
        position: Of its centre, at the start of the substep.
        velocity: There.
        acceleration: Of its path.
        h: Length of the substep.
        lookback: Bodies that overlap are taken to have met at most so long ago.
        margin: Gap up to which bodies that do not meet are speculative contacts.
        pressed: Whether gravity may press bodies together, so that contacts last.
        lasts: The sphere rolls onto this plane from one that it touches: the contact lasts.
    """
    axes, half = world.axes[plane], world.half[plane]
    local = to_plane(axes, minus(position, row(world.point, plane)))
    moving = to_plane(axes, velocity)
    pulling = to_plane(axes, acceleration)
    side = -1.0 if world.two_sided[plane] and local[2] < 0 else 1.0
    start = offset_from_rectangle(local, half)
    inside = is_over_face(start)
    face_gap, distance = side * local[2] - radius, length(start)
    gap = face_gap if inside else distance - radius
    hits, time = False, 0.0
    if gap > 0:
        if face_gap > 0:
            time = first_touch_of_plane(face_gap, side * moving[2], side * pulling[2])
        if time <= h:
            there = offset_from_rectangle(position_on_path(local, moving, pulling, time), half)
            if not (face_gap > 0 and is_over_face(there)):
                time = first_touch_of_rectangle(local, moving, pulling, half, radius, time, h)
        hits = time <= h
    normal = (0.0, 0.0, side)
    if not inside:
        normal = times(1.0 / max(distance, 1e-30), start)
    approach_speed = -dot(normal, moving)
    lasting = lasts or lasts_in_contact(gap, radius, pressed, approach_speed, moving, radius, h)
    hits = hits and not lasts
    touches = lasting or gap <= TOUCH * radius
    if not (hits or touches or gap <= margin):
        return no_impact()
    if not hits:
        time = missed_time(gap, approach_speed, lookback)
    before = max(time, 0.0)
    normal_time = 0.5 * (before + h) if lasting else before
    at = offset_from_rectangle(position_on_path(local, moving, pulling, normal_time), half)
    moving_then = velocity_on_path(moving, pulling, normal_time)
    edge, far = not is_over_face(at), side * at[2]
    if lasting:
        approach_speed += -before * dot(normal, pulling)
    normal = (0.0, 0.0, side)
    if edge:
        far = max(length(at), 1e-30)
        normal = times(1.0 / far, at)
    if not lasting:
        gap_then, approach_speed = far - radius, -dot(normal, moving_then)
    else:
        gap_then = gap
    curving = curvature_of_path(at, moving_then)
    if lasts:
        gap_then, approach_speed = 0.0, curving * normal_time - dot(normal, moving)
    speculative_gap = 0.0 if hits or touches else gap
    crossing_time = math.inf
    if lasting:
        crossing_time = min(
            crossing_of_edge(half[0], local[0], moving[0], pulling[0]),
            crossing_of_edge(half[1], local[1], moving[1], pulling[1]),
        )
        if crossing_time >= h:
            crossing_time = math.inf
    return Impact(
        found=True,
        edge=edge,
        lasting=lasting,
        normal=from_plane(axes, normal),
        normal_time=normal_time,
        time=time,
        gap=gap_then,
        speculative_gap=speculative_gap,
        approach_speed=approach_speed,
        acceleration=dot(pulling, normal) + curving,
        turning_speed=curving * (h - normal_time),
        crossing_time=crossing_time,
        rest_gap=max(gap_then, 0.0) if lasting and not hits else 0.0,
    )
