# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""When and along which normal a sphere meets a solid of revolution in a substep."""

from __future__ import annotations

import math

from .flight import position_on_path, velocity_on_path
from .impact import Impact, lasts_in_contact, missed_time, no_impact, TOUCH
from .rectangle import from_plane, to_plane
from .solids import (
    curvature_of_distance,
    first_touch_of_solid,
    is_beside,
    may_lie_in,
    nearest_of,
    radial_of,
)
from .world import ROUNDING, World
from ..kernels.jit import in_place
from ..kernels.vector import dot, minus, row, Vector


@in_place
def impact_with_solid(
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
) -> Impact:
    """Contact of a sphere that touches or meets a solid within h; see `impact_with_plane`.

    Args:
        world: What does not move.
        plane: That which stands for the solid.
        radius: Of the sphere.
        position: Of its centre, at the start of the substep.
        velocity: There.
        acceleration: Of its path.
        h: Length of the substep.
        lookback: Bodies that overlap are taken to have met at most so long ago.
        margin: Gap up to which bodies that do not meet are speculative contacts.
        pressed: Whether gravity may press bodies together, so that contacts last.
    """
    axes, solid = world.axes[plane], world.solids[plane]
    local = to_plane(axes, minus(position, row(world.point, plane)))
    fixed = may_lie_in(solid, local, radius)  # else contacts of one sphere would become one
    if is_beside(solid) and not fixed:
        return no_impact()
    moving, pulling = to_plane(axes, velocity), to_plane(axes, acceleration)
    radial = radial_of(solid, local)
    start = nearest_of(solid, local, radial, fixed)
    gap, approach_speed = start.distance - radius, -dot(start.normal, moving)
    time = math.inf
    if gap > 0:
        time = first_touch_of_solid(solid, local, moving, pulling, radial, fixed, radius, h)
    hits = time <= h
    far = radius + solid[ROUNDING]
    lasting = lasts_in_contact(gap, radius, pressed, approach_speed, moving, far, h)
    touches = lasting or gap <= TOUCH * radius
    if not (hits or touches or gap <= margin):
        return no_impact()
    if not hits:
        time = missed_time(gap, approach_speed, lookback)
    before = max(time, 0.0)
    normal_time = 0.5 * (before + h) if lasting else before
    there = position_on_path(local, moving, pulling, normal_time)
    moving_then = velocity_on_path(moving, pulling, normal_time)
    at = nearest_of(solid, there, radial if fixed else radial_of(solid, there), fixed)
    curving = curvature_of_distance(solid, there[2], at, not fixed, moving_then)
    if lasting:
        gap_then = gap
        approach_speed += -before * dot(start.normal, pulling)
    else:
        gap_then, approach_speed = at.distance - radius, -dot(at.normal, moving_then)
    return Impact(
        found=True,
        edge=False,
        lasting=lasting,
        normal=from_plane(axes, at.normal),
        normal_time=normal_time,
        time=time,
        gap=gap_then,
        speculative_gap=0.0 if hits or touches else gap,
        approach_speed=approach_speed,
        acceleration=dot(pulling, at.normal) + curving,
        turning_speed=curving * (h - normal_time),
        crossing_time=math.inf,
        rest_gap=max(gap_then, 0.0) if lasting and not hits else 0.0,
    )
