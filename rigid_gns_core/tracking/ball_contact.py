# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a surface does to one ball: impact, sliding and rolling.

Surfaces are rows of two arrays: `planes`, see `ball_surfaces`, and `laws`, see `LAW`.
"""

from __future__ import annotations

import math

from .ball_surfaces import (
    AT_REST,
    belt,
    beside,
    columns,
    facing,
    height,
    KIND,
    MOVES,
    normal_of,
    PUSH,
    touch_of,
)
from .jit import in_place
from ..kernels.flight import acceleration, Flight
from ..kernels.vector import across, cross, dot, length, minus, plus, times, Vector
from ..scenes.state import Array

# columns of `laws`, see `ContactLaw` and its curve of restitution
LAW = (
    'restitution_slow',
    'restitution',
    'restitution_speed',
    'friction',
    'tangential_restitution',
    'rolling_friction',
    'rolling_friction_slope',
    'spinning_friction',
)
FREE = -1
# a ball that leaves a plane at rest more slowly than this stays on it [m/s]: it would rise by
# 0.02 mm; on anything else it hops at this speed, by 0.13 mm
RESTING, HOPPING = 0.02, 0.05
# slip below which a ball rolls [radii/s]
ROLLS = 1e-7


@in_place
def touched(
    planes: Array, p: Vector, before: Vector, q: Vector, v: Vector, now: float, h: float,
    radius: float, on: int,
) -> tuple[int, float]:  # fmt: skip
    """First surface but `on` that a step leads into, or FREE, and the share of it before that.

    The step takes h from p, with velocity `before`, to q, with v.
    """
    hit, first = FREE, math.inf
    for k in range(len(planes)):
        if planes[k, KIND] != AT_REST:
            a = times(1.0 / h, minus(v, before))
            share = touch_of(planes, k, p, before, a, now, h, radius) / h
            if share < first:
                hit, first = k, share
            continue
        if k == on or dot(v, normal_of(planes, k)) >= 0.0:
            continue
        end = height(planes, k, q, radius)
        if end >= 0.0 or beside(planes, k, q):
            continue
        begin = height(planes, k, p, radius)
        if begin < -radius:  # from behind
            continue
        share = begin / (begin - end) if begin > 0.0 else 0.0
        if share < first:
            hit, first = k, share
    return hit, first


@in_place
def struck(
    planes: Array, laws: Array, k: int, v: Vector, w: Vector, radius: float, inertia: float
) -> tuple[Vector, Vector]:
    """Velocity and spin after an impact on a plane at rest, with a belt or without."""
    moving = belt(planes, k)
    v, w = bounce(minus(v, moving), w, normal_of(planes, k), radius, inertia, laws, k)
    return plus(v, moving), w


@in_place
def meet(
    planes: Array, laws: Array, k: int, p: Vector, v: Vector, w: Vector, now: float,
    flight: Flight, inertia: float,
) -> tuple[Vector, Vector, float, float, float]:  # fmt: skip
    """Impact on what is no plane at rest.

    A ball that stays on it hops: it rises with `HOPPING` at least, and friction acts in each blow.

    Returns:
        Velocity and spin after it, approach speed, the speed at which the ball leaves the surface,
        and the pull to it.
    """
    _, n, surface = facing(planes, k, p, now, flight.radius)
    pull = -dot(acceleration(v, w, flight), n)
    if planes[k, KIND] == MOVES:
        pull += dot(columns(planes, k, PUSH), n)
    v = minus(v, surface)
    speed = -dot(v, n)
    if speed > 0.0:
        v, w = bounce(v, w, n, flight.radius, inertia, laws, k)
    rise = dot(v, n)
    if pull > 0.0 and rise < HOPPING:
        v = plus(v, times(HOPPING - rise, n))
        rise = HOPPING
    return plus(v, surface), w, speed, rise, pull


@in_place
def restitution(speed: float, laws: Array, k: int) -> float:
    """Restitution at an approach speed u: e_fast + (e_slow - e_fast) u_0 / (u_0 + u)."""
    return laws[k, 1] + (laws[k, 0] - laws[k, 1]) * laws[k, 2] / (laws[k, 2] + speed)


@in_place
def bounce(
    v: Vector, w: Vector, n: Vector, radius: float, inertia: float, laws: Array, k: int
) -> tuple[Vector, Vector]:
    """Velocity and spin after an impact: restitution e, friction mu, tangential restitution beta.

    With the approach speed u_n and the slip u of the contact point, kappa = I / (m r^2):

        dv_n = (1 + e) u_n,   |dv_t| = min(mu dv_n, (1 + beta) |u| kappa / (1 + kappa)) against u,
        dw = (-r n) x dv_t / (kappa r^2)

    (Walton's three parameters; beta = 0: the ball rolls off, -1: smooth).
    """
    push = -dot(v, n)
    push *= 1.0 + restitution(push, laws, k)
    arm = times(-radius, n)
    slip = across(plus(v, cross(w, arm)), n)
    size = length(slip)
    v = plus(v, times(push, n))
    if size > 0.0:
        grip = (1.0 + laws[k, 4]) * size * inertia / (1.0 + inertia)
        kick = times(-min(laws[k, 3] * push, grip) / size, slip)
        v = plus(v, kick)
        w = plus(w, times(1.0 / (inertia * radius * radius), cross(arm, kick)))
    return v, w


@in_place
def glide(
    v: Vector, w: Vector, n: Vector, h: float, flight: Flight, inertia: float, laws: Array, k: int
) -> tuple[float, Vector, Vector, float]:
    """A step on a surface: its time, velocity and spin after it, and the pull to the surface.

    Sliding, with slip u and pull N: dv/dt = a - mu N u/|u|, du/dt = a - mu N (1 + 1/kappa) u/|u|.
    Rolling: dv/dt = (a - (rho + rho' |v|) N v/|v|) / (1 + kappa). The step ends where one of them
    does. Spin about the normal slows by sigma N / (kappa r).
    """
    radius = flight.radius
    free = acceleration(v, w, flight)
    pull = -dot(free, n)
    if pull <= 0.0:
        return 0.0, v, w, pull
    along = plus(free, times(pull, n))
    slip = plus(v, cross(w, times(-radius, n)))
    size = length(slip)
    friction = laws[k, 3] * pull
    about = dot(w, n)
    if laws[k, 7] > 0.0:
        slowing = laws[k, 7] * pull / (inertia * radius)
        about -= math.copysign(min(abs(about), h * slowing), about)
    if size > ROLLS * radius and friction > 0.0:
        direction = times(1.0 / size, slip)
        rate = friction * (1.0 + 1.0 / inertia) - dot(along, direction)
        ends = rate > 0.0 and size < rate * h
        h = size / rate if ends else h
        after = plus(v, times(h, minus(along, times(friction, direction))))
        turn = (
            cross(n, after)
            if ends
            else plus(times(radius, w), times(h * friction / inertia, cross(n, direction)))
        )
        return h, after, plus(across(times(1.0 / radius, turn), n), times(about, n)), pull
    if friction > 0.0:
        share = 1.0 / (1.0 + inertia)
        after, h = _rolled(
            v, times(share, along), h, share * pull * laws[k, 5], share * pull * laws[k, 6]
        )
        return h, after, plus(times(1.0 / radius, cross(n, after)), times(about, n)), pull
    return h, plus(v, times(h, along)), plus(across(w, n), times(about, n)), pull


@in_place
def _rolled(v: Vector, slope: Vector, h: float, level: float, rise: float) -> tuple[Vector, float]:
    """Velocity after a step of rolling, and the step's time: shorter where the ball stops.

    The acceleration is `slope`, less `level + rise |v|` against the motion.
    """
    speed = length(v)
    resistance = level + rise * speed
    if speed < 1e-9:
        steep = length(slope)
        if steep <= resistance:
            return (0.0, 0.0, 0.0), h
        return times(h * (1.0 - resistance / steep), slope), h
    direction = times(1.0 / speed, v)
    slowing = resistance - dot(slope, direction)
    if slowing > 0.0 and speed <= slowing * h:
        return (0.0, 0.0, 0.0), max(speed / slowing, 1e-9)
    resistance -= 0.5 * h * slowing * rise  # at the middle of the step
    return plus(v, times(h, minus(slope, times(resistance, direction)))), h
