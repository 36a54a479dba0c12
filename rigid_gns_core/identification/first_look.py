# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What tracks show without a fit: bounces, and noise.

A fit that begins far off may end where it began: a wrong restitution can be made up for by spins
and heights, bounce by bounce.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .parameters import Laws
from .stretches import Stretch
from ..scenes.state import Array

# frames of the line on each side of a bounce, and those left out next to it
_SIDE, _NEXT = 6, 1
# a lowest frame is one of a bounce below this height [m], [approach in one frame], and above this
# approach speed [m/s]
_LOW, _SLOW = 0.01, 0.3
# a restitution that so many bounces show
_FEWEST = 3
# frames are no flight where a line leaves less than this part of what a parabola leaves, squared
_STRAIGHT = 0.5


def shown_restitution(laws: Laws, found: Sequence[Stretch], group: int) -> float | None:
    """Median restitution of the bounces on a group of surfaces; None: too few show."""
    bounces = shown_bounces(laws, found, group)
    return float(np.median(bounces[:, 1])) if len(bounces) >= _FEWEST else None


def shown_bounces(laws: Laws, found: Sequence[Stretch], group: int) -> Array:
    """Approach speed [m/s] and restitution of bounces on a group of surfaces, shape (bounces, 2).

    The normal velocities are those of parabolas under gravity through the frames on each side.
    There are none of obstacles, whose normal is another one in each frame.
    """
    bounces: list[tuple[float, float]] = []
    for one in found:
        model = laws.models[min(one.sphere, len(laws.models) - 1)]
        for k in (k for k in laws.groups[group] if k < model.surfaces):
            plane = model.planes[k]
            normal = plane[9:12]
            heights = (one.positions - plane[:3]) @ normal - model.radius
            bounces += _bounces(one.times, heights, float(normal @ model.gravity))
    return np.array(bounces).reshape(-1, 2)


def _bounces(times: Array, heights: Array, pull: float) -> list[tuple[float, float]]:
    bounces = []
    lowest = (heights[1:-1] <= heights[:-2]) & (heights[1:-1] < heights[2:])
    for i in np.flatnonzero(lowest) + 1:
        before = slice(max(i - _NEXT - _SIDE, 0), max(i - _NEXT, 0))
        after = slice(i + _NEXT + 1, i + _NEXT + 1 + _SIDE)
        speeds = [_speed(times[part] - times[i], heights[part], pull) for part in (before, after)]
        if speeds[0] is None or speeds[1] is None:
            continue
        step = float(np.diff(times[i - 1 : i + 2]).max())
        near = heights[i] < _LOW + step * abs(speeds[0])
        # a ball that rolls seems to fall, and to rise again, if it is taken for one that flies
        straight = speeds[0] - pull * float(times[before].mean() - times[i])
        near = near and straight < -_SLOW
        if near and speeds[0] < -_SLOW and 0.0 < speeds[1] <= -1.05 * speeds[0]:
            bounces.append((-speeds[0], min(-speeds[1] / speeds[0], 1.0)))
    return bounces


def _speed(times: Array, heights: Array, pull: float) -> float | None:
    """Normal velocity at time 0 of a parabola; None: too few frames, or they do not fly."""
    if len(times) < _SIDE:
        return None
    line = np.stack([np.ones_like(times), times], axis=1)
    fall = heights - 0.5 * pull * times**2
    found = np.linalg.lstsq(line, fall, rcond=None)[0]
    rest = heights - line @ np.linalg.lstsq(line, heights, rcond=None)[0]
    off = fall - line @ found
    # a ball that rolls is taken for one that falls and rises only if it is seen this seldom; one
    # that hardly bounces, seen 300 times a second, is squashed for some of the frames
    seldom = abs(pull) * float(np.ptp(times)) > _SLOW
    straight = seldom and rest @ rest < _STRAIGHT * (off @ off)
    return None if straight else float(found[1])


def shown_noise(found: Sequence[Stretch]) -> float:
    """Standard deviation of a coordinate [m], by what four frames in a row have beside a parabola.

    The median of it is taken over frames at even intervals.
    """
    off = []
    for one in found:
        t, p = one.times, one.positions
        if len(t) < 5:
            continue
        intervals = np.diff(t)
        even = np.abs(intervals[1:] - intervals[:-1]) < 0.1 * np.median(intervals)
        even = even[1:] & even[:-1]
        third = p[3:] - 3.0 * p[2:-1] + 3.0 * p[1:-2] - p[:-3]
        off.append(np.abs(third[even]).ravel() / np.sqrt(20.0))
    every = np.concatenate(off) if off else np.zeros(0)
    every = every[every > 0.0]  # axes that are not measured do not change
    return float(np.median(every)) / 0.6745 if len(every) else 1e-3
