# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flight of one sphere in air, the law that engine, tracking and identification share.

With u = v - wind, q = rho A / 2 over the mass with added mass, and S |u|^2 = r |w x u|:

    dv/dt = g' - q (C_d0 |u| + k r |w x u| / |u|) u + q a r |u|^2 / (r |w x u| + b |u|^2) w x u

and, beyond the drag crisis, C_d0 less d f, with f = 1 - 1 / (1 + (|u| / u_c)^8), which is the law
of `Air`, in a form that has no 0 / 0 where the air or the spin is at rest.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .jit import in_place
from .lanes import bits, choose, Lanes, Mask, same
from .vector import cross, dot, length, minus, plus, times, Vector
from ..scenes.state import Array

# share of its velocity that air takes or turns in one piece of a flight: errors are below 1e-7 of
# the way; and most pieces, for what is as light as a soap bubble
_LARGEST_CHANGE, _MOST_PIECES = 0.1, 1000
# most pieces of a flight in lanes: a table tennis ball has one, a balloon two
_IN_LANES = 4


class Flight(NamedTuple):
    """Parameters of the flight of one sphere.

    pull: g', acceleration by weight and buoyancy; wind: velocity of the air; load: q; radius: r;
    drag: C_d0; drag_slope: k; lift: a; lift_half_ratio: b; spin_decay: c; drag_drop: d;
    per_crisis: 1 / u_c^2.
    """

    pull: Vector
    wind: Vector
    load: float
    radius: float
    drag: float
    drag_slope: float
    lift: float
    lift_half_ratio: float
    spin_decay: float
    drag_drop: float
    per_crisis: float


@in_place
def flight_at(rows: Array, i: int) -> Flight:
    """Parameters of sphere i, from those of all, shape (n, 15), as of `Air.flight`."""
    return Flight(
        pull=(rows[i, 0], rows[i, 1], rows[i, 2]),
        wind=(rows[i, 3], rows[i, 4], rows[i, 5]),
        load=rows[i, 6],
        radius=rows[i, 7],
        drag=rows[i, 8],
        drag_slope=rows[i, 9],
        lift=rows[i, 10],
        lift_half_ratio=rows[i, 11],
        spin_decay=rows[i, 12],
        drag_drop=rows[i, 13],
        per_crisis=rows[i, 14],
    )


@in_place
def past_crisis(square: float, flight: Flight) -> float:
    """f, the part of the drop of drag that a squared speed has; of one, or of eight as lanes."""
    ratio = square * flight.per_crisis
    ratio = ratio * ratio
    return 1.0 - 1.0 / (1.0 + ratio * ratio)


@in_place
def acceleration(velocity: Vector, spin: Vector, flight: Flight) -> Vector:
    """Acceleration of a sphere that flies with a velocity and an angular velocity.

    Of one, or of eight of the same parameters as lanes.
    """
    u = minus(velocity, flight.wind)
    square = dot(u, u)
    speed, turning = math.sqrt(square), cross(spin, u)
    twist = flight.radius * length(turning)
    drag = flight.load * (flight.drag * speed + flight.drag_slope * twist / speed)
    if flight.drag_drop != 0.0:
        drag = drag - flight.load * flight.drag_drop * past_crisis(square, flight) * speed
    lift = flight.load * flight.lift * flight.radius * square
    lift = lift / (twist + flight.lift_half_ratio * square)
    push, still = minus(times(lift, turning), times(drag, u)), square <= 0.0
    push = choose(still, 0.0, push[0]), choose(still, 0.0, push[1]), choose(still, 0.0, push[2])
    return plus(flight.pull, push)


@in_place
def spin_after(spin: Vector, flight: Flight, time: float) -> Vector:
    """Angular velocity after a time: w exp(-c t)."""
    if flight.spin_decay == 0:
        return spin
    return times(math.exp(-flight.spin_decay * time), spin)


@in_place
def mean_accelerations(
    velocity: Vector, spin: Vector, flight: Flight, time: float
) -> tuple[Vector, Vector]:
    """Accelerations a_p and a_v of a flight that ends at p + v t + a_p t^2 / 2 and at v + a_v t.

    In pieces so short that air changes the velocity by at most `_LARGEST_CHANGE` in each.
    """
    first = acceleration(velocity, spin, flight)
    pieces = _pieces(velocity, first, flight, time)
    if not pieces > 1.0:
        return _mean_accelerations(velocity, spin, first, flight, time)
    parts = math.ceil(min(pieces, float(_MOST_PIECES)))
    way, change, piece = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), time / parts
    for _ in range(parts):
        now = plus(velocity, change)
        first = acceleration(now, spin, flight)
        path, mean = _mean_accelerations(now, spin, first, flight, piece)
        way = plus(way, times(piece, plus(change, times(0.5 * piece, path))))
        change = plus(change, times(piece, mean))
        spin = spin_after(spin, flight, piece)
    return times(2.0 / time**2, way), times(1.0 / time, change)


@in_place
def mean_accelerations_in_lanes(
    velocity: Vector, spin: Vector, flight: Flight, time: float
) -> tuple[Mask, Vector, Vector]:
    """As `mean_accelerations`, of eight spheres as lanes; and whether few pieces are enough.

    Where they are not, the accelerations are not those.
    """
    first = acceleration(velocity, spin, flight)
    pieces = _pieces(velocity, first, flight, time)
    path, mean = _mean_accelerations(velocity, spin, first, flight, time)
    several = pieces > 1.0
    if bits(several):
        longer, slower = _mean_of_pieces(velocity, spin, flight, time, pieces)
        path, mean = _chosen(several, longer, path), _chosen(several, slower, mean)
    return pieces <= float(_IN_LANES), path, mean


@in_place
def _mean_of_pieces(
    velocity: Vector, spin: Vector, flight: Flight, time: float, pieces: Lanes
) -> tuple[Vector, Vector]:
    """Mean accelerations of eight flights, each in as many pieces as it is to have."""
    parts = same(1.0)
    for k in range(1, _IN_LANES):
        parts = parts + choose(pieces > float(k), 1.0, 0.0)
    none, piece = same(0.0), time / parts
    way = change = (none, none, none)
    for k in range(_IN_LANES):
        flies = parts > float(k)
        if not bits(flies):
            break
        now = plus(velocity, change)
        path, mean = _mean_accelerations(now, spin, acceleration(now, spin, flight), flight, piece)
        further = plus(way, times(piece, plus(change, times(0.5 * piece, path))))
        way, change = (
            _chosen(flies, further, way),
            _chosen(flies, plus(change, times(piece, mean)), change),
        )
        spin = spin_after(spin, flight, piece)
    return times(2.0 / time**2, way), times(1.0 / time, change)


@in_place
def _chosen(mask: Mask, yes: Vector, no: Vector) -> Vector:
    return choose(mask, yes[0], no[0]), choose(mask, yes[1], no[1]), choose(mask, yes[2], no[2])


@in_place
def _pieces(velocity: Vector, first: Vector, flight: Flight, time: float) -> float:
    """How many pieces a flight is to have, not rounded; not a number without relative wind."""
    push = minus(first, flight.pull)
    return time * length(push) / (_LARGEST_CHANGE * length(minus(velocity, flight.wind)))


@in_place
def _mean_accelerations(
    velocity: Vector, spin: Vector, first: Vector, flight: Flight, time: float
) -> tuple[Vector, Vector]:
    """Step of the classical Runge-Kutta method, of fourth order in t.

    With the accelerations k of its stages, the first given, a_p = (k1 + k2 + k3) / 3 and
    a_v = (k1 + 2 k2 + 2 k3 + k4) / 6.
    """
    half = spin_after(spin, flight, 0.5 * time)
    second = acceleration(plus(velocity, times(0.5 * time, first)), half, flight)
    third = acceleration(plus(velocity, times(0.5 * time, second)), half, flight)
    last = spin_after(spin, flight, time)
    fourth = acceleration(plus(velocity, times(time, third)), last, flight)
    middle = plus(second, third)
    path = times(1.0 / 3.0, plus(first, middle))
    return path, times(1.0 / 6.0, plus(plus(first, fourth), times(2.0, middle)))
