# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where spheres are a little later, unseen: flight or rolling, with at most one contact each."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .collisions import NONE_NEAR, Pairs, pairs_near, time_of_contact, velocity_change
from .environment import Environment
from .impacts import after_impact, first_impact, placed, Surfaces
from .jit import entry, in_place, plain
from .line_fit import Flags
from ..kernels.quaternions import turn
from ..kernels.vector import dot, minus, plus, put, row, times
from ..scenes.state import Array

# a contact may lie so many spans of the time back
_BEHIND = 0.5
_HELD = (0.0, 0.0, 0.0)  # acceleration of what something holds


def coast(
    environment: Environment,
    places: Array,
    speeds: Array,
    falls: NDArray[np.bool_],
    radii: Array,
    time: Array,
) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] after a while, each of shape (n, 3).

    Two spheres that meet exchange their momentum: carried on as if nothing had happened, each
    would be sought where the other is.

    Args:
        environment: Gravity, and what spheres bounce off.
        places: Centres [m], shape (n, 3).
        speeds: [m/s], shape (n, 3).
        falls: Whether a sphere flies, rather than being held, shape (n,).
        radii: [m], shape (n,).
        time: How long [s], shape (n,).
    """
    places, speeds, radii, time = plain(places), plain(speeds), plain(radii), plain(time)
    pairs = NONE_NEAR
    if environment.known:
        fall = np.where(falls, np.linalg.norm(environment.gravity), 0.0) * time
        pairs = pairs_near(places, radii + (np.linalg.norm(speeds, axis=1) + fall) * time)
    return _coast(environment.surfaces, pairs, places, speeds, falls, radii, time)


def turn_on(quaternions: Array, spins: Array, time: float) -> Array:
    """Rotations, shape (n, 4), after a while [s] at spins [rad/s], shape (n, 3)."""
    turned = np.array(quaternions, dtype=np.float64, order='C')
    _turn(turned, plain(spins), time)
    return turned


@entry
def _turn(quaternions: Array, spins: Array, time: float) -> None:
    for i in range(len(spins)):
        turn(quaternions, i, row(spins, i), time)


@entry
def _coast(
    surfaces: Surfaces,
    pairs: Pairs,
    places: Array,
    speeds: Array,
    falls: Flags,
    radii: Array,
    time: Array,
) -> tuple[Array, Array]:
    n = len(radii)
    # of the contact: when, by how much it changes a velocity, and the normal of a surface
    when, change, normals = np.full(n, np.inf), np.zeros((n, 3)), np.zeros((n, 3))
    for i in range(n):
        if not (falls[i] and time[i] > 0):
            continue
        place, speed = row(places, i), row(speeds, i)
        # noise may have put a sphere behind what it is about to meet
        hit = first_impact(surfaces, place, speed, radii[i], -_BEHIND * time[i], time[i])
        if hit.time < math.inf:
            when[i] = max(hit.time, 0.0)
            incoming = plus(speed, times(when[i], surfaces.gravity))
            put(change, i, minus(after_impact(incoming, _HELD, hit, radii[i])[0], incoming))
            put(normals, i, hit.normal)
    met, first = np.full(len(pairs[0]), np.inf), when.copy()
    _push(surfaces, pairs, places, speeds, radii, time, when, change, normals, met, first)
    found, later = np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        place, speed, push = row(places, i), row(speeds, i), row(change, i)
        g = surfaces.gravity if falls[i] else _HELD
        rest = time[i] - when[i] if when[i] < math.inf else 0.0
        there = plus(placed(place, speed, g, time[i]), times(rest, push))
        normal = row(normals, i)
        if when[i] < math.inf:  # a second bounce would follow: it is held on the surface
            height = dot(minus(there, placed(place, speed, g, when[i])), normal)
            there = minus(there, times(min(height, 0.0), normal))
        put(found, i, there)
        put(later, i, plus(plus(speed, times(time[i], g)), push))
    return found, later


@in_place
def _push(
    surfaces: Surfaces,
    pairs: Pairs,
    places: Array,
    speeds: Array,
    radii: Array,
    time: Array,
    when: Array,
    change: Array,
    normals: Array,
    met: Array,
    first: Array,
) -> None:
    """Put the meetings of spheres that come before their other contacts in the place of these."""
    one, other = pairs
    for k in range(len(one)):
        i, j = one[k], other[k]
        offset, speed = (
            minus(row(places, j), row(places, i)),
            minus(row(speeds, j), row(speeds, i)),
        )
        at, span = time_of_contact(offset, speed, radii[i] + radii[j]), min(time[i], time[j])
        if span > 0 and at >= -_BEHIND * span and at <= span:
            met[k] = max(at, 0.0)
            first[i], first[j] = min(first[i], met[k]), min(first[j], met[k])
    for side in range(2):  # of meetings at the same time the last counts, and a second sphere's
        for k in range(len(one)):
            i, j, at = one[k], other[k], met[k]
            if at == math.inf or at > first[i] or at > first[j]:
                continue
            speed = minus(row(speeds, j), row(speeds, i))
            offset = plus(minus(row(places, j), row(places, i)), times(at, speed))
            push = velocity_change(offset, speed, surfaces.bounce)
            who = j if side else i
            put(change, who, times(-1.0, push) if side else push)
            if at < when[who]:
                when[who] = at
                put(normals, who, _HELD)
