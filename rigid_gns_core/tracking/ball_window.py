# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of one ball at the end of a window: guess, fit, and shorter windows where it fails."""

from __future__ import annotations

import math

import numpy as np

from .ball_contact import FREE, HOPPING
from .ball_fit import fit_start
from .ball_surfaces import AT_REST, facing, KIND, SOLID
from .jit import compiled, entry, in_place
from .pair_blow import Crossed, not_crossed
from .spin_windows import SpinWindows
from .start_guess import first_frames, guess_start, prior_of_window, surface_of_start
from .struck_prior import go_on, keep_spin
from ..kernels.vector import dot, length, minus, row
from ..scenes.state import Array

# least number of frames of a window, and of a part of one
FEWEST, _FEW = 4, 6
MOST_CONTACTS = 32
# parts of the window that are tried, until one is met to this loss per coordinate: what the laws
# do not know, as a net or a racket, may be in it; and a loss at which another guess is made
_PARTS, _MET, _DOUBTED = (1.0, 0.6, 0.35, 0.15), 4.0, 1.5
# and where the best of them has passed the newest frames by, so many of the last ones: fewer than
# `FEWEST` if they tell a velocity, as they are so far apart [s]
_LAST, APART = (4, 3, 2), 0.015
_STEPS, _GROWTH, _GATE = 8, 2.0, 6.0
# a ball this near to what is no plane at rest, and as slow as a hop, lies on it [m]
_HOP = 1e-3
# one frame at the end may be off, so many are not
_MISSED = 2
# nor is the last one with one of so many before it; it is so far off a blow [radii]
_NEWEST, _FAR = 3, 0.1


@in_place
def _begins_near(ball: Array, planes: Array, times: Array, positions: Array, frames: int) -> bool:
    """Whether the ball comes within a radius of a surface in the first frames."""
    for i in range(min(frames, len(positions))):
        for k in range(len(planes)):
            off, _, _ = facing(planes, k, row(positions, i), times[i], ball[0, 7])
            if off < ball[0, 7]:
                return True
    return False


@in_place
def _may_touch(ball: Array, planes: Array, times: Array, positions: Array) -> bool:
    """Whether the ball may have touched a surface in or between frames: its plane, however far."""
    for k in range(len(planes)):
        nearest, farthest, before = math.inf, 0.0, 0.0
        for i in range(len(positions)):
            off, _, _ = facing(planes, k, row(positions, i), times[i], ball[0, 7])
            nearest = min(nearest, off)
            if i > 0:
                farthest = max(farthest, abs(off - before))
            if i > 0 and planes[k, KIND] == SOLID:  # past which a step may lead
                farthest = max(farthest, length(minus(row(positions, i), row(positions, i - 1))))
            before = off
        if nearest < farthest + ball[0, 7]:
            return True
    return False


@compiled
def _estimate(
    ball: Array,
    planes: Array,
    laws: Array,
    noise: Array,
    windows: SpinWindows,
    spinning: bool,
    before: Array,
    crossed: Crossed,
    times: Array,
    positions: Array,
    frames: int,
    first: int,
    state_out: Array,
    covariance_out: Array,
) -> tuple[int, float, int, float, bool]:
    """Estimate from all frames of a window; the guess is from `frames`, the first fit to `first`.

    Returns:
        Surface that the ball is on at the end, or FREE; loss per coordinate, number of impacts,
        the loss with that of dropped frames, and whether the path has passed the newest frames by.
    """
    on = surface_of_start(ball, planes, times, positions, noise[0])
    guess, start = np.zeros(6), np.zeros(9)
    mean, precision = np.zeros(9), np.zeros((9, 9))
    guess_start(ball, planes, times, positions, on, frames, guess)
    prior_of_window(planes, guess, on, spinning, windows, mean, precision)
    if on != FREE and before[3] > 0.0:
        keep_spin(ball, planes[on], guess, before, mean, precision)
    start[:6] = guess
    start[6:] = mean[6:]
    begin = times[0]
    if crossed.time <= begin:
        go_on(ball, planes, on, crossed, mean, precision)
        start[:] = mean
        begin = crossed.time
    weights = np.ones(len(times))
    loss, contacts, where = fit_start(
        start,
        mean,
        precision,
        np.ones(9) if spinning else np.repeat(np.array([1.0, 1.0, 0.0]), 3),
        begin,
        times,
        positions,
        ball,
        planes,
        laws,
        on,
        noise,
        first,
        _GROWTH,
        _STEPS,
        _GATE,
        weights,
        np.zeros((9, 9)),
        state_out,
        covariance_out,
        np.zeros((MOST_CONTACTS, 3)),
    )
    if where != FREE:  # the drift beside the path is no motion off the surface
        away = 0.0
        for c in range(3):
            away += planes[where, 9 + c] * state_out[3 + c]
        for c in range(3):
            state_out[3 + c] -= away * planes[where, 9 + c]
    for k in range(len(planes)):  # nor is that of a hop
        p = (state_out[0], state_out[1], state_out[2])
        v = (state_out[3], state_out[4], state_out[5])
        off, normal, surface = facing(planes, k, p, times[-1], ball[0, 7])
        speed = dot(minus(v, surface), normal)
        hops = planes[k, KIND] != AT_REST and abs(off) < _HOP
        if hops and abs(speed) < 2.0 * HOPPING:
            for c in range(3):
                state_out[3 + c] -= speed * normal[c]
    doubt = loss + 4.0 * (1.0 - weights.mean())
    if weights[-_MISSED:].max() == 0.0:  # where the ball is by now, the path is not
        doubt += 2.0 * _MET  # it yields to any part that is met
    off = 0.0
    for c in range(3):
        off = max(off, abs(state_out[c] - positions[-1, c]))
    passed = off > _FAR * ball[0, 7] and weights[-1] == 0.0
    passed = passed and weights[-1 - _NEWEST : -1].min() == 0.0
    return where, loss, contacts, doubt, passed


@in_place
def _line(
    times: Array, positions: Array, noise: float, state_out: Array, covariance_out: Array
) -> None:
    """State of a ball that moved evenly in its last frames, and does not spin."""
    m = len(times)
    early = max(m - FEWEST, 0)
    span = times[m - 1] - times[early]
    for a in range(9):
        state_out[a] = 0.0
        for b in range(9):
            covariance_out[a, b] = 0.0
    for c in range(3):
        state_out[c] = positions[m - 1, c]
        state_out[3 + c] = (positions[m - 1, c] - positions[early, c]) / span
        covariance_out[c, c] = noise**2
        covariance_out[3 + c, 3 + c] = 2.0 * (noise / span) ** 2


@in_place
def _begin(times: Array, tried: int) -> int:
    """First frame of a part of a window, by its number: those of `_PARTS`, then of `_LAST`."""
    m, begin = len(times), 0
    if tried < len(_PARTS):
        span = _PARTS[tried] * (times[-1] - times[0])
        while times[begin] < times[-1] - span - 1e-9:
            begin += 1
        return begin
    few = _LAST[tried - len(_PARTS)]
    if few < FEWEST and few < m and times[-1] - times[m - few] < APART:
        return 0
    return max(m - few, 0)


@entry
def estimate_window(
    ball: Array,
    planes: Array,
    laws: Array,
    noise: Array,
    windows: SpinWindows,
    spinning: bool,
    before: Array,
    crossed: Crossed,
    times: Array,
    positions: Array,
    state_out: Array,
    covariance_out: Array,
) -> tuple[int, float, int, int]:
    """Estimate the state at the last frame.

    Args:
        ball: As `ball_path.path` takes it, as the next two.
        planes: See there.
        laws: See there.
        noise: s, q, kappa of `model_error`.
        windows: Prior of the spin.
        spinning: Whether the ball may spin; if not, it does not in the air, and rolls on a
            surface.
        before: Of a ball that was struck before the first frame, see `struck`; 0: it was not.
        crossed: Its state just after that; where no path from there meets the frames, one from
            the first frame is tried.
        times: Rising times of the frames [s], shape (m,), `FEWEST` or more.
        positions: Centres [m], shape (m, 3).
        state_out: State, shape (9,).
        covariance_out: Its covariance, shape (9, 9).

    Returns:
        Surface that the ball is on, or FREE; Huber's loss per coordinate, infinite where no path
        was found; index of the first frame that was used, number of impacts.
    """
    m, best, quality = len(times), -1, math.inf
    on, loss, contacts, passed = FREE, math.inf, 0, False
    state, covariance = np.zeros(9), np.zeros((9, 9))
    other, other_covariance, unknown = np.zeros(9), np.zeros((9, 9)), np.zeros(4)
    for tried in range(len(_PARTS) + len(_LAST)):
        begin, last = _begin(times, tried), tried >= len(_PARTS)
        if last and (not passed or begin == 0):
            continue
        if not last and best >= 0 and m - begin < _FEW:
            continue
        # a ball that was struck and has met a cushion since spins as before, more or less
        known = before if begin == 0 or last else unknown
        seen, places = times[begin:], positions[begin:]
        frames, touches = first_frames(seen), _may_touch(ball, planes, seen, places)
        # without a contact there is none that must be met with a known path, nor one to be made
        count = len(planes) if touches else 0
        one = _estimate(
            ball,
            planes[:count],
            laws[:count],
            noise,
            windows,
            spinning,
            known,
            crossed if begin == 0 else not_crossed(),
            seen,
            places,
            frames,
            frames if touches else len(seen),
            state,
            covariance,
        )
        doubted = best < 0 and one[3] > _DOUBTED
        goes_on = begin == 0 and crossed.time < math.inf
        told = m >= FEWEST or times[-1] - times[0] >= APART
        if doubted and (
            told if goes_on else _begins_near(ball, planes, seen, places, frames + FEWEST)
        ):
            # an impact may be in the frames of the first guess, or the blow was another
            again = _estimate(
                ball,
                planes,
                laws,
                noise,
                windows,
                spinning,
                known,
                not_crossed(),
                seen,
                places,
                frames if goes_on else FEWEST,
                frames if goes_on else FEWEST,
                other,
                other_covariance,
            )
            if again[3] < one[3]:
                one = again
                state[:] = other
                covariance[:] = other_covariance
        # half as good at most, since fewer frames are met more easily
        if one[3] < (0.5 * quality if best >= 0 else math.inf):
            best, quality = begin, one[3]
            on, loss, contacts, passed = one[0], one[1], one[2], one[4]
            state_out[:] = state
            covariance_out[:] = covariance
        if quality < _MET:
            break
    if best < 0:
        _line(times, positions, noise[0], state_out, covariance_out)
        best = max(m - FEWEST, 0)
    return on, loss, best, contacts
