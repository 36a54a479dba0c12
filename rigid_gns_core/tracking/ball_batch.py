# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of all balls of a window, each from its own last frames, in one call."""

from __future__ import annotations

import numpy as np

from .ball_window import APART, estimate_window, FEWEST
from .crossed_blows import blow_before, frames_of
from .jit import compiled, entry
from .kinks import find_kinks
from .pair_blow import not_crossed
from .spin_windows import SpinWindows
from .stamp_noise import with_stamp_noise
from .struck import last_near, motion_before, striker_of
from ..kernels.neighbours import Flags, Indices
from ..scenes.state import Array

# an estimate that must meet the frames is not farther from the last one [deviations]; it is
# doubted, not discarded, up to so many times the loss and this distance
_OFF, _DOUBTED = 6.0, 2.5
# a step so many times as fast as those before shows no blow
_WILD = 3.0


@compiled
def _fastest(times: Array, positions: Array, seen: Flags, begins: Indices, most: int) -> Flags:
    """Mask of the balls that moved fastest from the first to the last of their frames."""
    m, n = seen.shape
    taken = np.ones(n, dtype=np.bool_)
    if n <= most:
        return taken
    slowness = np.zeros(n)  # less the square of the speed
    for i in range(n):
        first = begins[i]
        while first < m and not seen[first, i]:
            first += 1
        last = m - 1
        while last > first and not seen[last, i]:
            last -= 1
        if last > first:
            for c in range(3):
                speed = positions[last, i, c] - positions[first, i, c]
                speed /= times[last] - times[first]
                slowness[i] -= speed * speed
    taken[np.argsort(slowness, kind='mergesort')[most:]] = False
    return taken


@compiled
def _is_wild(times: Array, positions: Array) -> bool:
    """Whether the last step is much faster than the three before."""
    m, last, before = len(times), 0.0, 0.0
    for k in range(max(m - 4, 1), m):
        speed = 0.0
        for c in range(3):
            speed += ((positions[k, c] - positions[k - 1, c]) / (times[k] - times[k - 1])) ** 2
        if k == m - 1:
            last = speed
        else:
            before = max(before, speed)
    return last > _WILD**2 * before


@compiled
def _without_lone(
    ball: Array,
    planes: Array,
    noise: float,
    count: int,
    fewest: int,
    times_out: Array,
    positions_out: Array,
    frames_out: Indices,
    kinks_out: Indices,
) -> tuple[int, int]:
    """Leave out the last of some frames, or the one before it, if a jump is of that one alone.

    A ball that was struck is off its former path in both. The last one is left out only if no blow
    makes a ball so fast: one that the scene does not know may be what it shows.

    Returns:
        Number of frames that are left, and the first after a jump; `count` and -1 if both are off.
    """
    short = count - 1
    if short < max(fewest, 4):
        return count, -1
    times, positions = times_out[:short].copy(), positions_out[:short].copy()
    # the one that stays is nearer to the line through the two frames before both
    off, step = np.zeros(2), times_out[count - 3] - times_out[count - 4]
    for k in range(2):
        ahead = (times_out[count - 2 + k] - times_out[count - 3]) / step
        for c in range(3):
            here, before = positions_out[count - 3, c], positions_out[count - 4, c]
            off[k] += (positions_out[count - 2 + k, c] - here - ahead * (here - before)) ** 2
    last = short if off[0] > off[1] else short - 1
    if last < short and not _is_wild(times_out[:count], positions_out[:count]):
        return count, -1
    times[-1], positions[-1] = times_out[last], positions_out[last]
    hits = find_kinks(ball, planes, times, positions, noise, kinks_out)
    first = kinks_out[hits - 1] if hits else 0
    if short - first < fewest:
        return count, -1
    times_out[:short], positions_out[:short] = times, positions
    frames_out[short - 1] = frames_out[last]
    return short, first


@compiled
def _farthest_off(ball: Array, state: Array, times: Array, positions: Array) -> float:
    """How far a state is off the last frame along an axis, or off the one before a wild one."""
    m, last, before = len(times), 0.0, 0.0
    back = times[m - 1] - times[m - 2]
    for c in range(3):
        last = max(last, abs(state[c] - positions[m - 1, c]))
        earlier = state[c] - back * (state[3 + c] - 0.5 * back * ball[0, c])
        before = max(before, abs(earlier - positions[m - 2, c]))
    return before if _is_wild(times, positions) else last


@entry
def estimate_balls(
    balls: Array,
    planes: Array,
    laws: Array,
    pairs: Array,
    noise: Array,
    windows: SpinWindows,
    times: Array,
    positions: Array,
    seen: Flags,
    begin: int,
    fewest: int,
    worst: float,
    learned: bool,
    most: int,
    states_out: Array,
    covariances_out: Array,
    ends_out: Indices,
) -> None:
    """Estimate the state of each ball at the last frame that shows it.

    Frames count after the last that may hold what the laws do not know: another ball near by, or a
    jump that no surface explains, but of a single frame.

    Args:
        balls: Rows of `ball_path`, shape (n, 16).
        planes: See there, shape (planes, 14).
        laws: Of each ball, shape (n, planes, 8).
        pairs: Of two balls, see `pair_blow.PAIR`, shape (n, n, PAIR).
        noise: s, q, kappa of `model_error`.
        windows: Prior of spins.
        times: Rising times [s], shape (m,).
        positions: Centres [m], shape (m, n, 3); any number where a ball is not seen.
        seen: Whether it is, shape (m, n).
        begin: First frame of the memory.
        fewest: Least number of frames of an estimate, 4 or more.
        worst: Loss per coordinate of an estimate that meets the frames; infinite: any does.
        learned: Whether the noise was; if not, that of stamps comes to it.
        most: Of more balls the fastest are estimated.
        states_out: States, shape (n, 9).
        covariances_out: Their covariances, shape (n, 9, 9).
        ends_out: Frame of the state, surface that the ball is on or FREE, and whether the frames
            are met, shape (n, 3); the first is -1 where there is no estimate.
    """
    m, n = seen.shape
    near, met = np.zeros(n, dtype=np.int64), np.zeros((n, 2), dtype=np.int64)
    last_near(positions, seen, balls[:, 7], begin, near, met)
    taken = _fastest(times, positions, seen, near, most)
    own_times, places, own_noise = np.zeros(m), np.zeros((m, 3)), noise.copy()
    kinks, frames, before = np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64), np.zeros(4)
    state, covariance = np.zeros(9), np.zeros((9, 9))
    for i in range(n):
        ends_out[i, 0] = -1
        if not taken[i]:
            continue
        start, crossed = near[i], not_crossed()
        # the newest frame of an approach may be after the blow
        for back in range(2 if learned and met[i, 1] >= 0 else 0):
            if crossed.time < np.inf:
                break
            crossed = blow_before(
                balls, planes, laws, pairs, noise, windows, times, positions, seen, begin,
                i, met[i, 1], met[i, 0] - back, times[m - 1],
            )  # fmt: skip
            since = int(np.searchsorted(times, crossed.time))
            if seen[since:, i].any():
                start = since
            else:
                crossed = not_crossed()
        count = frames_of(times, positions, seen, i, start, own_times, places, frames)
        last = frames[count - 1] if count else -1
        goes_on = crossed.time < np.inf
        if count < fewest and not goes_on and not (learned and count >= 2):
            continue
        ball = balls[i : i + 1]
        if not learned:
            own_noise[0] = with_stamp_noise(own_times[:count], places[:count], noise[0])
        hits = find_kinks(ball, planes, own_times[:count], places[:count], own_noise[0], kinks)
        jump = first = kinks[hits - 1] if hits else 0
        if count - first < fewest:
            count, first = _without_lone(
                ball, planes, own_noise[0], count, fewest, own_times, places, frames, kinks
            )
            last = frames[count - 1]
        if first < 0:
            if goes_on or (learned and count - jump >= 2):
                first = jump
            elif worst == np.inf:
                continue
            else:
                # a jump may be of stamps that jitter; if not, the newest frames are missed
                first = 0
        own_frames = frames[first:count]
        before[:] = 0.0
        if first > 0:  # there was another blow since
            crossed = not_crossed()
        if len(own_frames) > 1:
            other = striker_of(times, positions, seen, balls[:, 7], i, own_frames)
            motion_before(times, positions, seen, balls[:, 7], i, other, own_frames, before)
            if learned and other >= 0 and own_frames[0] > begin and crossed.time == np.inf:
                crossed = blow_before(
                    balls, planes, laws, pairs, noise, windows, times, positions, seen, begin,
                    i, other, own_frames[0], times[own_frames[0]],
                )  # fmt: skip
        told = len(own_frames) >= FEWEST
        told = told or times[own_frames[-1]] - times[own_frames[0]] >= APART
        if not told and crossed.time == np.inf:
            continue
        ends_out[i, 1], loss, _, _ = estimate_window(
            ball,
            planes,
            laws[i],
            own_noise,
            windows,
            True,
            before,
            crossed,
            own_times[first:count],
            places[first:count],
            state,
            covariance,
        )
        off = _farthest_off(ball, state, own_times[:count], places[:count])
        off /= _OFF * own_noise[0]
        missed = 0.0 if worst == np.inf else max(loss / worst, off)
        if not (loss < np.inf and missed < _DOUBTED):
            continue
        ends_out[i, 0], ends_out[i, 2] = last, missed < 1.0
        states_out[i] = state
        covariances_out[i] = covariance
