# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least-squares lines through parts of a sphere's window, by sums from its beginning."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import in_place
from ..kernels.vector import Vector
from ..scenes.state import Array

Flags = NDArray[np.bool_]

# columns of sums: weights, times and squared times, then values, times times values and squared
# values, three of each
COLUMNS = 12


class Line(NamedTuple):
    """A line value = origin + slope t through frames in a row.

    Args:
        origin: Value at time 0.
        slope: Per second.
        misfit: Sum of squared residuals over frames and components.
        seen: Number of frames that show it.
        middle: Mean time of these [s].
        span: Sum of squared distances in time from it [s^2].
    """

    origin: Vector
    slope: Vector
    misfit: float
    seen: float
    middle: float
    span: float


@in_place
def accumulate(sums: Array, times: Array, values: Array, seen: Flags, begin: int) -> None:
    """Sum over the frames before each one.

    Args:
        sums: Overwritten, shape (frames + 1, COLUMNS).
        times: [s], shape (frames,).
        values: Shape (frames, 3).
        seen: Whether there is a value, shape (frames,).
        begin: What is earlier than this frame does not count.
    """
    sums[0] = 0.0
    for frame in range(len(times)):
        for column in range(COLUMNS):
            sums[frame + 1, column] = sums[frame, column]
        if frame < begin or not seen[frame]:
            continue
        row, t = sums[frame + 1], times[frame]
        row[0] += 1.0
        row[1] += t
        row[2] += t * t
        for axis in range(3):
            value = values[frame, axis]
            row[3 + axis] += value
            row[6 + axis] += value * t
            row[9 + axis] += value * value


@in_place
def fit_line(sums: Array, begin: int, end: int) -> Line:
    """Return the line through frames `begin` to `end`, `end` not included."""
    ones = sums[end, 0] - sums[begin, 0]
    first = sums[end, 1] - sums[begin, 1]
    count = max(ones, 1.0)
    middle = first / count
    span = sums[end, 2] - sums[begin, 2] - first * middle if ones > 1.5 else 0.0
    x = _component(sums, begin, end, 0, count, middle, span)
    y = _component(sums, begin, end, 1, count, middle, span)
    z = _component(sums, begin, end, 2, count, middle, span)
    origin, slope = (x[0], y[0], z[0]), (x[1], y[1], z[1])
    return Line(origin, slope, x[2] + (y[2] + z[2]), ones, middle, span)


@in_place
def _component(
    sums: Array, begin: int, end: int, axis: int, count: float, middle: float, span: float
) -> tuple[float, float, float]:
    """Origin, slope and misfit of one component."""
    value = sums[end, 3 + axis] - sums[begin, 3 + axis]
    moment = sums[end, 6 + axis] - sums[begin, 6 + axis]
    power = sums[end, 9 + axis] - sums[begin, 9 + axis]
    mean = value / count
    covariance = moment - middle * value
    slope = covariance / span if span > 0 else 0.0
    misfit = max(power - value * mean - slope * covariance, 0.0)
    return mean - slope * middle, slope, misfit
