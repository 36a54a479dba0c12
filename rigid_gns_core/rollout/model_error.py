# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the laws leave open of a forecast: a random motion beside each path.

On each axis an acceleration of deviation b [m/s^2] that stays the same, the double integral of
white acceleration of spectral density q [m^2/s^3], and a kick of the velocity of deviation kappa u
at a blow with approach speed u (`Tracker`, fitted to tracks that were left out, so that errors of
fitted parameters are in it).
"""

from __future__ import annotations

import numpy as np

from .paths import Paths
from ..scenes.state import Array
from ..scenes.tracker import Tracker


def approach_speeds(paths: Paths) -> Array:
    """Approach speed of the blow in each step [m/s], 0 without one, shape (s, steps, n)."""
    sizes = np.linalg.norm(paths.blows, axis=-1)
    along = -(paths.velocities[:, :-1] * paths.blows).sum(axis=-1)
    return np.asarray(np.maximum(along / np.maximum(sizes, 1e-300), 0.0))


def spread_at(paths: Paths, times: Array, tracker: Tracker) -> Array:
    """Variance of a coordinate at times since the start [m^2], shape (s, k, n).

    b^2 t^4 / 4 + q t^3 / 3 + kappa^2 sum of (approach speed times time since)^2.
    """
    middles = (np.arange(paths.steps) + 0.5) * paths.dt
    since = np.maximum(np.asarray(times)[:, None] - middles, 0.0) ** 2
    kicks = np.einsum('km,smn->skn', since, approach_speeds(paths) ** 2)
    since = np.asarray(times)[:, None]
    drift = tracker.forecast_drift * since**3 / 3.0
    drift = drift + (0.5 * tracker.forecast_acceleration * since**2) ** 2
    return np.asarray(drift + tracker.forecast_impact**2 * kicks)


def drawn_motion(
    paths: Paths, tracker: Tracker, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Random motions at the steps: of positions [m] and velocities [m/s], (s, steps + 1, n, 3)."""
    h, q = paths.dt, tracker.forecast_drift
    shape = paths.blows.shape
    first, second, third = generator.normal(size=(3, *shape))
    kicks = tracker.forecast_impact * approach_speeds(paths)[..., None] * third
    velocities, positions = np.zeros(paths.positions.shape), np.zeros(paths.positions.shape)
    # of white acceleration over h: var v = q h, cov(p, v) = q h^2 / 2, var p = q h^3 / 3
    changes = np.sqrt(q * h) * first
    velocities[:, 1:] = np.cumsum(changes + kicks, axis=1)
    moves = h * velocities[:, :-1] + 0.5 * h * (changes + kicks)
    positions[:, 1:] = np.cumsum(moves + np.sqrt(q * h**3 / 12.0) * second, axis=1)
    if tracker.forecast_acceleration:
        still = generator.normal(size=positions[:, :1].shape)
        still *= tracker.forecast_acceleration
        times = h * np.arange(paths.steps + 1)[:, None, None]
        positions += 0.5 * times**2 * still
        velocities += times * still
    return positions, velocities
