# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""All hypotheses of a window, sphere by sphere, and what the cheapest one says of its end."""

from __future__ import annotations

from .collisions import Pairs, within
from .impacts import nearest, placed, Surfaces
from .jit import entry, in_place
from .line_fit import accumulate, fit_line
from .motion_models import FLIGHT, Hypotheses, try_tail, UNIFORM
from .observations import Observations
from .rolling_fit import try_rolling
from .sphere_impact_fit import Encounters, try_sphere_impacts
from .surface_impact_fit import spin_since, try_surface_impacts
from ..kernels.quaternions import turn
from ..kernels.vector import plus, put, row, times, Vector
from ..scenes.state import Array

# charge for flight beside a surface, which has two unknowns more than rolling on it
_FREEDOM = 4.0
_NONE = (0.0, 0.0, 0.0)


@entry
def fit(
    best: Hypotheses,
    window: Observations,
    surfaces: Surfaces,
    pairs: Pairs,
    held: Array,
    encounters: Encounters,
    sums: Array,
    level: Array,
) -> None:
    """Find the best hypotheses.

    Args:
        best: At rest; takes what costs less.
        window: Two frames or more.
        surfaces: And gravity.
        pairs: Of spheres that may touch, or have met lately.
        held: Charge of each for being held by what the scene does not know, shape (n,).
        encounters: Overwritten.
        sums: Overwritten, shape (frames + 1, COLUMNS).
        level: Overwritten, shape (frames + 1, 4).
    """
    for k in range(len(pairs[0])):
        i, j = pairs[0][k], pairs[1][k]
        if within(window.origin, window.touch, i, j):
            held[i] = held[j] = 0.0
    for i in range(len(window.last)):
        _try_alone(best, i, window, surfaces, held[i], sums, level)
    if len(window.stamps) > 2 and surfaces.known:
        try_sphere_impacts(best, window, surfaces, pairs, encounters)


@in_place
def _try_alone(
    best: Hypotheses,
    i: int,
    window: Observations,
    surfaces: Surfaces,
    held: float,
    sums: Array,
    level: Array,
) -> None:
    """Try all motions of one sphere alone.

    Args:
        best: Takes those that cost least.
        i: Of the sphere.
        window: Two frames or more.
        surfaces: And gravity.
        held: Charge for being held.
        sums: Overwritten, shape (frames + 1, COLUMNS).
        level: Overwritten, shape (frames + 1, 4).
    """
    frames, sigma = len(window.stamps), window.sigma[i]
    index, gap = nearest(surfaces, row(window.origin, i), window.radii[i])
    beside = gap <= window.near[i]
    freedom = _FREEDOM if beside else 0.0
    for begin in range(frames - 1):
        try_tail(best, i, window.flights[i], begin, sigma, FLIGHT, freedom, _NONE)
    # two frames fit every motion: without a scene it is flight
    if surfaces.known or frames > 2:
        for begin in range(frames - 1):
            try_tail(best, i, window.straight[i], begin, sigma, UNIFORM, held, _NONE)
    if beside:
        try_rolling(best, i, window, surfaces, index, sums, level)
    if surfaces.known and frames > 2:
        try_surface_impacts(best, i, window, surfaces, freedom)


@entry
def finish(
    best: Hypotheses,
    window: Observations,
    gravity: Vector,
    places: Array,
    speeds: Array,
    spins: Array,
    quaternions: Array,
    sums: Array,
) -> None:
    """Find what the best hypotheses say of spheres where they were seen last.

    Args:
        best: The hypotheses.
        window: Their frames.
        gravity: Acceleration of free flight [m/s^2].
        places: Overwritten, shape (n, 3).
        speeds: Overwritten, shape (n, 3).
        spins: Overwritten, shape (n, 3).
        quaternions: As measured, turned to where they are at the last frame, shape (n, 4).
        sums: Overwritten, shape (frames + 1, COLUMNS).
    """
    for i in range(len(places)):
        at, slope = window.stamps[window.last[i]], row(best.slopes, i)
        g = gravity if best.kinds[i] == FLIGHT else _NONE
        origin = plus(row(window.origin, i), row(best.origins, i))
        put(places, i, placed(origin, slope, g, at))
        put(speeds, i, plus(slope, times(at, g)) if best.frames[i] > 1 else _NONE)
        # from the frames since the last contact
        begin = best.begin[i]
        accumulate(sums, window.stamps, window.turned[i], window.seen[i], begin)
        if best.struck[i] and sums[-1, 0] < 1.5:
            put(spins, i, spin_since(best, i, window))
        else:
            put(spins, i, fit_line(sums, begin, len(window.stamps)).slope)
        turn(quaternions, i, row(spins, i), -at)
