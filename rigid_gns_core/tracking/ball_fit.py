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

from .ball_path import path, path_and_slopes
from .jit import compiled, entry, in_place
from .model_error import filter_gains, GAINS, whiten
from ..scenes.state import Array

# Huber's loss is linear beyond this [deviations of a coordinate]
_LINEAR = 3.0
# trials of a step, each with so much more damping
_TRIES, _MORE_DAMPING = 5, 30.0
# a step smaller than this ends the search [deviations of the posterior]
_SMALL = 1e-2


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
def _whitened(
    begin: float,
    stamps: Array,
    observed: Array,
    states: Array,
    gains: Array,
    work: Array,
    residuals_out: Array,
    drift_out: Array,
) -> None:
    """Whitened residuals, observed less path, shape (m, 3); drift and its speed at the end."""
    m = len(stamps)
    for axis in range(3):
        for i in range(m):
            work[i] = observed[i, axis] - states[i, axis]
        drift_out[axis], drift_out[3 + axis] = whiten(begin, stamps, gains, work[:m])
        for i in range(m):
            residuals_out[i, axis] = work[i]


@entry
def fit_start(
    start: Array,
    prior_mean: Array,
    prior_precision: Array,
    moves: Array,
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
        moves: Steps of the slopes' differences, shape (9,); 0 fixes a part of the start.
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
        Loss per coordinate, number of impacts, and the plane that the ball is on at the end.
    """
    m = len(stamps)
    states, slopes = np.zeros((m, 9)), np.zeros((9, m, 9))
    gains, residuals = np.zeros((m, GAINS)), np.zeros((m, 3))
    jacobian = np.zeros((9, m, 3))
    ends, drift, trial_drift = np.zeros((9, 6)), np.zeros(6), np.zeros(6)
    work, huber = np.zeros(m), np.zeros(m)
    gradient, system = np.zeros(9), np.zeros((9, 9))
    trial, trial_states = start.copy(), np.zeros((m, 9))
    trial_contacts = np.zeros_like(contacts_out)
    count, where, loss, dropped = 0, on, 0.0, False
    n = min(max(first, 4), m)
    while True:
        last = n == m
        seen, places = stamps[:n], observed[:n]
        damping = 1e-4
        for _ in range(iterations if last else 3):
            count, where = path_and_slopes(
                start,
                moves,
                begin,
                seen,
                ball,
                planes,
                laws,
                on,
                states[:n],
                slopes[:, :n],
                contacts_out,
            )
            filter_gains(begin, seen, weights, noise, contacts_out, count, gains)
            _whitened(begin, seen, places, states, gains, work, residuals, drift)
            loss = huber_loss(residuals, n, huber) + _prior_loss(
                start, prior_mean, prior_precision
            )
            for j in range(9):
                for axis in range(3):
                    for i in range(n):
                        work[i] = slopes[j, i, axis]
                    ends[j, axis], ends[j, 3 + axis] = whiten(begin, seen, gains, work[:n])
                    for i in range(n):
                        jacobian[j, i, axis] = work[i]
            for j in range(9):
                total = 0.0
                for i in range(n):
                    for axis in range(3):
                        total += huber[i] * jacobian[j, i, axis] * residuals[i, axis]
                for k in range(9):
                    total -= prior_precision[j, k] * (start[k] - prior_mean[k])
                gradient[j] = total
                for k in range(j + 1):
                    total = prior_precision[j, k]
                    for i in range(n):
                        for axis in range(3):
                            total += huber[i] * jacobian[j, i, axis] * jacobian[k, i, axis]
                    information_out[j, k] = information_out[k, j] = total
            better, size, after = False, 0.0, loss
            for _tries in range(_TRIES):
                system[:] = information_out
                for j in range(9):
                    system[j, j] *= 1.0 + damping
                step = np.linalg.solve(system, gradient)
                size = 0.0
                for j in range(9):
                    trial[j] = start[j] + step[j]
                    size = max(size, abs(step[j]) * math.sqrt(information_out[j, j]))
                path(trial, begin, seen, ball, planes, laws, on, trial_states, trial_contacts)
                _whitened(begin, seen, places, trial_states, gains, work, residuals, trial_drift)
                after = huber_loss(residuals, n, huber)
                after += _prior_loss(trial, prior_mean, prior_precision)
                if after <= loss:
                    better = True
                    break
                damping *= _MORE_DAMPING
                if size < _SMALL:
                    break
            if better:
                start[:] = trial
                damping = max(0.1 * damping, 1e-9)
                loss = after
            if not better or size < _SMALL:
                break
        if not last:
            n = min(max(int(growth * n), n + 3), m)
            continue
        # the last linearisation holds for the end: it was at most a small step before it
        count, where = path_and_slopes(
            start, moves, begin, stamps, ball, planes, laws, on, states, slopes, contacts_out
        )
        filter_gains(begin, stamps, weights, noise, contacts_out, count, gains)
        _whitened(begin, stamps, observed, states, gains, work, residuals, drift)
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
    _end_of(states, slopes, gains, drift, ends, information_out, end_out, end_covariance_out)
    return loss / (3 * m), count, where


@compiled
def _end_of(
    states: Array,
    slopes: Array,
    gains: Array,
    drift: Array,
    ends: Array,
    information: Array,
    end_out: Array,
    covariance_out: Array,
) -> None:
    """State at the end and its covariance, of the start's and the drift's."""
    m = len(states)
    for c in range(9):
        end_out[c] = states[m - 1, c] + (drift[c] if c < 6 else 0.0)
    # the end moves with the start by its slope less what the drift would take up
    for j in range(9):
        for c in range(6):
            slopes[j, m - 1, c] -= ends[j, c]
    covariance = np.linalg.inv(information)
    for a in range(9):
        for b in range(9):
            total = 0.0
            for j in range(9):
                for k in range(9):
                    total += slopes[j, m - 1, a] * covariance[j, k] * slopes[k, m - 1, b]
            covariance_out[a, b] = total
    for axis in range(3):
        covariance_out[axis, axis] += gains[m - 1, 3]
        covariance_out[axis, 3 + axis] += gains[m - 1, 4]
        covariance_out[3 + axis, axis] += gains[m - 1, 4]
        covariance_out[3 + axis, 3 + axis] += gains[m - 1, 5]
