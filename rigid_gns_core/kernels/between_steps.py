# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is between the steps of rollouts: a cubic, or two flights where a blow is in between."""

from __future__ import annotations

from typing import NamedTuple

from .flight import acceleration, flight_at
from .jit import entry, in_place
from .neighbours import Indices
from .vector import dot, length, minus, plus, times, Vector
from ..scenes.state import Array

# a velocity changes in a step by more than flight makes it and this part of gravity: a blow. What
# rolls is held by gravity itself
_HELD, _OF_AIR, _ROUNDING = 1.5, 0.01, 1e-9
_NONE = (0.0, 0.0, 0.0)

# coefficients of 1, t, t^2, t^3, of the time since the start of a step
Cubic = tuple[Vector, Vector, Vector, Vector]


class Steps(NamedTuple):
    """Rollouts at their steps; see `rollout.paths.Paths`.

    positions, velocities, flights: shape (s, steps + 1, n, 3); blows: (s, steps, n, 3).
    """

    positions: Array
    velocities: Array
    flights: Array
    blows: Array
    dt: float
    exact: bool


@in_place
def _vector(values: Array, s: int, k: int, i: int) -> Vector:
    return values[s, k, i, 0], values[s, k, i, 1], values[s, k, i, 2]


@entry
def find_blows(
    velocities: Array, spins: Array, rows: Array, weight: float, dt: float,
    flights_out: Array, blows_out: Array,
) -> None:  # fmt: skip
    """Find the accelerations of free flight at the steps, and the blows between them.

    Args:
        velocities: At the steps, shape (s, steps + 1, n, 3), as of the next.
        spins: Angular velocities.
        rows: Parameters of flight, as `flight_at` takes them.
        weight: Acceleration by gravity.
        dt: Time step.
        flights_out: Accelerations, shape (s, steps + 1, n, 3).
        blows_out: Changes of velocity, 0 where flight explains them, shape (s, steps, n, 3).
    """
    count, points, spheres = velocities.shape[:3]
    for s in range(count):
        for i in range(spheres):
            flight = flight_at(rows, i)
            before, pull = _vector(velocities, s, 0, i), _NONE
            for k in range(points):
                v = _vector(velocities, s, k, i)
                now = acceleration(v, _vector(spins, s, k, i), flight)
                flights_out[s, k, i, 0], flights_out[s, k, i, 1], flights_out[s, k, i, 2] = now
                if k > 0:
                    blow = minus(minus(v, before), times(0.5 * dt, plus(now, pull)))
                    bound = _HELD * dt * weight + _OF_AIR * dt * length(pull)
                    if not length(blow) > bound + _ROUNDING * length(before):
                        blow = _NONE
                    for axis in range(3):
                        blows_out[s, k - 1, i, axis] = blow[axis]
                before, pull = v, now


@in_place
def is_struck(steps: Steps, s: int, k: int, i: int) -> bool:
    """Whether there is a blow in step k of sphere i."""
    blow = _vector(steps.blows, s, k, i)
    return blow[0] != 0.0 or blow[1] != 0.0 or blow[2] != 0.0


@in_place
def pieces(steps: Steps, s: int, k: int, i: int) -> tuple[Cubic, Cubic, float]:
    """Cubics in a step: one until a time since its start, one after it; and that time.

    With a blow they are the flights before and after it, which part where they are nearest to
    each other; without one both are the cubic through both ends, or the line, and part at the end.
    """
    h = steps.dt
    p, q = _vector(steps.positions, s, k, i), _vector(steps.positions, s, k + 1, i)
    way = minus(q, p)
    if not steps.exact:
        line = p, times(1.0 / h, way), _NONE, _NONE
        return line, line, h
    v, w = _vector(steps.velocities, s, k, i), _vector(steps.velocities, s, k + 1, i)
    if not is_struck(steps, s, k, i):
        square = minus(times(3.0 / h**2, way), times(1.0 / h, plus(times(2.0, v), w)))
        cube = plus(times(-2.0 / h**3, way), times(1.0 / h**2, plus(v, w)))
        smooth = p, v, square, cube
        return smooth, smooth, h
    a, b = _vector(steps.flights, s, k, i), _vector(steps.flights, s, k + 1, i)
    before = p, v, times(0.5, a), _NONE
    back = plus(minus(q, times(h, w)), times(0.5 * h**2, b))
    after = back, minus(w, times(h, b)), times(0.5, b), _NONE
    apart = minus(before[0], back), minus(v, after[1]), times(0.5, minus(a, b)), _NONE
    split = 0.0
    for _ in range(3):  # Gauss-Newton steps of the square of their distance
        closing = slope(apart, split)
        step = dot(value(apart, split), closing) / max(dot(closing, closing), 1e-300)
        split = min(max(split - step, 0.0), h)
    return before, after, split


@in_place
def value(cubic: Cubic, t: float) -> Vector:
    """Position at a time since the start of the step."""
    high = plus(cubic[2], times(t, cubic[3]))
    return plus(cubic[0], times(t, plus(cubic[1], times(t, high))))


@in_place
def slope(cubic: Cubic, t: float) -> Vector:
    """Velocity at a time since the start of the step."""
    return plus(cubic[1], times(t, plus(times(2.0, cubic[2]), times(3.0 * t, cubic[3]))))


@entry
def find_states(steps: Steps, moments: Array, places_out: Array, speeds_out: Array) -> None:
    """Find positions and velocities at moments since the start, shapes (s, k, n, 3).

    One beyond the last step goes on as that step does.
    """
    last = steps.blows.shape[1] - 1
    for s in range(len(steps.positions)):
        for row in range(len(moments)):
            k = min(int(moments[row] / steps.dt + 1e-9), last)
            t = moments[row] - k * steps.dt
            for i in range(steps.positions.shape[2]):
                before, after, split = pieces(steps, s, k, i)
                cubic = after if t > split else before
                place, speed = value(cubic, t), slope(cubic, t)
                for axis in range(3):
                    places_out[s, row, i, axis] = place[axis]
                    speeds_out[s, row, i, axis] = speed[axis]


@entry
def find_meetings(steps: Steps, sphere: int, which_out: Indices, found_out: Array) -> int:
    """Find where and when blows struck a sphere.

    Args:
        steps: The rollouts.
        sphere: Which sphere.
        which_out: Rollout and step of each blow, in rising order, shape (s x steps, 2).
        found_out: Centre then, and time since the start, shape (s x steps, 4).

    Returns:
        Number of blows.
    """
    count = 0
    for s in range(len(steps.positions)):
        for k in range(steps.blows.shape[1]):
            if not is_struck(steps, s, k, sphere):
                continue
            before, _, split = pieces(steps, s, k, sphere)
            which_out[count, 0], which_out[count, 1] = s, k
            place = value(before, split)
            for axis in range(3):
                found_out[count, axis] = place[axis]
            found_out[count, 3] = k * steps.dt + split
            count += 1
    return count
