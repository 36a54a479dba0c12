# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Prior of a window that begins just after a blow of another ball."""

from __future__ import annotations

import numpy as np

from .ball_contact import FREE
from .ball_path import start_of
from .jit import compiled, in_place
from .pair_blow import Crossed
from ..scenes.state import Array


@in_place
def keep_spin(
    ball: Array, plane: Array, guess: Array, before: Array, mean: Array, precision: Array
) -> None:
    """Prior of the spin along a surface of a ball that had that of rolling before a blow.

    Told as what comes to that of rolling now: n x (v_before - v) / r.
    """
    radius, about = ball[0, 7], 0.0
    for a in range(3):
        for k in range(3):
            about += plane[9 + a] * precision[6 + a, 6 + k] * plane[9 + k]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        slip = plane[9 + b] * (before[c] - guess[3 + c])
        slip -= plane[9 + c] * (before[b] - guess[3 + b])
        mean[6 + a] = slip / radius
        for k in range(3):
            across = plane[9 + a] * plane[9 + k]
            along = (1.0 if a == k else 0.0) - across
            precision[6 + a, 6 + k] = along * (radius / before[3]) ** 2 + across * about


@compiled
def go_on(
    ball: Array, planes: Array, on: int, crossed: Crossed, mean: Array, precision: Array
) -> None:
    """Prior of a path that begins with a blow; that of its start on a surface is kept beside it.

    Args:
        ball: As `path` takes it, as the next.
        planes: See there.
        on: Surface that the ball is on, or FREE.
        crossed: State just after the blow.
        mean: Of the prior that is known of the place of a surface; overwritten.
        precision: See there.
    """
    start, change = np.zeros(9), np.zeros((9, 9))
    start_of(crossed.mean, planes, on, ball[0, 7], start, change)
    found = np.linalg.inv(change @ crossed.covariance @ change.T)
    if on != FREE:
        off = away = 0.0
        for c in range(3):
            off += planes[on, 9 + c] * (start[c] - mean[c])
            away += planes[on, 9 + c] * start[3 + c]
        for c in range(3):
            start[c] -= off * planes[on, 9 + c]
            start[3 + c] -= away * planes[on, 9 + c]
    precision[6:, :] = 0.0
    precision += found
    mean[:] = start
