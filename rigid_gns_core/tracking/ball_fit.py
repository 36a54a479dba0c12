# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Most probable start of a ball in a window of frames, through its contacts.

Levenberg-Marquardt steps on the whitened residuals (`model_error`) and a Gaussian prior of the
start. The window grows from its first frames, so that each contact is met with a known path. Loss
is Huber's, per frame; frames that stay far off are dropped at the end.
"""

from __future__ import annotations

import math

import numpy as np

from .ball_contact import FREE
from .ball_path import path
from .jit import compiled, entry, in_place
from .model_error import filter_gains, GAINS, whiten
from .path_slopes import path_and_slopes
from ..scenes.state import Array

# Huber's loss is linear beyond this [deviations of a coordinate]
_LINEAR = 3.0
# trials of a step, each with so much more damping
_TRIES, _MORE_DAMPING = 5, 30.0
# a step smaller than this ends the search [deviations of the posterior]; of a window that grows
_SMALL, _SMALL_FIRST = 1e-2, 0.3
# a fit is given up where its loss per coordinate would stay above this
_HOPELESS = 8.0


@in_place
def huber_loss(residuals: Array, count: int, slope_out: Array) -> float:
    """Huber's loss of whitened residuals, shape (m, 3), and the weight of each frame."""
    total = 0.0
    for i in range(count):
        square = residuals[i, 0] ** 2 + residuals[i, 1] ** 2 + residuals[i, 2] ** 2
        size = math.sqrt(square / 3.0)
        slope_out[i] = 1.0
        if size > _LINEAR:
            slope_out[i] = _LINEAR / size
            square = 3.0 * _LINEAR * (2.0 * size - _LINEAR)
        total += square
    return total


@in_place
def _prior_loss(start: Array, mean: Array, precision: Array) -> float:
    total = 0.0
    for j in range(9):
        for k in range(9):
            total += (start[j] - mean[j]) * precision[j, k] * (start[k] - mean[k])
    return total


@in_place
def put_columns(slopes: Array, observed: Array, states: Array, columns_out: Array) -> None:
    """Slopes over the start and residual of each axis side by side, shape (m, 30).

    Column 10 a + j is of axis a and part j of the start, 10 a + 9 its residual.
    """
    for i in range(len(states)):
        for a in range(3):
            for j in range(9):
                columns_out[i, 10 * a + j] = slopes[i, a, j]
            columns_out[i, 10 * a + 9] = observed[i, a] - states[i, a]


@in_place
def add_products(columns: Array, weights: Array, matrix_out: Array, vector_out: Array) -> None:
    """Add J^T W J and J^T W r of columns as of `put_columns`, whitened."""
    for i in range(len(columns)):
        for j in range(9):
            x, y = weights[i] * columns[i, j], weights[i] * columns[i, 10 + j]
            z = weights[i] * columns[i, 20 + j]
            vector_out[j] += x * columns[i, 9] + y * columns[i, 19] + z * columns[i, 29]
            for k in range(9):
                part = x * columns[i, k] + y * columns[i, 10 + k] + z * columns[i, 20 + k]
                matrix_out[j, k] += part


@compiled
def _is_hopeless(
    loss: float, gradient: Array, information: Array, huber: Array, gate: float
) -> bool:
    """Whether too many frames are off to be dropped, and the next step will not meet them.

    A Gauss-Newton step lessens the loss by g^T A^-1 g, as far as the residuals are linear.
    """
    far = 0
    for i in range(len(huber)):
        if huber[i] * gate < _LINEAR:
            far += 1
    if far <= len(huber) // 5:
        return False
    step, least = np.linalg.solve(information, gradient), loss
    for j in range(len(step)):
        least -= gradient[j] * step[j]
    return least > _HOPELESS * 3.0 * len(huber)


@entry
def fit_start(
    start: Array,
    prior_mean: Array,
    prior_precision: Array,
    varied: Array,
    begin: float,
    stamps: Array,
    observed: Array,
    ball: Array,
    planes: Array,
    laws: Array,
    on: int,
    noise: Array,
    first: int,
    growth: float,
    iterations: int,
    gate: float,
    weights: Array,
    information_out: Array,
    end_out: Array,
    end_covariance_out: Array,
    contacts_out: Array,
) -> tuple[float, int, int]:
    """Fit a start, in place, to a window; see the module.

    Args:
        start: Position, velocity, spin at `begin`, shape (9,); overwritten by the fit.
        prior_mean: Mean of the start beforehand, shape (9,).
        prior_precision: Its inverse covariance, shape (9, 9).
        varied: Parts of the start that are fitted, shape (9,); 0: held.
        begin: Time of the start [s].
        stamps: Times of the frames [s], shape (m,).
        observed: Centres [m], shape (m, 3).
        ball: As `path` takes it, as the next three.
        planes: See there.
        laws: See there.
        on: See there.
        noise: See `model_error.NOISE`.
        first: Frames of the first fit; m: the window does not grow.
        growth: Factor by which it grows.
        iterations: Most steps of the last fit.
        gate: Frames farther off than this are dropped, and the rest fitted once more
            [deviations of a coordinate]; infinite: none.
        weights: Of the frames, shape (m,); those dropped are set to 0.
        information_out: Inverse covariance of the start, shape (9, 9).
        end_out: State at the last stamp, drift included, shape (9,).
        end_covariance_out: Its covariance, shape (9, 9).
        contacts_out: Impacts, as of `path`.

    Returns:
        Loss per coordinate, number of impacts, and the plane that the ball is on at the end. With
        a gate, the loss of a path with more impacts than are kept is infinite: no such is fitted.
    """
    m = len(stamps)
    states, slopes = np.zeros((m, 9)), np.zeros((m, 9, 9))
    gains, residuals, columns = np.zeros((m, GAINS)), np.zeros((m, 3)), np.zeros((m, 30))
    drift, speed = np.zeros(30), np.zeros(30)
    drift_off, speed_off = np.zeros(3), np.zeros(3)
    huber, gradient, system = np.zeros(m), np.zeros(9), np.zeros((9, 9))
    trial, contacts = start.copy(), np.zeros_like(contacts_out)
    # of the path from a trial. In flight it has slopes and is the next one, where it is taken; on
    # a surface slopes cost more than a path, and trials often fail
    other_states, other_slopes = np.zeros((m, 9)), np.zeros((m, 9, 9))
    other_contacts = np.zeros_like(contacts_out)
    count, where, loss, dropped, stale = 0, on, 0.0, False, True
    n = min(max(first, 4), m)
    while True:
        last = n == m
        seen, places = stamps[:n], observed[:n]
        damping, small = 1e-4, _SMALL if last else _SMALL_FIRST
        for left in range(iterations if last else 3, 0, -1):
            if stale:
                count, where = path_and_slopes(
                    start,
                    varied,
                    begin,
                    seen,
                    ball,
                    planes,
                    laws,
                    on,
                    states[:n],
                    slopes[:n],
                    contacts,
                )
                stale = False
            if count > len(contacts) and gate < math.inf:
                return math.inf, count, where
            filter_gains(begin, seen, weights, noise, contacts, count, gains)
            put_columns(slopes[:n], places, states[:n], columns)
            whiten(begin, seen, gains, columns[:n], drift, speed)
            for i in range(n):
                for a in range(3):
                    residuals[i, a] = columns[i, 10 * a + 9]
            loss = huber_loss(residuals, n, huber) + _prior_loss(
                start, prior_mean, prior_precision
            )
            information_out[:] = prior_precision
            gradient[:] = 0.0
            for j in range(9):
                for k in range(9):
                    gradient[j] -= prior_precision[j, k] * (start[k] - prior_mean[k])
            add_products(columns[:n], huber, information_out, gradient)
            better, size, after = False, 0.0, loss
            flies = on == FREE and where == FREE
            # by the third step what flies is nearly linear
            third = last and flies and left <= iterations - 2
            if third and _is_hopeless(loss, gradient, information_out, huber[:n], gate):
                break
            for _tries in range(_TRIES):
                system[:] = information_out
                for j in range(9):
                    system[j, j] *= 1.0 + damping
                step = np.linalg.solve(system, gradient)
                size = 0.0
                for j in range(9):
                    trial[j] = start[j] + step[j]
                    size = max(size, abs(step[j]) * math.sqrt(information_out[j, j]))
                if flies:
                    others, place = path_and_slopes(
                        trial,
                        varied,
                        begin,
                        seen,
                        ball,
                        planes,
                        laws,
                        on,
                        other_states[:n],
                        other_slopes[:n],
                        other_contacts,
                    )
                else:
                    others, place = path(
                        trial, begin, seen, ball, planes, laws, on, other_states, other_contacts
                    )
                for i in range(n):
                    for a in range(3):
                        residuals[i, a] = places[i, a] - other_states[i, a]
                whiten(begin, seen, gains, residuals[:n], drift_off, speed_off)
                after = huber_loss(residuals, n, huber)
                after += _prior_loss(trial, prior_mean, prior_precision)
                if after <= loss:
                    better, stale, count, where = True, not flies, others, place
                    states, other_states = other_states, states
                    slopes, other_slopes = other_slopes, slopes
                    contacts, other_contacts = other_contacts, contacts
                    break
                damping *= _MORE_DAMPING
                if size < small:
                    break
            if better:
                start[:] = trial
                damping = max(0.1 * damping, 1e-9)
                loss = after
            if not better or size < small:
                break
        if not last:
            n, stale = min(max(int(growth * n), n + 3), m), True
            continue
        # the last linearisation holds for the end: it was at most a small step before it
        if stale:
            count, where = path_and_slopes(
                start, varied, begin, stamps, ball, planes, laws, on, states, slopes, contacts
            )
            stale = False
        filter_gains(begin, stamps, weights, noise, contacts, count, gains)
        put_columns(slopes, observed, states, columns)
        whiten(begin, stamps, gains, columns, drift, speed)
        for i in range(m):
            for a in range(3):
                residuals[i, a] = columns[i, 10 * a + 9]
        loss = huber_loss(residuals, m, huber)
        far = 0
        for i in range(m):
            square = residuals[i, 0] ** 2 + residuals[i, 1] ** 2 + residuals[i, 2] ** 2
            if weights[i] > 0.0 and square > 3.0 * gate * gate:
                far += 1
        if dropped or far == 0 or far > m // 5:
            break
        dropped = True
        for i in range(m):
            square = residuals[i, 0] ** 2 + residuals[i, 1] ** 2 + residuals[i, 2] ** 2
            if square > 3.0 * gate * gate:
                weights[i] = 0.0
    contacts_out[:] = contacts
    _end_of(states[m - 1], slopes[m - 1], drift, speed, end_out)
    _end_covariance(slopes[m - 1], gains[m - 1], information_out, end_covariance_out)
    return loss / (3 * m), count, where


@in_place
def _end_of(state: Array, slopes: Array, drift: Array, speed: Array, end_out: Array) -> None:
    """State at the end, drift included; `slopes` become those of it.

    The end moves with the start by its slope less what the drift would take up.
    """
    for c in range(9):
        end_out[c] = state[c]
    for a in range(3):
        end_out[a] += drift[10 * a + 9]
        end_out[3 + a] += speed[10 * a + 9]
        for j in range(9):
            slopes[a, j] -= drift[10 * a + j]
            slopes[3 + a, j] -= speed[10 * a + j]


@compiled
def _end_covariance(
    slopes: Array, gains: Array, information: Array, covariance_out: Array
) -> None:
    """Covariance of the end by that of the start, and the drift's."""
    carried = slopes @ np.linalg.inv(information)
    for a in range(9):
        for b in range(9):
            covariance_out[a, b] = 0.0
            for j in range(9):
                covariance_out[a, b] += carried[a, j] * slopes[b, j]
    for axis in range(3):
        covariance_out[axis, axis] += gains[3]
        covariance_out[axis, 3 + axis] += gains[4]
        covariance_out[3 + axis, axis] += gains[4]
        covariance_out[3 + axis, 3 + axis] += gains[5]
