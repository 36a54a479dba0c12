# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Least-squares lines through any part of a sphere's window, from prefix sums."""

from __future__ import annotations

from typing import NamedTuple

from .jit import in_place
from ..kernels.neighbours import Flags
from ..kernels.vector import Vector
from ..scenes.state import Array

# columns of the prefix sums: count, t, t^2, then x, t x and x^2 of three components each
COLUMNS = 12


class Line(NamedTuple):
    """Least-squares line value = origin + slope t through consecutive frames.

    Args:
        origin: Value at time 0.
        slope: Slope per second.
        misfit: Sum of squared residuals over frames and components.
        seen: Number of frames with a value.
        middle: Mean time of these frames [s].
        span: Sum of their squared distances in time from `middle` [s^2].
    """

    origin: Vector
    slope: Vector
    misfit: float
    seen: float
    middle: float
    span: float


@in_place
def accumulate(sums: Array, times: Array, values: Array, seen: Flags, begin: int) -> None:
    """Prefix sums over the frames.

    Args:
        sums: Overwritten, shape (frames + 1, COLUMNS).
        times: Times of the frames [s], shape (frames,).
        values: Values, shape (frames, 3).
        seen: Whether a frame has a value, shape (frames,).
        begin: Frames before this one do not count.
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
    """Line through the frames from `begin` up to but without `end`."""
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
