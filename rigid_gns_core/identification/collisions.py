# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What tracks show of collisions of two balls, without a fit.

Velocities before and after are those of short parabolas through the frames on each side. The line
of centres is that of the time at which the motions before bring them to touch.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from ..data.tracks import Track
from ..scenes.state import Array

# frames on each side of a collision: of this time [s], so many at least
_SIDE, _FEWEST = 0.12, 4
# of a ball at rest some trackers say nothing: it moved no farther than this [radii]
_STILL = 0.05
# approach speeds that tell [m/s]
_SLOW = 0.3
# collisions that tell a restitution
_TELL = 6
# momentum along the line of centres changes by this part of the approach speed at most
_KEPT = 0.1


def shown_collisions(tracks: Sequence[Track], radius: float) -> Array:
    """Approach speed [m/s] and restitution of collisions of equal balls, shape (collisions, 2).

    Args:
        tracks: Tracks of several balls.
        radius: Of the balls [m].
    """
    found = [np.zeros((0, 2))]
    for track in tracks:
        for pair in combinations(range(len(track.spheres)), 2):
            found += [
                np.array([one])
                for time in meetings(track, pair, radius)
                if (one := _collision(track, pair, time, radius)) is not None
            ]
    return np.concatenate(found)


def usual_restitution(shown: Array) -> tuple[float, float]:
    """Median restitution of collisions, of four digits, and its standard error.

    The error is that of a median, by the median deviation; infinite of too few.
    """
    value = float(f'{np.median(shown[:, 1]):.4g}')
    spread = 1.4826 * float(np.median(np.abs(shown[:, 1] - value)))
    error = float(np.sqrt(0.5 * np.pi / len(shown))) * spread
    return value, error if len(shown) >= _TELL else np.inf


def meetings(track: Track, pair: tuple[int, int], radius: float) -> Iterator[float]:
    """Times at which two balls are nearest to each other, and near."""
    (a, first), (b, second) = (track.samples(sphere) for sphere in pair)
    if len(a) < 2 or len(b) < 2:
        return
    times = np.union1d(a, b)
    times = times[(times >= max(a[0], b[0])) & (times <= max(a[-1], b[-1]))]
    apart = np.zeros(len(times))
    for axis in range(3):
        apart += (np.interp(times, a, first[:, axis]) - np.interp(times, b, second[:, axis])) ** 2
    apart = np.sqrt(apart)
    lowest = (apart[1:-1] <= apart[:-2]) & (apart[1:-1] < apart[2:])
    # between two frames they may have been nearer, by as much as they move
    steps = np.maximum(apart[:-2], apart[2:]) - apart[1:-1]
    for k in np.flatnonzero(lowest & (apart[1:-1] < 2.1 * radius + steps)) + 1:
        yield float(times[k])


def _collision(
    track: Track, pair: tuple[int, int], time: float, radius: float
) -> tuple[float, float] | None:
    """Approach speed and restitution of a collision about a time; None: it does not show."""
    one, other = (_sides(*track.samples(sphere), time, radius) for sphere in pair)
    if one is None or other is None:
        return None
    (before, after), (other_before, other_after) = one, other
    gap, closing = other_before[0] - before[0], other_before[1] - before[1]
    # |gap + closing t| = 2 r, the earlier root
    a, b = closing @ closing, gap @ closing
    root = b * b - a * (gap @ gap - 4.0 * radius**2)
    if a < _SLOW**2 or root < 0.0:
        return None
    touch = (-b - np.sqrt(root)) / a
    if abs(touch) > _SIDE:
        return None
    normal = (gap + closing * touch) / (2.0 * radius)
    approach = -float(closing @ normal)
    leaving = float((other_after[1] - after[1]) @ normal)
    gained = float((other_after[1] + after[1] - other_before[1] - before[1]) @ normal)
    told = approach > _SLOW and 0.0 < leaving < 1.1 * approach and abs(gained) < _KEPT * approach
    return (approach, min(leaving / approach, 1.0)) if told else None


def _sides(
    times: Array, places: Array, time: float, radius: float
) -> tuple[tuple[Array, Array], tuple[Array, Array]] | None:
    """Position and velocity at a time by the frames before and by those after."""
    step = 0.5 * float(np.median(np.diff(times)))
    sides = []
    for begin, end in ((time - _SIDE, time - step), (time + step, time + _SIDE)):
        inside = (times >= begin) & (times <= end)
        if inside.sum() >= _FEWEST:
            t = times[inside] - time
            basis = np.stack([np.ones_like(t), t, t**2], axis=1)
            parabola = np.linalg.lstsq(basis, places[inside], rcond=None)[0]
            sides.append((parabola[0], parabola[1]))
            continue
        around = slice(max(int(np.searchsorted(times, begin)) - 1, 0), None)
        near = places[around][times[around] <= end]
        if not len(near) or np.ptp(near, axis=0).max() > _STILL * radius:
            return None
        sides.append((near[-1], np.zeros(3)))
    return sides[0], sides[1]
