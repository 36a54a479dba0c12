# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impacts of two spheres in the last two intervals of a window, fitted as those on surfaces are.

Earlier ones leave frames enough to tell the motion after them without.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .collisions import Pairs, time_of_contact, velocity_change, within
from .impacts import placed, Surfaces
from .jit import in_place
from .motion_models import Contact, FLIGHT, Hypotheses, Hypothesis, Indices, try_contact, UNIFORM
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
from ..kernels.vector import length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

# prior of a collision: standard deviations, as parts of the change of velocity
_ALONG, _ACROSS = 0.1, 0.15
_HELD = (0.0, 0.0, 0.0)  # acceleration of what something holds


class Encounters(NamedTuple):
    """Spheres in the middle of an interval, and whom they meet in it.

    Args:
        who: Spheres that may meet another, shape (n,); only these have the rest.
        places: [m], shape (n, 3).
        speeds: [m/s], shape (n, 3).
        spreads: Standard deviation of the places, infinite where nothing is known [m], shape (n,).
        times: From the middle to the first meeting [s], infinite where there is none, shape (n,).
        partner: With whom, shape (n,).
    """

    who: NDArray[np.bool_]
    places: Array
    speeds: Array
    spreads: Array
    times: Array
    partner: Indices

    @classmethod
    def none(cls, count: int) -> Encounters:
        """Return empty ones to be filled, for `count` spheres."""
        none = np.zeros(count)
        places, speeds = np.zeros((2, count, 3))
        return cls(
            np.zeros(count, dtype=bool), places, speeds, none, none.copy(), np.arange(count)
        )


@in_place
def try_sphere_impacts(
    best: Hypotheses, window: Observations, surfaces: Surfaces, pairs: Pairs, found: Encounters
) -> None:
    """Try a collision in front of each of the last frames, of spheres of equal mass.

    Args:
        best: Takes those that cost least.
        window: Three frames or more.
        surfaces: Gravity and the restitution of spheres.
        pairs: Of spheres that may have met, and others.
        found: Overwritten; nobody may meet another yet.
    """
    for k in range(len(pairs[0])):
        i, j = pairs[0][k], pairs[1][k]
        if within(window.origin, window.met, i, j):
            found.who[i] = found.who[j] = True
    if not found.who.any():
        return
    count = len(window.stamps)
    for frame in range(max(2, count - INTERVALS), count):
        begin, end = window.stamps[frame - 1], window.stamps[frame]
        middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
        _predict(found, window, surfaces.gravity, frame, middle)
        for k in range(len(pairs[0])):
            i, j = pairs[0][k], pairs[1][k]
            if found.who[i] and found.who[j] and within(window.origin, window.met, i, j):
                _keep_first(found, window.radii, i, j, half)
        for i in range(len(found.who)):
            if found.times[i] < math.inf:
                _take(best, i, window, surfaces, found, frame, middle, half)


@in_place
def _predict(
    found: Encounters, window: Observations, gravity: Vector, frame: int, middle: float
) -> None:
    """Where spheres are in the middle of an interval; nobody has met another yet."""
    for i in range(len(found.who)):
        found.times[i], found.partner[i], found.spreads[i] = math.inf, i, math.inf
        if not found.who[i]:
            continue
        before, falls = _before(window, i, frame)
        if before.cost == math.inf:
            continue
        g = gravity if falls else _HELD
        place = plus(row(window.origin, i), before.origin)
        put(found.places, i, placed(place, before.slope, g, middle))
        put(found.speeds, i, plus(before.slope, times(middle, g)))
        found.spreads[i] = window.sigma[i] * math.sqrt(variance_at(before, middle))


@in_place
def _before(window: Observations, i: int, frame: int) -> tuple[MotionBefore, bool]:
    """Return the motion of sphere i before a frame, and whether it is a flight."""
    sigma, turns = window.sigma[i], window.turns[i]
    flying = motion_before(window.flights[i], turns, sigma, frame)
    held = motion_before(window.straight[i], turns, sigma, frame)
    falls = flying.cost <= held.cost
    return flying if falls else held, falls


@in_place
def _keep_first(found: Encounters, radii: Array, i: int, j: int, half: float) -> None:
    """Keep a meeting of i and j within half an interval from its middle, if it is their first."""
    if not (found.spreads[i] < math.inf and found.spreads[j] < math.inf):
        return
    relative = minus(row(found.speeds, j), row(found.speeds, i))
    offset = minus(row(found.places, j), row(found.places, i))
    met = time_of_contact(offset, relative, radii[i] + radii[j])
    doubt = SLACK * math.hypot(found.spreads[i], found.spreads[j])
    slack = min(doubt / max(length(relative), 1e-300), 2.0 * MOST_SLACK * half)
    if not abs(met) <= half + slack:
        return
    if met <= found.times[i]:
        found.times[i], found.partner[i] = met, j
    if met <= found.times[j]:
        found.times[j], found.partner[j] = met, i


@in_place
def _take(
    best: Hypotheses,
    i: int,
    window: Observations,
    surfaces: Surfaces,
    found: Encounters,
    frame: int,
    middle: float,
    half: float,
) -> None:
    """Try the first collision of sphere i in an interval."""
    before, falls = _before(window, i, frame)
    sigma, gravity, partner = window.sigma[i], surfaces.gravity, found.partner[i]
    since = min(max(found.times[i], -half), half)
    theirs = min(max(found.times[partner], -half), half)
    speed, their_speed = row(found.speeds, i), row(found.speeds, partner)
    offset = minus(
        plus(row(found.places, partner), times(theirs, their_speed)),
        plus(row(found.places, i), times(since, speed)),
    )
    change = velocity_change(offset, minus(their_speed, speed), surfaces.bounce)
    size, t = length(change), middle + since
    g = gravity if falls else _HELD
    law = plus(plus(before.slope, times(t, g)), change)
    blur = size * found.spreads[i] / window.radii[i]
    drift = sigma**2 / before.span + blur**2 + 1e-30
    afters = (
        _after(window.flights[i], frame, t, before, law, g, gravity, offset, size, drift, sigma),
        _after(window.straight[i], frame, t, before, law, g, _HELD, offset, size, drift, sigma),
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
    law: Vector,
    g: Vector,
    fall: Vector,
    offset: Vector,
    size: float,
    drift: float,
    sigma: float,
) -> Hypothesis:
    """Return the motion after a collision, less the fall that the sums are without."""
    return motion_after(
        sums,
        frame,
        t,
        placed(before.origin, before.slope, minus(g, fall), t),
        1.0 / variance_at(before, t),
        minus(law, times(t, fall)),
        times(1.0 / length(offset), offset),
        sigma**2 / (drift + (_ALONG * size) ** 2),
        sigma**2 / (drift + (_ACROSS * size) ** 2),
        sigma,
    )
