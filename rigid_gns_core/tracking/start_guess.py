# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is known of the start of a window before its fit: surface, first guess, prior."""

from __future__ import annotations

import numpy as np

from .ball_contact import FREE
from .ball_surfaces import AT_REST, KIND
from .jit import entry
from .spin_windows import spin_at, SpinWindows
from ..scenes.state import Array

# parts of a start that are fitted: p, v, w
ALL, WITHOUT_SPIN = np.ones(9), np.repeat([1.0, 1.0, 0.0], 3)
# how well a start is known beforehand: position [m] and velocity [m/s]; on a surface, off it
_PLACE, _VELOCITY, _HELD = 1e3, 1e2, 1e-4
# time [s] and least number of the frames of the first guess
_FIRST, _FEW = 0.06, 6
# a ball is on a surface if it is there for so long [s] and in so many frames
_STAYS, _FEWEST = 0.06, 5


@entry
def first_frames(times: Array) -> int:
    """Number of frames of a first guess."""
    count = 0
    while count < len(times) and times[count] - times[0] <= _FIRST:
        count += 1
    return min(max(_FEW, count), len(times))


@entry
def surface_of_start(
    ball: Array, planes: Array, times: Array, positions: Array, noise: float
) -> int:
    """Surface that a ball is on in the first frames of a window, or FREE.

    It is on one where it stays within the noise of it for a time in which a ball that bounces
    would have left it.
    """
    count = 0
    while count < len(times) and (times[count] - times[0] <= _STAYS or count < _FEWEST):
        count += 1
    far = max(4.0 * noise, 1e-3)
    for k in range(len(planes)):
        pull = 0.0
        for c in range(3):
            pull += planes[k, 9 + c] * ball[0, c]
        stays = pull < 0.0 and planes[k, KIND] == AT_REST
        for i in range(count):
            along = side = off = 0.0
            for c in range(3):
                apart = positions[i, c] - planes[k, c]
                along += apart * planes[k, 3 + c]
                side += apart * planes[k, 6 + c]
                off += apart * planes[k, 9 + c]
            inside = abs(along) <= planes[k, 12] and abs(side) <= planes[k, 13]
            stays = stays and inside and abs(off - ball[0, 7]) < far
        if stays:
            return k
    return FREE


@entry
def guess_start(
    ball: Array,
    planes: Array,
    times: Array,
    positions: Array,
    on: int,
    frames: int,
    guess_out: Array,
) -> None:
    """Position and velocity at the first frame, shape (6,): a line under gravity by least squares.

    Of a ball on a surface, a line on it.
    """
    n = min(frames, len(times))
    middle = 0.0
    for i in range(n):
        middle += (times[i] - times[0]) / n
    span = 0.0
    for i in range(n):
        span += (times[i] - times[0] - middle) ** 2
    for c in range(3):
        pull = ball[0, c] if on == FREE else 0.0
        mean = slope = 0.0
        for i in range(n):
            t = times[i] - times[0]
            place = positions[i, c] - 0.5 * t * t * pull
            mean += place / n
            slope += (t - middle) * place / span if span > 0.0 else 0.0
        guess_out[c], guess_out[3 + c] = mean - middle * slope, slope
    if on == FREE:
        return
    off, away = -ball[0, 7], 0.0
    for c in range(3):
        off += planes[on, 9 + c] * (guess_out[c] - planes[on, c])
        away += planes[on, 9 + c] * guess_out[3 + c]
    for c in range(3):
        guess_out[c] -= off * planes[on, 9 + c]
        guess_out[3 + c] -= away * planes[on, 9 + c]


@entry
def prior_of_guess(
    planes: Array,
    guess: Array,
    on: int,
    spinning: bool,
    spin: Array,
    covariance: Array,
    mean_out: Array,
    precision_out: Array,
) -> None:
    """Mean and inverse covariance of a start, shapes (9,) and (9, 9).

    Args:
        planes: Of the scene.
        guess: Position and velocity, shape (6,).
        on: Surface that the ball is on, or FREE.
        spinning: Whether the spin is free; if not, the ball does not spin, or rolls.
        spin: Mean of the spin, shape (3,).
        covariance: Of the spin, shape (3, 3).
        mean_out: The mean.
        precision_out: The inverse covariance.
    """
    mean_out[:] = 0.0
    precision_out[:] = 0.0
    for c in range(3):
        precision_out[c, c] = _PLACE**-2
        precision_out[3 + c, 3 + c] = _VELOCITY**-2
        precision_out[6 + c, 6 + c] = 1.0
    if spinning:
        mean_out[6:] = spin
        precision_out[6:, 6:] = np.linalg.inv(covariance)
    if on != FREE:
        height = 0.0
        for c in range(3):
            height += planes[on, 9 + c] * guess[c]
        for a in range(3):
            mean_out[a] = height * planes[on, 9 + a]
            for b in range(3):
                held = planes[on, 9 + a] * planes[on, 9 + b] / _HELD**2
                precision_out[a, b] += held
                precision_out[3 + a, 3 + b] += held


@entry
def prior_of_window(
    planes: Array,
    guess: Array,
    on: int,
    spinning: bool,
    windows: SpinWindows,
    mean_out: Array,
    precision_out: Array,
) -> None:
    """As `prior_of_guess`, with the spin of windows that began alike."""
    spin, covariance = np.zeros(3), np.zeros((3, 3))
    if spinning:
        spin_at(windows, windows.counted, guess, spin, covariance)
    prior_of_guess(planes, guess, on, spinning, spin, covariance, mean_out, precision_out)
