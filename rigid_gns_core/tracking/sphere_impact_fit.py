# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Collisions of two spheres in the last intervals of a window, fitted like impacts on surfaces.

After earlier collisions there are frames enough to fit the motion by itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .collisions import Pairs, time_of_contact, velocity_change, within
from .impacts import position_after, Surfaces
from .jit import in_place
from .motion_models import Contact, FLIGHT, Hypotheses, Hypothesis, try_contact, UNIFORM
from .observations import INTERVALS, Observations
from .surface_impact_fit import (
    joined,
    MOST_SLACK,
    motion_after,
    motion_before,
    MotionBefore,
    SLACK,
    variance_at,
)
from ..kernels.neighbours import Indices
from ..kernels.vector import length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

# prior of the velocity after a collision: standard deviations as parts of its change
_ALONG, _ACROSS = 0.1, 0.15
_HELD = (0.0, 0.0, 0.0)  # acceleration of a sphere that is supported


class Encounters(NamedTuple):
    """Predicted spheres in the middle of an interval, and the first collision of each in it.

    Args:
        candidates: Spheres that may collide, shape (n,); the rest is of these alone.
        positions: Positions [m], shape (n, 3).
        velocities: Velocities [m/s], shape (n, 3).
        spreads: Standard deviation of a position [m], infinite where it is unknown, shape (n,).
        times: From the middle to the first collision [s], infinite without one, shape (n,).
        partner: Index of the other sphere, shape (n,).
    """

    candidates: NDArray[np.bool_]
    positions: Array
    velocities: Array
    spreads: Array
    times: Array
    partner: Indices

    @classmethod
    def none(cls, count: int) -> Encounters:
        """No encounters of `count` spheres, to be filled."""
        none = np.zeros(count)
        positions, velocities = np.zeros((2, count, 3))
        return cls(
            np.zeros(count, dtype=bool), positions, velocities, none, none.copy(), np.arange(count)
        )


@in_place
def try_sphere_impacts(
    best: Hypotheses,
    window: Observations,
    surfaces: Surfaces,
    pairs: Pairs,
    encounters: Encounters,
) -> None:
    """Try a collision of spheres of equal mass before each of the last frames.

    Args:
        best: Hypotheses, replaced where one of these is cheaper.
        window: Observations of three frames or more.
        surfaces: Gravity and the restitution of two spheres.
        pairs: Pairs of spheres, at least those that may have collided.
        encounters: Overwritten, as `Encounters.none` returns it.
    """
    for k in range(len(pairs[0])):
        i, j = pairs[0][k], pairs[1][k]
        if within(window.origin, window.met, i, j):
            encounters.candidates[i] = encounters.candidates[j] = True
    if not encounters.candidates.any():
        return
    count = len(window.stamps)
    for frame in range(max(2, count - INTERVALS), count):
        begin, end = window.stamps[frame - 1], window.stamps[frame]
        middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
        _predict(encounters, window, surfaces.gravity, frame, middle)
        for k in range(len(pairs[0])):
            i, j = pairs[0][k], pairs[1][k]
            if (
                encounters.candidates[i]
                and encounters.candidates[j]
                and within(window.origin, window.met, i, j)
            ):
                _keep_first(encounters, window.radii, i, j, half)
        for i in range(len(encounters.candidates)):
            if encounters.times[i] < math.inf:
                _take(best, i, window, surfaces, encounters, frame, middle, half)


@in_place
def _predict(
    encounters: Encounters, window: Observations, gravity: Vector, frame: int, middle: float
) -> None:
    """Predict the spheres in the middle of an interval, before any collision in it."""
    for i in range(len(encounters.candidates)):
        encounters.times[i], encounters.partner[i], encounters.spreads[i] = math.inf, i, math.inf
        if not encounters.candidates[i]:
            continue
        before, falls = _motion_before(window, i, frame)
        if before.cost == math.inf:
            continue
        g = gravity if falls else _HELD
        position = plus(row(window.origin, i), before.origin)
        put(encounters.positions, i, position_after(position, before.slope, g, middle))
        put(encounters.velocities, i, plus(before.slope, times(middle, g)))
        encounters.spreads[i] = window.sigma[i] * math.sqrt(variance_at(before, middle))


@in_place
def _motion_before(window: Observations, i: int, frame: int) -> tuple[MotionBefore, bool]:
    """Motion of sphere i before a frame, and whether it is free flight."""
    sigma, angle_sums = window.sigma[i], window.angle_sums[i]
    flying = motion_before(window.flight_sums[i], angle_sums, sigma, frame)
    held = motion_before(window.uniform_sums[i], angle_sums, sigma, frame)
    falls = flying.cost <= held.cost
    return flying if falls else held, falls


@in_place
def _keep_first(encounters: Encounters, radii: Array, i: int, j: int, half: float) -> None:
    """Keep a collision of i and j in the interval if it is the first of either."""
    if not (encounters.spreads[i] < math.inf and encounters.spreads[j] < math.inf):
        return
    relative = minus(row(encounters.velocities, j), row(encounters.velocities, i))
    offset = minus(row(encounters.positions, j), row(encounters.positions, i))
    met = time_of_contact(offset, relative, radii[i] + radii[j])
    doubt = SLACK * math.hypot(encounters.spreads[i], encounters.spreads[j])
    slack = min(doubt / max(length(relative), 1e-300), 2.0 * MOST_SLACK * half)
    if not abs(met) <= half + slack:
        return
    if met <= encounters.times[i]:
        encounters.times[i], encounters.partner[i] = met, j
    if met <= encounters.times[j]:
        encounters.times[j], encounters.partner[j] = met, i


@in_place
def _take(
    best: Hypotheses,
    i: int,
    window: Observations,
    surfaces: Surfaces,
    encounters: Encounters,
    frame: int,
    middle: float,
    half: float,
) -> None:
    """Try the first collision of sphere i in an interval."""
    before, falls = _motion_before(window, i, frame)
    sigma, gravity, partner = window.sigma[i], surfaces.gravity, encounters.partner[i]
    since = min(max(encounters.times[i], -half), half)
    partner_time = min(max(encounters.times[partner], -half), half)
    velocity, partner_velocity = row(encounters.velocities, i), row(encounters.velocities, partner)
    offset = minus(
        plus(row(encounters.positions, partner), times(partner_time, partner_velocity)),
        plus(row(encounters.positions, i), times(since, velocity)),
    )
    change = velocity_change(
        offset, minus(partner_velocity, velocity), surfaces.sphere_restitution
    )
    size, t = length(change), middle + since
    g = gravity if falls else _HELD
    law_velocity = plus(plus(before.slope, times(t, g)), change)
    blur = size * encounters.spreads[i] / window.radii[i]
    drift = sigma**2 / before.span + blur**2 + 1e-30
    afters = (
        _after(
            window.flight_sums[i],
            frame,
            t,
            before,
            law_velocity,
            g,
            gravity,
            offset,
            size,
            drift,
            sigma,
        ),
        _after(
            window.uniform_sums[i],
            frame,
            t,
            before,
            law_velocity,
            g,
            _HELD,
            offset,
            size,
            drift,
            sigma,
        ),
    )
    flies = afters[0].cost <= afters[1].cost
    after = afters[0] if flies else afters[1]
    contact = Contact(frame, t, plus(before.angle, times(t, before.spin)), before.spin)
    kind = FLIGHT if flies else UNIFORM
    try_contact(best, i, joined(before, after, 0.0), kind, contact)


@in_place
def _after(
    sums: Array,
    frame: int,
    t: float,
    before: MotionBefore,
    law_velocity: Vector,
    g: Vector,
    fall: Vector,
    offset: Vector,
    size: float,
    drift: float,
    sigma: float,
) -> Hypothesis:
    """Motion after a collision, without the acceleration that is left out of the sums too."""
    return motion_after(
        sums,
        frame,
        t,
        position_after(before.origin, before.slope, minus(g, fall), t),
        1.0 / variance_at(before, t),
        minus(law_velocity, times(t, fall)),
        times(1.0 / length(offset), offset),
        sigma**2 / (drift + (_ALONG * size) ** 2),
        sigma**2 / (drift + (_ACROSS * size) ** 2),
        sigma,
    )
