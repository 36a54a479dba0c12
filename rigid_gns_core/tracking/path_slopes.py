# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path of one ball with its slopes: how each state moves with the start.

Slopes go from stamp to stamp as the state does, S' = M S. In flight M follows from the gradients
A = da/dv and B = da/dw of the acceleration at the middle of the step, to second order in its time:

    p' = p + h v + h^2/2 (A v + B w),   v' = v + h (A (v + h/2 (A v + B w)) + B w)

Over a step with an impact or on a surface it is by differences of the step itself.
"""

from __future__ import annotations

import math

import numpy as np

from .ball_contact import FREE
from .ball_path import advance, LONGEST, Place, place_of, put_state
from .ball_surfaces import normal_of
from .jit import compiled, entry, in_place
from ..kernels.flight import Flight, flight_at, spin_after
from ..kernels.vector import cross, dot, length, minus, plus, times, Vector
from ..scenes.state import Array

# steps of the differences: p [m], v [m/s], w [rad/s]
_PLACE, _VELOCITY, _SPIN = 1e-6, 1e-5, 1e-3

Rows = tuple[Vector, Vector, Vector]


@in_place
def _along(axis: int, size: float) -> Vector:
    """Vector of a size along an axis."""
    return (size if axis == 0 else 0.0, size if axis == 1 else 0.0, size if axis == 2 else 0.0)


@in_place
def acceleration_gradients(velocity: Vector, spin: Vector, flight: Flight) -> tuple[Rows, Rows]:
    """Gradients of `acceleration` over velocity and over spin, as rows.

    With u = v - wind, t = w x u, T = r |t|: a = g' - d u + l t, with the drag
    d = q (C |u| + k T / |u|) and the lift l = q a r |u|^2 / (T + b |u|^2).
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
def _fly_slopes(v: Vector, after: Vector, w: Vector, h: float, flight: Flight, s: Array) -> None:
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
            rate = plus(_product(over_v, faster), _product(over_w, turned))
            more = plus(rate, times(half, _product(over_v, rate)))
            s[0, j] += piece * (faster[0] + half * rate[0])
            s[1, j] += piece * (faster[1] + half * rate[1])
            s[2, j] += piece * (faster[2] + half * rate[2])
            s[3, j], s[4, j], s[5, j] = plus(faster, times(piece, more))
            s[6, j], s[7, j], s[8, j] = times(kept, turned)


@in_place
def _product(rows: Rows, vector: Vector) -> Vector:
    """Matrix, as rows, times a vector."""
    return dot(rows[0], vector), dot(rows[1], vector), dot(rows[2], vector)


@in_place
def _moved(place: Place, k: int, step: float, planes: Array, radius: float) -> Place:
    """A place with part k of its state moved; on a surface with the velocity what rolls with it.

    A difference across rolling would see it slide for a moment, whichever way it is moved.
    """
    move = _along(k % 3, step)
    p, v, w = place.p, place.v, place.w
    if k < 3:
        p = plus(p, move)
    elif k < 6:
        v = plus(v, move)
        if place.on >= 0:
            w = plus(w, times(1.0 / radius, cross(normal_of(planes, place.on), move)))
    else:
        w = plus(w, move)
    return Place(place.now, p, v, w, place.on, place.longest)


@compiled
def _contact_slopes(
    before: Place,
    after: Place,
    stamp: float,
    flight: Flight,
    inertia: float,
    planes: Array,
    laws: Array,
    slope: Array,
    work: Array,
    contacts: Array,
    struck: bool,
) -> None:
    """Move the slopes of a state over a step with contacts, by differences of the step."""
    if before.on >= 0:  # of the spin, what is not of rolling: see `_moved`
        n = normal_of(planes, before.on)
        for j in range(9):
            rolls = cross(n, (slope[3, j], slope[4, j], slope[5, j]))
            for axis in range(3):
                slope[6 + axis, j] -= rolls[axis] / flight.radius
    work[:] = 0.0
    first = 0
    if before.on >= 0 and before.on == after.on and not struck:
        # motion along an endless surface is the same anywhere on it
        first = 3
        for k in range(3):
            for j in range(9):
                work[k, j] = slope[k, j]
    for k in range(first, 9):
        step = _PLACE if k < 3 else _VELOCITY if k < 6 else _SPIN
        moved = _moved(before, k, step, planes, flight.radius)
        other, _ = advance(moved, stamp, flight, inertia, planes, laws, 0, contacts)
        changes = (minus(other.p, after.p), minus(other.v, after.v), minus(other.w, after.w))
        for part in range(3):
            for axis in range(3):
                change = changes[part][axis] / step
                for j in range(9):
                    work[3 * part + axis, j] += change * slope[k, j]
    slope[:] = work


@entry
def path_and_slopes(
    start: Array,
    varied: Array,
    begin: float,
    stamps: Array,
    ball: Array,
    planes: Array,
    laws: Array,
    on: int,
    states_out: Array,
    slopes_out: Array,
    contacts_out: Array,
) -> tuple[int, int]:
    """As `path`, with the slopes of the states over the start, `slopes_out`, shape (m, 9, 9).

    The last axis is the part of the start, held where `varied`, shape (9,), is 0.
    """
    flight, inertia = flight_at(ball, 0), ball[0, 13]
    place, count = place_of(start, begin, on, planes, flight.radius), 0
    slope, work = np.zeros((9, 9)), np.zeros((9, 9))
    scratch = np.zeros((1, 3))
    for j in range(9):
        slope[j, j] = 1.0 if varied[j] > 0.0 else 0.0
    if on >= 0:
        n = normal_of(planes, on)
        for j in range(3):
            turn = times(1.0 / flight.radius, cross(n, _along(j, slope[3 + j, 3 + j])))
            slope[6, 3 + j], slope[7, 3 + j], slope[8, 3 + j] = turn
    for i in range(len(stamps)):
        before = place
        place, met = advance(before, stamps[i], flight, inertia, planes, laws, count, contacts_out)
        if met == count and before.on == FREE and place.on == FREE:
            h = place.now - before.now
            if h > 0.0:
                _fly_slopes(before.v, place.v, before.w, h, flight, slope)
        else:
            _contact_slopes(
                before,
                place,
                stamps[i],
                flight,
                inertia,
                planes,
                laws,
                slope,
                work,
                scratch,
                met > count,
            )
        count = met
        put_state(place, states_out, i)
        slopes_out[i] = slope
    return count, place.on
