# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Hypotheses of spheres that roll on a surface, one radius above it."""

from __future__ import annotations

from .impacts import normal_towards, Surfaces
from .jit import in_place
from .line_fit import accumulate, fit_line
from .motion_models import Hypotheses, ROLLING, try_tail
from .observations import Observations
from ..kernels.vector import across, dot, length, minus, put, row, times, Vector
from ..scenes.state import Array

# standard deviation of the height of a supported sphere, beside the noise [radii]
_HEIGHT = 5e-3


@in_place
def try_rolling(
    best: Hypotheses,
    i: int,
    window: Observations,
    surfaces: Surfaces,
    index: int,
    sums: Array,
    level: Array,
) -> None:
    """Try rolling on a surface from each frame on.

    Args:
        best: Hypotheses, replaced where one of these is cheaper.
        i: Index of the sphere.
        window: Observations of its frames.
        surfaces: Surfaces and gravity.
        index: Index of the surface.
        sums: Scratch, overwritten, shape (frames + 1, COLUMNS).
        level: Scratch, overwritten, shape (frames + 1, 4).
    """
    stamps, seen, offsets = window.stamps, window.seen[i], window.offsets[i]
    radius, sigma = window.radii[i], window.sigma[i]
    normal = normal_towards(surfaces, index, row(window.origin, i))
    height = dot(minus(row(window.origin, i), row(surfaces.points, index)), normal) - radius
    # it rolls down a slope at 1 / (1 + i) of the pull; rolling friction opposes its velocity
    share = 1.0 / (1.0 + surfaces.inertia)
    rolling = times(share, across(surfaces.gravity, normal))
    _roll_back(level, stamps, offsets, normal, rolling)
    accumulate(sums, stamps, level, seen, 0)
    slope = fit_line(sums, 0, len(stamps)).slope
    speed = length(slope)
    brake = surfaces.rolling_friction * share * abs(dot(surfaces.gravity, normal))
    # a slower sphere may stop within the window, so that its friction is left out
    if speed > brake * -stamps[0]:
        rolling = minus(rolling, times(brake / speed, slope))
        _roll_back(level, stamps, offsets, normal, rolling)
        accumulate(sums, stamps, level, seen, 0)
    spread = sigma**2 + (_HEIGHT * radius) ** 2
    # from the measured centre to one radius above the surface
    back = times(-height, normal)
    # squared residuals of the height, summed from each frame on
    level[-1, 3] = 0.0
    for frame in range(len(stamps) - 1, -1, -1):
        above = dot(row(offsets, frame), normal) + height if seen[frame] else 0.0
        level[frame, 3] = level[frame + 1, 3] + above**2 / spread
    for begin in range(len(stamps) - 1):
        try_tail(best, i, sums, begin, sigma, ROLLING, level[begin, 3], back)


@in_place
def _roll_back(
    level: Array, stamps: Array, offsets: Array, normal: Vector, rolling: Vector
) -> None:
    """Overwrite `level` with offsets along the surface without the acceleration of rolling."""
    for frame in range(len(stamps)):
        along = across(row(offsets, frame), normal)
        put(level, frame, minus(along, times(0.5 * stamps[frame] ** 2, rolling)))
