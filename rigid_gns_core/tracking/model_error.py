# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the laws do not know of a path, as a random motion beside it.

A tracker sees, on each axis, y_i = path(t_i) + d(t_i) + e_i, with white noise e of deviation s and
a drift d that is the double integral of white acceleration of spectral density q [m^2/s^3], plus a
kick of its velocity of deviation kappa u_n at an impact with approach speed u_n. So residuals are
correlated in time as those of real tracks are. A Kalman filter of (d, d') whitens them: its
innovations over their deviations are independent and of unit variance.
"""

from __future__ import annotations

import math

from .jit import in_place
from ..scenes.state import Array

# columns of `gains`: of d and d', innovation's deviation, and the covariance after the frame
GAINS = 6
NOISE = ('position', 'drift', 'impact')  # s [m], q [m^2/s^3], kappa


@in_place
def filter_gains(
    begin: float,
    stamps: Array,
    weights: Array,
    noise: Array,
    contacts: Array,
    count: int,
    gains_out: Array,
) -> float:
    """Gains of the filter at each stamp, the same for all axes.

    Args:
        begin: Time at which the drift begins [s].
        stamps: Times [s], shape (m,).
        weights: Of the frames, shape (m,): the noise's variance is s^2 over it; 0: not seen.
        noise: s, q, kappa, see `NOISE`.
        contacts: Time, plane and approach speed of the impacts, shape (most, 3).
        count: Number of impacts.
        gains_out: See `GAINS`, shape (m, 6).

    Returns:
        Sum of the logarithms of the innovations' variances, of one axis.
    """
    dd, dv, vv = 0.0, 0.0, 0.0
    now, k, total = begin, 0, 0.0
    for i in range(len(stamps)):
        while True:
            impact = k < min(count, len(contacts)) and contacts[k, 0] <= stamps[i]
            until = max(contacts[k, 0], now) if impact else stamps[i]
            h = until - now
            dd += h * (2.0 * dv + h * vv) + noise[1] * h * h * h / 3.0
            dv += h * vv + 0.5 * noise[1] * h * h
            vv += noise[1] * h
            now = until
            if not impact:
                break
            vv += (noise[2] * contacts[k, 2]) ** 2
            k += 1
        gains_out[i, 0] = gains_out[i, 1] = 0.0
        gains_out[i, 2] = math.inf
        if weights[i] > 0.0:
            variance = dd + noise[0] * noise[0] / weights[i]
            first, second = dd / variance, dv / variance
            gains_out[i, 0], gains_out[i, 1] = first, second
            gains_out[i, 2] = math.sqrt(variance)
            total += math.log(variance)
            vv -= second * dv
            dv -= first * dv
            dd -= first * dd
        gains_out[i, 3], gains_out[i, 4], gains_out[i, 5] = dd, dv, vv
    return total


@in_place
def whiten(
    begin: float, stamps: Array, gains: Array, values: Array, drift_out: Array, speed_out: Array
) -> None:
    """Whiten columns in place, each a residual or a slope of one axis.

    Args:
        begin: As of `filter_gains`, as the next two.
        stamps: See there.
        gains: See there.
        values: Columns, shape (m, columns).
        drift_out: d of the filter at the end, shape (columns,).
        speed_out: d' there, shape (columns,).
    """
    for c in range(values.shape[1]):
        drift_out[c] = speed_out[c] = 0.0
    now = begin
    for i in range(len(stamps)):
        h, scale = stamps[i] - now, 1.0 / gains[i, 2]
        first, second = gains[i, 0], gains[i, 1]
        now = stamps[i]
        for c in range(values.shape[1]):
            d = drift_out[c] + h * speed_out[c]
            innovation = values[i, c] - d
            drift_out[c] = d + first * innovation
            speed_out[c] += second * innovation
            values[i, c] = innovation * scale
