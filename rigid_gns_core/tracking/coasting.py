# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coasting: predicted motion between frames, in flight or held, with at most one contact each."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .collisions import NO_PAIRS, Pairs, pairs_near, time_of_contact, velocity_change
from .environment import Environment
from .impacts import after_impact, first_impact, position_after, Surfaces
from .jit import entry, in_place, plain
from ..kernels.neighbours import Flags
from ..kernels.quaternions import turn
from ..kernels.vector import dot, minus, plus, put, row, times
from ..scenes.state import Array

# a contact may lie this far in the past, as a part of the time coasted: noise displaces spheres
_BEHIND = 0.5
_HELD = (0.0, 0.0, 0.0)  # acceleration of a sphere that is supported


def coast(
    environment: Environment,
    positions: Array,
    velocities: Array,
    falls: NDArray[np.bool_],
    radii: Array,
    time: Array,
) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] after `time`, each of shape (n, 3).

    Spheres that collide exchange momentum: without this, each would be looked for where the
    other one is.

    Args:
        environment: Gravity, and the surfaces that spheres bounce off.
        positions: Centres [m], shape (n, 3).
        velocities: Velocities [m/s], shape (n, 3).
        falls: Whether a sphere is in free flight rather than supported, shape (n,).
        radii: Radii [m], shape (n,).
        time: Time to coast [s], shape (n,).
    """
    positions, velocities, radii, time = (
        plain(positions),
        plain(velocities),
        plain(radii),
        plain(time),
    )
    pairs = NO_PAIRS
    if environment.known:
        fall = np.where(falls, np.linalg.norm(environment.gravity), 0.0) * time
        pairs = pairs_near(positions, radii + (np.linalg.norm(velocities, axis=1) + fall) * time)
    return _coast(environment.surfaces, pairs, positions, velocities, falls, radii, time)


def turn_on(quaternions: Array, spins: Array, time: float) -> Array:
    """Rotations, shape (n, 4), after `time` [s] at constant spins [rad/s], shape (n, 3)."""
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
    positions: Array,
    velocities: Array,
    falls: Flags,
    radii: Array,
    time: Array,
) -> tuple[Array, Array]:
    n = len(radii)
    # of each contact: time, change of velocity and, on a surface, its normal
    impact_times, changes, normals = np.full(n, np.inf), np.zeros((n, 3)), np.zeros((n, 3))
    for i in range(n):
        if not (falls[i] and time[i] > 0):
            continue
        position, velocity = row(positions, i), row(velocities, i)
        # noise may have put a sphere behind the surface that it is about to meet
        hit = first_impact(
            surfaces, position, velocity, radii[i], 0.0, -_BEHIND * time[i], time[i]
        )
        if hit.time < math.inf:
            impact_times[i] = max(hit.time, 0.0)
            incoming = plus(velocity, times(impact_times[i], surfaces.gravity))
            after, _ = after_impact(incoming, _HELD, hit, radii[i], surfaces.inertia)
            put(changes, i, minus(after, incoming))
            put(normals, i, hit.normal)
    meeting_times, earliest = np.full(len(pairs[0]), np.inf), impact_times.copy()
    _push(
        surfaces,
        pairs,
        positions,
        velocities,
        radii,
        time,
        impact_times,
        changes,
        normals,
        meeting_times,
        earliest,
    )
    new_positions, new_velocities = np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        position, velocity, push = row(positions, i), row(velocities, i), row(changes, i)
        g = surfaces.gravity if falls[i] else _HELD
        rest = time[i] - impact_times[i] if impact_times[i] < math.inf else 0.0
        there = plus(position_after(position, velocity, g, time[i]), times(rest, push))
        normal = row(normals, i)
        if impact_times[i] < math.inf:  # a second bounce would follow: it is held on the surface
            height = dot(
                minus(there, position_after(position, velocity, g, impact_times[i])), normal
            )
            there = minus(there, times(min(height, 0.0), normal))
        put(new_positions, i, there)
        put(new_velocities, i, plus(plus(velocity, times(time[i], g)), push))
    return new_positions, new_velocities


@in_place
def _push(
    surfaces: Surfaces,
    pairs: Pairs,
    positions: Array,
    velocities: Array,
    radii: Array,
    time: Array,
    impact_times: Array,
    changes: Array,
    normals: Array,
    meeting_times: Array,
    earliest: Array,
) -> None:
    """Replace contacts by collisions of spheres that come before them."""
    first, second = pairs
    for k in range(len(first)):
        i, j = first[k], second[k]
        offset, velocity = (
            minus(row(positions, j), row(positions, i)),
            minus(row(velocities, j), row(velocities, i)),
        )
        at, span = time_of_contact(offset, velocity, radii[i] + radii[j]), min(time[i], time[j])
        if span > 0 and at >= -_BEHIND * span and at <= span:
            meeting_times[k] = max(at, 0.0)
            earliest[i], earliest[j] = (
                min(earliest[i], meeting_times[k]),
                min(earliest[j], meeting_times[k]),
            )
    # of simultaneous collisions the last one counts, and that of the second sphere of a pair
    for side in range(2):
        for k in range(len(first)):
            i, j, at = first[k], second[k], meeting_times[k]
            if at == math.inf or at > earliest[i] or at > earliest[j]:
                continue
            velocity = minus(row(velocities, j), row(velocities, i))
            offset = plus(minus(row(positions, j), row(positions, i)), times(at, velocity))
            push = velocity_change(offset, velocity, surfaces.sphere_restitution)
            struck = j if side else i
            put(changes, struck, times(-1.0, push) if side else push)
            if at < impact_times[struck]:
                impact_times[struck] = at
                put(normals, struck, _HELD)
