# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tries all hypotheses of a window, sphere by sphere, and evaluates the cheapest at its end."""

from __future__ import annotations

from .collisions import Pairs, within
from .impacts import nearest_surface, normal_towards, position_after, Surfaces
from .jit import entry, in_place
from .line_fit import accumulate, fit_line
from .motion_models import FLIGHT, Hypotheses, ROLLING, try_tail, UNIFORM
from .observations import Observations
from .rolling_fit import try_rolling
from .sphere_impact_fit import Encounters, try_sphere_impacts
from .surface_impact_fit import never_turns, spin_since, try_surface_impacts
from ..kernels.quaternions import turn
from ..kernels.vector import cross, plus, put, row, times, Vector
from ..scenes.state import Array

# cost of flight beside a surface: it has two more unknowns than rolling
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
    """Find the cheapest hypothesis of each sphere.

    Args:
        best: Hypotheses at rest, replaced by cheaper ones.
        window: Observations of two frames or more.
        surfaces: Surfaces and gravity.
        pairs: Pairs of spheres that may touch, or have collided lately.
        held: Cost of uniform motion without a known support, overwritten, shape (n,).
        encounters: Scratch, overwritten.
        sums: Scratch, overwritten, shape (frames + 1, COLUMNS).
        level: Scratch, overwritten, shape (frames + 1, 4).
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
    """Try all motions of one sphere without collisions.

    Args:
        best: Hypotheses, replaced by cheaper ones.
        i: Index of the sphere.
        window: Observations of two frames or more.
        surfaces: Surfaces and gravity.
        held: Cost of uniform motion.
        sums: Scratch, overwritten, shape (frames + 1, COLUMNS).
        level: Scratch, overwritten, shape (frames + 1, 4).
    """
    frames, sigma = len(window.stamps), window.sigma[i]
    index, gap = nearest_surface(surfaces, row(window.origin, i), window.radii[i])
    beside = gap <= window.near[i]
    freedom = _FREEDOM if beside else 0.0
    for begin in range(frames - 1):
        try_tail(best, i, window.flight_sums[i], begin, sigma, FLIGHT, freedom, _NONE)
    # every motion fits two frames: without a scene, flight is taken
    if surfaces.known or frames > 2:
        for begin in range(frames - 1):
            try_tail(best, i, window.uniform_sums[i], begin, sigma, UNIFORM, held, _NONE)
    if beside:
        try_rolling(best, i, window, surfaces, index, sums, level)
    if surfaces.known and frames > 2:
        try_surface_impacts(best, i, window, surfaces, freedom)


@entry
def finish(
    best: Hypotheses,
    window: Observations,
    surfaces: Surfaces,
    positions: Array,
    velocities: Array,
    spins: Array,
    quaternions: Array,
    sums: Array,
) -> None:
    """Evaluate the hypotheses at the frame that shows each sphere last.

    Args:
        best: The hypotheses.
        window: Observations of the frames.
        surfaces: Surfaces and gravity.
        positions: Overwritten [m], shape (n, 3).
        velocities: Overwritten [m/s], shape (n, 3).
        spins: Overwritten [rad/s], shape (n, 3).
        quaternions: Measured rotations, turned on to the last frame, shape (n, 4).
        sums: Scratch, overwritten, shape (frames + 1, COLUMNS).
    """
    for i in range(len(positions)):
        at, slope = window.stamps[window.last[i]], row(best.slopes, i)
        g = surfaces.gravity if best.kinds[i] == FLIGHT else _NONE
        origin = plus(row(window.origin, i), row(best.origins, i))
        put(positions, i, position_after(origin, slope, g, at))
        put(velocities, i, plus(slope, times(at, g)) if best.frames[i] > 1 else _NONE)
        # from the frames since the last contact
        begin = best.begin[i]
        accumulate(sums, window.stamps, window.angles[i], window.seen[i], begin)
        if best.kinds[i] == ROLLING and never_turns(window.angles[i]):
            put(spins, i, _rolling_spin(surfaces, origin, row(velocities, i), window.radii[i]))
        elif best.struck[i] and sums[-1, 0] < 1.5:
            put(spins, i, spin_since(best, i, window))
        else:
            put(spins, i, fit_line(sums, begin, len(window.stamps)).slope)
        turn(quaternions, i, row(spins, i), -at)


@in_place
def _rolling_spin(surfaces: Surfaces, origin: Vector, velocity: Vector, radius: float) -> Vector:
    """Spin of a sphere that rolls without sliding, w = n x v / r [rad/s].

    Many trackers always send the same rotation: that of a sphere that rolls is then not known.
    """
    index, _ = nearest_surface(surfaces, origin, radius)
    return times(1.0 / radius, cross(normal_towards(surfaces, index, origin), velocity))
