# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blows of two tracked balls, crossed by the estimates of both from their frames before."""

from __future__ import annotations

import numpy as np

from .ball_window import estimate_window, FEWEST
from .jit import compiled, in_place
from .kinks import find_kinks
from .pair_blow import cross_blow, Crossed, not_crossed
from .spin_windows import SpinWindows
from .struck import last_near, NEAR
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import length, minus, row
from ..scenes.state import Array

# frames before a blow are no older [s], and their paths are met to this loss per coordinate
_UNSEEN, _MET = 0.15, 4.0
# so many frames tell whether there was a blow
_TELL = 4


@in_place
def _is_nearer(
    times: Array, places: Array, seen: Flags, time: float, mean: Array, last: float, state: Array
) -> bool:
    """Whether the first frames after a blow are nearer to the motion after it than before it."""
    hit, missed, left = 0.0, 0.0, _TELL
    for frame in range(len(times)):
        if times[frame] < time or not seen[frame] or left == 0:
            continue
        left -= 1
        for c in range(3):
            after = mean[c] + (times[frame] - time) * mean[3 + c]
            before = state[c] + (times[frame] - last) * state[3 + c]
            hit += (places[frame, c] - after) ** 2
            missed += (places[frame, c] - before) ** 2
    return hit < missed


@compiled
def frames_of(
    times: Array,
    positions: Array,
    seen: Flags,
    ball: int,
    first: int,
    times_out: Array,
    places_out: Array,
    frames_out: Indices,
) -> int:
    """Frames from `first` on that show a ball: times, places and numbers; how many there are."""
    count = 0
    for frame in range(first, len(times)):
        if seen[frame, ball]:
            times_out[count], places_out[count] = times[frame], positions[frame, ball]
            frames_out[count] = frame
            count += 1
    return count


@compiled
def blow_before(
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
    ball: int,
    other: int,
    first: int,
    until: float,
) -> Crossed:
    """State of a ball just after another struck it, by the frames of both before.

    Args:
        balls: As of `estimate_balls`, as the next nine.
        planes: See there.
        laws: See there.
        pairs: See there.
        noise: See there.
        windows: See there.
        times: See there.
        positions: See there.
        seen: See there.
        begin: See there.
        ball: Number of the ball.
        other: That of the other.
        first: First frame after the ball was near the other.
        until: Time before which they have met [s].
    """
    enter, reach = first - 1, NEAR * (balls[ball, 7] + balls[other, 7])
    while enter > begin:
        apart = minus(row(positions[enter], other), row(positions[enter], ball))
        if seen[enter, other] and seen[enter, ball] and length(apart) >= reach:
            break
        enter -= 1
    near, met = np.zeros(len(balls), dtype=np.int64), np.zeros((len(balls), 2), dtype=np.int64)
    m = enter + 1
    last_near(positions[:m], seen[:m], balls[:, 7], begin, near, met)
    states, covariances, lasts = np.zeros((2, 9)), np.zeros((2, 9, 9)), np.zeros(2)
    on, kinks = np.zeros(2, dtype=np.int64), np.zeros(m, dtype=np.int64)
    own_times, places, frames = np.zeros(m), np.zeros((m, 3)), np.zeros(m, dtype=np.int64)
    rows, own_laws = np.zeros((2, balls.shape[1])), np.zeros((2, laws.shape[1], laws.shape[2]))
    for k in range(2):
        i = ball if k == 0 else other
        count = frames_of(times[:m], positions, seen, i, near[i], own_times, places, frames)
        if count < FEWEST or until - own_times[count - 1] > _UNSEEN:
            return not_crossed()
        rows[k], own_laws[k] = balls[i], laws[i]
        one = rows[k : k + 1]
        hits = find_kinks(one, planes, own_times[:count], places[:count], noise[0], kinks)
        start = kinks[hits - 1] if hits else 0
        if count - start < FEWEST:
            return not_crossed()
        on[k], loss, _, _ = estimate_window(
            one, planes, own_laws[k], noise, windows, True, np.zeros(4), not_crossed(),
            own_times[start:count], places[start:count], states[k], covariances[k],
        )  # fmt: skip
        if not loss < _MET:
            return not_crossed()
        lasts[k] = own_times[count - 1]
    mean, covariance = np.zeros(9), np.zeros((9, 9))
    law = pairs[ball][other : other + 1]
    time = cross_blow(
        rows, planes, own_laws, law, states, covariances, on, lasts, until, mean, covariance
    )
    if time == np.inf or not _is_nearer(
        times, positions[:, ball], seen[:, ball], time, mean, lasts[0], states[0]
    ):
        return not_crossed()
    return Crossed(time, mean, covariance)
