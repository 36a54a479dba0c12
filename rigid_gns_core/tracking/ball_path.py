# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path of one ball through a scene at given times: flight, impacts, sliding and rolling.

It depends on a start and on three arrays: `ball`, shape (1, 16), a row of `Air.flight` and the
inertia factor, `planes` of `ball_surfaces` and `laws` of `ball_contact`.
"""

from __future__ import annotations

from typing import NamedTuple

from .ball_contact import FREE, glide, meet, RESTING, struck, touched
from .ball_surfaces import AT_REST, belt, beside, height, KIND, narrowed, normal_of
from .jit import entry, in_place
from ..kernels.flight import acceleration, Flight, flight_at, mean_accelerations, spin_after
from ..kernels.vector import across, cross, dot, minus, plus, times, Vector
from ..scenes.state import Array

# longest step [s]; with steps of a tenth, flights with bounces differ by less than 1e-8 m
LONGEST = 0.008
# steps between two stamps besides those that its time takes: more are not taken, as of a ball that
# two surfaces clamp
_MOST_STEPS = 64
# a ball on a surface that ends below it by more than this flies [m]
_LEFT = 1e-3


@in_place
def fly(p: Vector, v: Vector, w: Vector, h: float, flight: Flight) -> tuple[Vector, Vector]:
    """Position and velocity after a step of flight, of fourth order."""
    to_place, to_velocity = mean_accelerations(v, w, flight, h)
    return plus(p, times(h, plus(v, times(0.5 * h, to_place)))), plus(v, times(h, to_velocity))


@in_place
def time_of_impact(
    p: Vector, v: Vector, w: Vector, h: float, flight: Flight, planes: Array, k: int
) -> float:
    """Time in [0, h] at which a flight that is beyond a plane at h touches it.

    By Newton's method from a chord; where that leaves the bracket, by bisection.
    """
    n = normal_of(planes, k)
    low, high = 0.0, h
    at_low = height(planes, k, p, flight.radius)
    if at_low <= 0.0:
        return 0.0
    q, _ = fly(p, v, w, h, flight)
    time = h * at_low / (at_low - height(planes, k, q, flight.radius))
    for _ in range(50):
        q, after = fly(p, v, w, time, flight)
        off, speed = height(planes, k, q, flight.radius), dot(after, n)
        low, high, time, found = narrowed(low, high, time, off, speed)
        if found:
            break
    return time


@in_place
def time_on_surface(
    p: Vector, v: Vector, a: Vector, h: float, radius: float, planes: Array, k: int
) -> float:
    """Time in [0, h] at which p + v t + a t^2 / 2 touches a plane, by Newton's method."""
    n = normal_of(planes, k)
    begin = max(height(planes, k, p, radius), 0.0)
    time = 0.0
    for _ in range(6):
        speed = dot(plus(v, times(time, a)), n)
        if speed >= 0.0:
            break
        time -= (begin + time * dot(plus(v, times(0.5 * time, a)), n)) / speed
    return min(max(time, 0.0), h)


@in_place
def note(contacts_out: Array, count: int, time: float, k: int, speed: float) -> int:
    """Keep an impact where there is room; the number of impacts."""
    if count < len(contacts_out):
        contacts_out[count, 0], contacts_out[count, 1], contacts_out[count, 2] = time, k, speed
    return count + 1


class Place(NamedTuple):
    """Where a ball is on its path.

    now: time; p, v, w: position, velocity, angular velocity; on: plane that it is on, or FREE;
    longest: bound of its next step.
    """

    now: float
    p: Vector
    v: Vector
    w: Vector
    on: int
    longest: float


@in_place
def place_of(start: Array, begin: float, on: int, planes: Array, radius: float) -> Place:
    """Place of a start, see `path`."""
    v, w = (start[3], start[4], start[5]), (start[6], start[7], start[8])
    if on >= 0:
        along = minus(v, belt(planes, on))
        w = plus(w, times(1.0 / radius, cross(normal_of(planes, on), along)))
    return Place(begin, (start[0], start[1], start[2]), v, w, on, LONGEST)


@in_place
def advance(
    place: Place,
    stamp: float,
    flight: Flight,
    inertia: float,
    planes: Array,
    laws: Array,
    count: int,
    contacts_out: Array,
) -> tuple[Place, int]:
    """Follow a ball to a stamp; the number of impacts, `count` with those on the way."""
    now, p, v, w, on, longest = place
    radius, steps = flight.radius, _MOST_STEPS + int(2.0 * (stamp - now) / LONGEST)
    while now < stamp and steps > 0:
        steps -= 1
        h = min(stamp - now, longest)
        longest = LONGEST
        if on >= 0:
            n, moving = normal_of(planes, on), belt(planes, on)
            v = across(v, n)
            along = minus(v, moving)
            h, after, turned, pull = glide(along, w, n, h, flight, inertia, laws, on)
            after = plus(after, moving)
            q = plus(p, times(0.5 * h, plus(v, after)))
            if pull <= 0.0 or height(planes, on, q, radius) > _LEFT or beside(planes, on, q):
                on = FREE
                continue
            hit, share = touched(planes, p, v, q, after, now, h, radius, on)
            if hit < 0:
                p, v, w, now = q, after, turned, now + h
                continue
            a, time = times(1.0 / h, plus(after, times(-1.0, v))), share * h
            if planes[hit, KIND] == AT_REST:
                time = time_on_surface(p, v, a, h, radius, planes, hit)
            p = plus(p, times(time, plus(v, times(0.5 * time, a))))
            v = plus(v, times(time, a))
            w = plus(w, times(time / h, plus(turned, times(-1.0, w))))
            now += time
            if planes[hit, KIND] == AT_REST:
                speed = -dot(v, normal_of(planes, hit))
                v, w = struck(planes, laws, hit, v, w, radius, inertia)
            else:
                v, w, speed, _, _ = meet(planes, laws, hit, p, v, w, now, flight, inertia)
            count = note(contacts_out, count, now, hit, speed)
            rise = dot(v, n)
            if rise > RESTING:
                on, longest = FREE, min(rise / pull, LONGEST)
            continue
        q, after = fly(p, v, w, h, flight)
        hit, share = touched(planes, p, v, q, after, now, h, radius, FREE)
        if hit < 0:
            p, v, w, now = q, after, spin_after(w, flight, h), now + h
            continue
        time = share * h
        if planes[hit, KIND] == AT_REST:
            time = time_of_impact(p, v, w, h, flight, planes, hit)
        p, v = fly(p, v, w, time, flight)
        w = spin_after(w, flight, time)
        now += time
        if planes[hit, KIND] != AT_REST:
            v, w, speed, rise, pull = meet(planes, laws, hit, p, v, w, now, flight, inertia)
            count = note(contacts_out, count, now, hit, speed)
            if pull > 0.0:  # to the top of a low bounce, as below
                longest = min(rise / pull, LONGEST)
            continue
        n = normal_of(planes, hit)
        count = note(contacts_out, count, now, hit, -dot(v, n))
        if dot(v, n) < 0.0:
            v, w = struck(planes, laws, hit, v, w, radius, inertia)
        rise, pull = dot(v, n), -dot(acceleration(v, w, flight), n)
        if pull > 0.0 and rise < RESTING:
            on = hit
        elif pull > 0.0:  # to the top of a low bounce: its end is not stepped over
            longest = min(rise / pull, LONGEST)
    return Place(now, p, v, w, on, longest), count


@in_place
def put_state(place: Place, states_out: Array, i: int) -> None:
    """Write a place as row i of states, shape (m, 9)."""
    states_out[i, 0], states_out[i, 1], states_out[i, 2] = place.p
    states_out[i, 3], states_out[i, 4], states_out[i, 5] = place.v
    states_out[i, 6], states_out[i, 7], states_out[i, 8] = place.w


@entry
def start_of(
    state: Array, planes: Array, on: int, radius: float, start_out: Array, slope_out: Array
) -> None:
    """Start of a path from a state: on a surface, of the spin what comes to that of rolling.

    Args:
        state: Position, velocity, angular velocity, shape (9,).
        planes: See the module.
        on: Plane that the ball is on, or FREE.
        radius: Of the ball [m].
        start_out: The start, see `path`, shape (9,).
        slope_out: How it moves with the state, shape (9, 9).
    """
    start_out[:] = state
    slope_out[:] = 0.0
    for k in range(9):
        slope_out[k, k] = 1.0
    if on == FREE:
        return
    n = normal_of(planes, on)
    rolls = cross(n, minus((state[3], state[4], state[5]), belt(planes, on)))
    for k in range(3):
        start_out[6 + k] -= rolls[k] / radius
        a, b = (k + 1) % 3, (k + 2) % 3
        # (n x v)_k = n_a v_b - n_b v_a
        slope_out[6 + k, 3 + b] -= n[a] / radius
        slope_out[6 + k, 3 + a] += n[b] / radius


@entry
def path(
    start: Array,
    begin: float,
    stamps: Array,
    ball: Array,
    planes: Array,
    laws: Array,
    on: int,
    states_out: Array,
    contacts_out: Array,
) -> tuple[int, int]:
    """Follow a ball.

    Args:
        start: Position, velocity, angular velocity, shape (9,). On a surface the last is what
            comes to that of rolling, n x v / r with v relative to the belt.
        begin: Time of the start [s].
        stamps: Times [s], none before `begin`, rising, shape (m,).
        ball: See the module, as of the next two.
        planes: See there.
        laws: See there.
        on: Plane that the ball is on at the start, or FREE.
        states_out: States at the stamps, shape (m, 9).
        contacts_out: Time, plane and approach speed of the first impacts, shape (most, 3).

    Returns:
        Number of impacts, and the plane that the ball is on at the end, or FREE.
    """
    flight, inertia = flight_at(ball, 0), ball[0, 15]
    place, count = place_of(start, begin, on, planes, flight.radius), 0
    for i in range(len(stamps)):
        place, count = advance(
            place, stamps[i], flight, inertia, planes, laws, count, contacts_out
        )
        put_state(place, states_out, i)
    return count, place.on
