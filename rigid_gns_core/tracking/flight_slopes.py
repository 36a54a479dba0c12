# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Slopes of a flight, in closed form.

They follow from the gradients A = da/dv and B = da/dw of the acceleration at the middle of a step,
to second order in its time:

    p' = p + h v + h^2/2 (A v + B w),   v' = v + h (A (v + h/2 (A v + B w)) + B w)
"""

from __future__ import annotations

import math

from .ball_path import LONGEST
from .jit import in_place
from ..kernels.flight import Flight, past_crisis, spin_after
from ..kernels.vector import cross, dot, length, minus, plus, times, Vector
from ..scenes.state import Array

Rows = tuple[Vector, Vector, Vector]


@in_place
def acceleration_gradients(velocity: Vector, spin: Vector, flight: Flight) -> tuple[Rows, Rows]:
    """Gradients of `acceleration` over velocity and over spin, as rows.

    With u = v - wind, t = w x u, T = r |t|: a = g' - d u + l t, with the drag
    d = q ((C - D f) |u| + k T / |u|) and the lift l = q a r |u|^2 / (T + b |u|^2).
    """
    u = minus(velocity, flight.wind)
    square = dot(u, u)
    if square == 0.0:
        none = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        return none, none
    turning, per_speed = cross(spin, u), 1.0 / math.sqrt(square)
    size = length(turning)
    twist = flight.radius * size
    per_size = flight.radius / size if size > 0.0 else 0.0
    twist_v, twist_w = times(per_size, cross(turning, spin)), times(per_size, cross(u, turning))
    slope = flight.load * flight.drag_slope * per_speed
    level = flight.load * flight.drag * per_speed
    drag = level * square + slope * twist
    drag_v = plus(times(level - slope * twist * per_speed * per_speed, u), times(slope, twist_v))
    if flight.drag_drop != 0.0:  # d f / d |u| is 8 f (1 - f) / |u|
        past = past_crisis(square, flight)
        lost = flight.load * flight.drag_drop * past * per_speed
        drag -= lost * square
        drag_v = minus(drag_v, times(lost * (9.0 - 8.0 * past), u))
    drag_w = times(slope, twist_w)
    below = 1.0 / (twist + flight.lift_half_ratio * square)
    lift = flight.load * flight.lift * flight.radius * square * below
    share = lift * below
    lift_v = minus(times(2.0 * share * twist * per_speed * per_speed, u), times(share, twist_v))
    lift_w = times(-share, twist_w)
    f = times(lift, spin)
    over_v = (
        plus(_row(0, turning, lift_v, u, drag_v), (-drag, -f[2], f[1])),
        plus(_row(1, turning, lift_v, u, drag_v), (f[2], -drag, -f[0])),
        plus(_row(2, turning, lift_v, u, drag_v), (-f[1], f[0], -drag)),
    )
    f = times(lift, u)
    over_w = (
        plus(_row(0, turning, lift_w, u, drag_w), (0.0, f[2], -f[1])),
        plus(_row(1, turning, lift_w, u, drag_w), (-f[2], 0.0, f[0])),
        plus(_row(2, turning, lift_w, u, drag_w), (f[1], -f[0], 0.0)),
    )
    return over_v, over_w


@in_place
def _row(k: int, a: Vector, b: Vector, c: Vector, d: Vector) -> Vector:
    """Row k of a b^T - c d^T."""
    return minus(times(a[k], b), times(c[k], d))


@in_place
def fly_slopes(v: Vector, after: Vector, w: Vector, h: float, flight: Flight, s: Array) -> None:
    """Move the slopes s of a state, shape (9, 9), over a flight of time h from v to `after`."""
    parts = int(h / LONGEST) + 1
    piece, change = h / parts, minus(after, v)
    half, kept = 0.5 * piece, math.exp(-flight.spin_decay * piece)
    for part in range(parts):
        if flight.load == 0.0:
            for c in range(3):
                for j in range(9):
                    s[c, j] += piece * s[3 + c, j]
                    s[6 + c, j] *= kept
            continue
        middle = (part + 0.5) / parts
        spin = spin_after(w, flight, middle * h)
        over_v, over_w = acceleration_gradients(plus(v, times(middle, change)), spin, flight)
        for j in range(9):
            faster, turned = (s[3, j], s[4, j], s[5, j]), (s[6, j], s[7, j], s[8, j])
            rate = plus(product(over_v, faster), product(over_w, turned))
            more = plus(rate, times(half, product(over_v, rate)))
            s[0, j] += piece * (faster[0] + half * rate[0])
            s[1, j] += piece * (faster[1] + half * rate[1])
            s[2, j] += piece * (faster[2] + half * rate[2])
            s[3, j], s[4, j], s[5, j] = plus(faster, times(piece, more))
            s[6, j], s[7, j], s[8, j] = times(kept, turned)


@in_place
def product(rows: Rows, vector: Vector) -> Vector:
    """Matrix, as rows, times a vector."""
    return dot(rows[0], vector), dot(rows[1], vector), dot(rows[2], vector)
