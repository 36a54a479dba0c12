# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Slopes of a ball that slides, rolls or rests on a surface all along a step, in closed form.

With slip u = v + w x (-r n), the pull N and the direction e of slip or of motion:

    sliding:  v' = v + h (a - mu N e),                  de = (1 - e e^T) du / |u|
    rolling:  v' = v + h (a - (rho + rho' |v|) N e) / (1 + kappa),  de = (1 - e e^T) dv / |v|

The direction of sliding stays where the surface is level and there is no air, so that the first is
exact for any step. A ball that rolls and is given a slip du slides for no time, and loses
kappa / (1 + kappa) du of its velocity.
"""

from __future__ import annotations

from .ball_contact import ROLLS
from .ball_path import Place
from .ball_surfaces import belt, normal_of
from .flight_slopes import acceleration_gradients, product
from .jit import in_place
from ..kernels.flight import acceleration, Flight
from ..kernels.vector import across, cross, dot, length, minus, plus, times, Vector
from ..scenes.state import Array

# a ball that is slower than this rests [m/s]
_RESTS = 1e-9


@in_place
def glide_slopes(
    before: Place,
    after: Place,
    flight: Flight,
    inertia: float,
    planes: Array,
    laws: Array,
    slopes: Array,
) -> bool:
    """Move the slopes of a state, shape (9, 9), over a step on one surface without an impact.

    Returns:
        False, with the slopes as they were, where sliding or rolling ends on the way, or the
        surface's law has no friction, or one that slows the spin about its normal.
    """
    k, radius = before.on, flight.radius
    friction, n, h = laws[k, 3], normal_of(planes, k), after.now - before.now
    if h <= 0.0:
        return True
    # relative to the surface, which may be a belt
    arm, moving = times(-radius, n), belt(planes, k)
    v, end = across(minus(before.v, moving), n), minus(after.v, moving)
    slip, left = plus(v, cross(before.w, arm)), plus(end, cross(after.w, arm))
    size, speed = length(slip), length(v)
    slides, rests = size > ROLLS * radius, length(end) < _RESTS
    if slides != (length(left) > ROLLS * radius) or friction <= 0.0 or laws[k, 7] > 0.0:
        return False
    if not slides and rests != (speed < _RESTS):
        return False
    mean = times(0.5, plus(v, end))
    flying = plus(mean, moving), times(0.5, plus(before.w, after.w))
    free = acceleration(flying[0], flying[1], flight)
    pull = -dot(free, n)
    share, rolls = 1.0 / (1.0 + inertia), laws[k, 5] + laws[k, 6] * length(mean)
    direction = times(1.0 / size, slip) if slides else times(1.0 / max(speed, _RESTS), v)
    # mean resistance to rolling over the step
    level = plus(free, times(pull, n))
    resistance = dot(direction, minus(v, end)) / h + share * dot(direction, level)
    over_v, over_w = acceleration_gradients(flying[0], flying[1], flight)
    for j in range(9):
        dv = across((slopes[3, j], slopes[4, j], slopes[5, j]), n)
        dw = (slopes[6, j], slopes[7, j], slopes[8, j])
        du = plus(dv, cross(dw, arm))
        about = times(dot(dw, n), n)
        if not slides:
            dv = minus(dv, times(inertia * share, du))
            dw = plus(times(1.0 / radius, cross(n, dv)), about)
        da = plus(product(over_v, dv), product(over_w, dw))
        fall = -dot(da, n)
        da = plus(da, times(fall, n))
        if slides:
            turn = _turned(du, direction, size)
            push = times(friction, plus(times(fall, direction), times(pull, turn)))
            faster = plus(dv, times(h, minus(da, push)))
            dw = plus(dw, times(h / (inertia * radius), cross(n, push)))
        elif rests:
            dv, faster, dw = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), about
        else:
            turn = _turned(dv, direction, speed)
            more = share * (rolls * fall + laws[k, 6] * pull * dot(direction, dv))
            push = plus(times(more, direction), times(resistance, turn))
            faster = plus(dv, times(h, minus(times(share, da), push)))
            dw = plus(times(1.0 / radius, cross(n, faster)), about)
        moved = plus((slopes[0, j], slopes[1, j], slopes[2, j]), times(0.5 * h, plus(dv, faster)))
        slopes[0, j], slopes[1, j], slopes[2, j] = moved
        slopes[3, j], slopes[4, j], slopes[5, j] = faster
        slopes[6, j], slopes[7, j], slopes[8, j] = dw
    return True


@in_place
def _turned(change: Vector, direction: Vector, size: float) -> Vector:
    """Change of the direction of a vector of a size that changes."""
    return times(1.0 / size, minus(change, times(dot(direction, change), direction)))
