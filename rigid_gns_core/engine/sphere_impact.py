# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""When and along which normal two spheres meet in a substep; of one pair, or of eight as lanes."""

from __future__ import annotations

import math

from .flight import position_on_path, velocity_on_path
from .impact import Impact, LARGEST_TURN, LASTING_GAP, LASTING_SPEED, TOUCH
from .rectangle import centrifugal
from ..kernels.jit import in_place
from ..kernels.lanes import choose, larger, smaller
from ..kernels.vector import dot, length, plus, times, Vector


@in_place
def straight_meeting(
    offset: Vector, velocity: Vector, touching: float, h: float
) -> tuple[bool, float]:
    """Whether and when two spheres that fall alike meet within h.

    Relative paths are straight, and the time of impact is the first root of |x + y t| = R. With
    d = |x| - R and b = x . y it is t = d (|x| + R) / (sqrt(b^2 - y^2 d (|x| + R)) - b), which
    loses no digits.

    Args:
        offset: x, position of one relative to the other.
        velocity: y, likewise.
        touching: R, sum of the radii.
        h: Length of the substep.
    """
    distance = length(offset)
    gap, far = distance - touching, distance + touching
    along = dot(offset, velocity)
    inside = along * along - dot(velocity, velocity) * gap * far
    time = gap * far / larger(math.sqrt(larger(inside, 0.0)) - along, 1e-30)
    return (gap > 0.0) & (along < 0.0) & (inside >= 0.0) & (time <= h), time


@in_place
def impact_of_spheres(
    offset: Vector,
    velocity: Vector,
    acceleration: Vector,
    bends: bool,
    radius_a: float,
    radius_b: float,
    hits: bool,
    time: float,
    h: float,
    lookback: float,
    margin: float,
    pressed: bool,
) -> Impact:
    """Contact of two spheres that touch or meet within h; of eight such pairs, as lanes.

    Args:
        offset: Position of a relative to b.
        velocity: Of a relative to b.
        acceleration: Of a relative to b.
        bends: Whether there is any, so that paths are not straight.
        radius_a: Radius of a.
        radius_b: Radius of b.
        hits: Whether they meet within h.
        time: When.
        h: Length of the substep.
        lookback: Spheres that overlap are taken to have met at most so long ago.
        margin: Gap up to which spheres that do not meet are speculative contacts.
        pressed: Whether gravity may press bodies together, so that contacts last.
    """
    touching, distance = radius_a + radius_b, length(offset)
    gap, smallest = distance - touching, smaller(radius_a, radius_b)
    approach_speed = -dot(offset, velocity) / larger(distance, 1e-30)
    tangential = dot(velocity, velocity) - approach_speed * approach_speed
    turn = 0.5 * h * math.sqrt(larger(tangential, 0.0))
    near = LASTING_GAP if pressed else -math.inf
    lasting = (gap <= near * smallest) & (turn <= LARGEST_TURN * distance)
    lasting = lasting & (approach_speed <= LASTING_SPEED) & (-approach_speed <= LASTING_SPEED)
    touches = lasting | (gap <= TOUCH * smallest)
    missed = (gap < 0.0) & (approach_speed > 0.0)
    since = larger(gap / choose(missed, approach_speed, 1.0), -lookback)
    time = choose(hits, time, choose(missed, since, 0.0))
    before = larger(time, 0.0)
    normal_time = choose(lasting, 0.5 * (before + h), before)
    at, moving = plus(offset, times(normal_time, velocity)), velocity
    if bends:
        at = position_on_path(offset, velocity, acceleration, normal_time)
        moving = velocity_on_path(velocity, acceleration, normal_time)
    far = length(at)
    apart, scale = far > 1e-9, 1.0 / larger(far, 1e-30)
    normal = (
        choose(apart, scale * at[0], 0.0),
        choose(apart, scale * at[1], 0.0),
        choose(apart, scale * at[2], 1.0),
    )
    gap_then = choose(lasting, gap, far - touching)
    pull, curving = dot(acceleration, normal), centrifugal(at, moving)
    approach_speed = choose(lasting, approach_speed - before * pull, -dot(normal, moving))
    return Impact(
        found=hits | touches | (gap <= margin),
        edge=False,
        lasting=lasting,
        normal=normal,
        normal_time=normal_time,
        time=time,
        gap=gap_then,
        speculative_gap=choose(hits | touches, 0.0, gap),
        approach_speed=approach_speed,
        acceleration=pull + curving,
        turning_speed=curving * (h - normal_time),
        crossing_time=math.inf,
        rest_gap=choose(hits, 0.0, choose(lasting, larger(gap_then, 0.0), 0.0)),
    )
