# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Normal equations of one window over its start and the laws' shared parameters."""

from __future__ import annotations

import numpy as np

from .ball_fit import huber_loss
from .ball_path import path
from .jit import entry
from .model_error import filter_gains, GAINS, whiten
from .path_slopes import path_and_slopes
from ..scenes.state import Array


@entry
def normal_equations(
    start: Array,
    varied: Array,
    begin: float,
    stamps: Array,
    observed: Array,
    ball: Array,
    planes: Array,
    laws: Array,
    on: int,
    noise: Array,
    weights: Array,
    moved_balls: Array,
    moved_planes: Array,
    moved_laws: Array,
    steps: Array,
    matrix_out: Array,
    vector_out: Array,
) -> tuple[float, float]:
    """Linearise the whitened residuals about a start and T parameters.

    What comes before `moved_balls` is as of `ball_fit.fit_start`. The `moved_` arrays are `ball`,
    `planes` and `laws` with each of the parameters moved by `steps`, T along their first axis.
    `matrix_out` is J^T W J, shape (9 + T, 9 + T), and `vector_out` J^T W r, shape (9 + T,), with r
    observed less path and W the weights of Huber's loss.

    Returns:
        Huber's loss, and the sum of the logarithms of the innovations' variances.
    """
    m, count_moved = len(stamps), len(steps)
    total = 9 + count_moved
    states, slopes = np.zeros((m, 9)), np.zeros((m, 9, 9))
    contacts, gains = np.zeros((32, 3)), np.zeros((m, GAINS))
    other_contacts = np.zeros((32, 3))
    residuals, huber = np.zeros((m, 3)), np.zeros(m)
    # of each axis: slopes over start and parameters, and the residual
    columns = np.zeros((m, 3 * (total + 1)))
    drift, speed = np.zeros(3 * (total + 1)), np.zeros(3 * (total + 1))
    count, _ = path_and_slopes(
        start, varied, begin, stamps, ball, planes, laws, on, states, slopes, contacts
    )
    log = filter_gains(begin, stamps, weights, noise, contacts, count, gains)
    for i in range(m):
        for a in range(3):
            first = a * (total + 1)
            for j in range(9):
                columns[i, first + j] = slopes[i, a, j]
            columns[i, first + total] = observed[i, a] - states[i, a]
    moved_states = np.zeros((m, 9))
    for k in range(count_moved):
        path(
            start,
            begin,
            stamps,
            moved_balls[k],
            moved_planes[k],
            moved_laws[k],
            on,
            moved_states,
            other_contacts,
        )
        for i in range(m):
            for a in range(3):
                change = moved_states[i, a] - states[i, a]
                columns[i, a * (total + 1) + 9 + k] = change / steps[k]
    whiten(begin, stamps, gains, columns, drift, speed)
    for i in range(m):
        for a in range(3):
            residuals[i, a] = columns[i, a * (total + 1) + total]
    loss = huber_loss(residuals, m, huber)
    matrix_out[:] = 0.0
    vector_out[:] = 0.0
    for i in range(m):
        for a in range(3):
            first = a * (total + 1)
            for j in range(total):
                factor = huber[i] * columns[i, first + j]
                vector_out[j] += factor * columns[i, first + total]
                for k in range(total):
                    matrix_out[j, k] += factor * columns[i, first + k]
    return loss, 3.0 * log
