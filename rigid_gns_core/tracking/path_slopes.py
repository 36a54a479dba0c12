# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path of one ball with its slopes: how each state moves with the start.

Slopes go from stamp to stamp as the state does, S' = M S. In flight M is in closed form, and on a
surface, too, as long as the ball keeps sliding or rolling. Over a step with an impact, or from
sliding to rolling, it is by differences of the step itself.
"""

from __future__ import annotations

import numpy as np

from .ball_contact import FREE
from .ball_path import advance, Place, place_of, put_state
from .ball_surfaces import normal_of
from .flight_slopes import fly_slopes
from .glide_slopes import glide_slopes
from .jit import compiled, entry, in_place
from ..kernels.flight import Flight, flight_at
from ..kernels.vector import cross, minus, plus, times, Vector
from ..scenes.state import Array

# steps of the differences: p [m], v [m/s], w [rad/s]
_PLACE, _VELOCITY, _SPIN = 1e-6, 1e-5, 1e-3


@in_place
def _along(axis: int, size: float) -> Vector:
    """Vector of a size along an axis."""
    return (size if axis == 0 else 0.0, size if axis == 1 else 0.0, size if axis == 2 else 0.0)


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
    flight, inertia = flight_at(ball, 0), ball[0, 15]
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
                fly_slopes(before.v, place.v, before.w, h, flight, slope)
        elif not (
            met == count
            and before.on == place.on
            and glide_slopes(before, place, flight, inertia, planes, laws, slope)
        ):
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
