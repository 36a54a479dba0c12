# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Normal equations of one window over its start and the laws' shared parameters."""

from __future__ import annotations

import numpy as np

from .ball_fit import huber_loss
from .ball_path import path, path_and_slopes
from .jit import entry
from .model_error import filter_gains, GAINS, whiten
from ..scenes.state import Array


@entry
def normal_equations(
    start: Array,
    moves: Array,
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
    states, slopes = np.zeros((m, 9)), np.zeros((9, m, 9))
    contacts, gains = np.zeros((32, 3)), np.zeros((m, GAINS))
    other_contacts = np.zeros((32, 3))
    residuals, work, huber = np.zeros((m, 3)), np.zeros(m), np.zeros(m)
    jacobian = np.zeros((total, m, 3))
    count, _ = path_and_slopes(
        start, moves, begin, stamps, ball, planes, laws, on, states, slopes, contacts
    )
    log = filter_gains(begin, stamps, weights, noise, contacts, count, gains)
    for j in range(9):
        for i in range(m):
            for axis in range(3):
                jacobian[j, i, axis] = slopes[j, i, axis]
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
            for axis in range(3):
                change = moved_states[i, axis] - states[i, axis]
                jacobian[9 + k, i, axis] = change / steps[k]
    for axis in range(3):
        for i in range(m):
            work[i] = observed[i, axis] - states[i, axis]
        whiten(begin, stamps, gains, work)
        for i in range(m):
            residuals[i, axis] = work[i]
        for j in range(total):
            for i in range(m):
                work[i] = jacobian[j, i, axis]
            whiten(begin, stamps, gains, work)
            for i in range(m):
                jacobian[j, i, axis] = work[i]
    loss = huber_loss(residuals, m, huber)
    for j in range(total):
        product = 0.0
        for i in range(m):
            for axis in range(3):
                product += huber[i] * jacobian[j, i, axis] * residuals[i, axis]
        vector_out[j] = product
        for k in range(j + 1):
            product = 0.0
            for i in range(m):
                for axis in range(3):
                    product += huber[i] * jacobian[j, i, axis] * jacobian[k, i, axis]
            matrix_out[j, k] = matrix_out[k, j] = product
    return loss, 3.0 * log
