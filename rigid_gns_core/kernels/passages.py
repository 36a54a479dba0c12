# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""When the paths of rollouts first cross a plane."""

from __future__ import annotations

import math

from .between_steps import Cubic, is_struck, pieces, slope, Steps, value
from .jit import entry, in_place
from .vector import dot, minus, row, Vector
from ..scenes.state import Array

# steps of Newton's method, each held within its bracket
_STEPS = 12

# coefficients of 1, t, t^2, t^3
Line = tuple[float, float, float, float]


@in_place
def _along(cubic: Cubic, origin: Vector, normal: Vector) -> Line:
    """Height above a plane."""
    height = dot(minus(cubic[0], origin), normal)
    return height, dot(cubic[1], normal), dot(cubic[2], normal), dot(cubic[3], normal)


@in_place
def _at(line: Line, t: float) -> float:
    return line[0] + t * (line[1] + t * (line[2] + t * line[3]))


@in_place
def _turns(line: Line) -> tuple[float, float]:
    """Times at which the derivative is 0, in rising order; 0 where there is none."""
    a, b, c = 3.0 * line[3], 2.0 * line[2], line[1]
    root = math.sqrt(max(b * b - 4.0 * a * c, 0.0))
    # without cancellation: q / a and c / q
    q = -0.5 * (b + (-root if b < 0.0 else root))
    one, two = q / a if a != 0.0 else 0.0, c / q if q != 0.0 else 0.0
    return min(one, two), max(one, two)


@in_place
def _root(line: Line, low: float, high: float) -> float:
    """Root between two times with values of unlike signs."""
    begin, t = _at(line, low), 0.5 * (low + high)
    for _ in range(_STEPS):
        there = _at(line, t)
        if there * begin > 0.0:
            low = t
        else:
            high = t
        rate = line[1] + t * (2.0 * line[2] + 3.0 * t * line[3])
        t -= there / rate if rate != 0.0 else 0.0
        if not low <= t <= high:
            t = 0.5 * (low + high)
    return t


@in_place
def _may_cross(steps: Steps, s: int, k: int, i: int, origin: Vector, normal: Vector) -> bool:
    """Whether a step has heights of unlike signs, a turn between them, or a blow."""
    here, there = steps.positions[s, k], steps.positions[s, k + 1]
    if dot(minus(row(here, i), origin), normal) * dot(minus(row(there, i), origin), normal) <= 0.0:
        return True
    here, there = steps.velocities[s, k], steps.velocities[s, k + 1]
    if dot(row(here, i), normal) * dot(row(there, i), normal) <= 0.0:
        return True
    return is_struck(steps, s, k, i)


@entry
def find_passages(
    steps: Steps, sphere: int, point: Array, axes: Array, half: Array, horizon: float,
    found_out: Array,
) -> None:  # fmt: skip
    """Find when, where and how fast a sphere first crosses a plane in each rollout.

    Args:
        steps: The rollouts.
        sphere: Which sphere.
        point: Of the plane, shape (3,).
        axes: Rows direction, normal x direction, normal, shape (3, 3).
        half: Half lengths along the first two, may be infinite, shape (2,).
        horizon: Latest time.
        found_out: Time, position and velocity, NaN where it does not cross, shape (s, 7).
    """
    origin, normal = (point[0], point[1], point[2]), row(axes, 2)
    latest = horizon * (1.0 + 1e-12)
    for s in range(len(steps.positions)):
        found_out[s] = math.nan
        for k in range(steps.blows.shape[1]):
            begin = k * steps.dt
            if begin > latest:
                break
            if not _may_cross(steps, s, k, sphere, origin, normal):
                continue
            before, after, split = pieces(steps, s, k, sphere)
            if _cross_in_step(
                before, after, split, steps.dt, begin, latest, origin, axes, half, found_out[s]
            ):
                break


@in_place
def _cross_in_step(
    before: Cubic, after: Cubic, split: float, dt: float, begin: float, latest: float,
    origin: Vector, axes: Array, half: Array, found_out: Array,
) -> bool:  # fmt: skip
    """Write the first crossing in a step, where there is one."""
    normal, low, last = row(axes, 2), 0.0, 0.0
    for late in range(2):
        cubic, end = (after, dt) if late else (before, split)
        line = _along(cubic, origin, normal)
        value_low = _at(line, low)
        # the two do not meet exactly: a crossing may be between them
        if (
            late
            and last * value_low < 0.0
            and _put(cubic, low, begin, latest, origin, axes, half, found_out)
        ):
            return True
        one, two = _turns(line)
        for part in range(3):
            high = end
            if part < 2:
                high = min(max(one if part == 0 else two, low), end)
            value_high = _at(line, high)
            if value_low * value_high < 0.0 or (value_high == 0.0 and value_low != 0.0):
                t = _root(line, low, high)
                if _put(cubic, t, begin, latest, origin, axes, half, found_out):
                    return True
            low, value_low = high, value_high
        last = value_low
    return False


@in_place
def _put(
    cubic: Cubic, t: float, begin: float, latest: float, origin: Vector, axes: Array, half: Array,
    found_out: Array,
) -> bool:  # fmt: skip
    """Write a crossing that is in time, and within the ends of the plane."""
    place, time = value(cubic, t), begin + t
    off = minus(place, origin)
    beside = abs(dot(off, row(axes, 0))) > half[0] or abs(dot(off, row(axes, 1))) > half[1]
    if beside or not 0.0 < time <= latest:
        return False
    speed = slope(cubic, t)
    found_out[0] = time
    for axis in range(3):
        found_out[1 + axis], found_out[4 + axis] = place[axis], speed[axis]
    return True
