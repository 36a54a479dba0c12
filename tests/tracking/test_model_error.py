# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whitening of residuals with a drift: that of the covariance they have."""

from __future__ import annotations

import numba
import numpy as np
from rigid_gns_core import ContactLaw, Plane, Scene
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path
from rigid_gns_core.tracking.model_error import filter_gains, GAINS, whiten


@numba.njit(error_model='numpy')
def whitened(
    times: np.ndarray, observed: np.ndarray, states: np.ndarray, impacts: np.ndarray,
    count: int, noise: np.ndarray,
) -> tuple[np.ndarray, float]:  # fmt: skip
    """Whitened residuals of a path, shape (m, 3), and the sum of log variances of an axis."""
    m = len(times)
    gains, residuals = np.zeros((m, GAINS)), observed - states[:, :3]
    log = filter_gains(0.0, times, np.ones(m), noise, impacts, count, gains)
    whiten(0.0, times, gains, residuals, np.zeros(3), np.zeros(3))
    return residuals, log


def covariance(times: np.ndarray, noise: np.ndarray, impacts: np.ndarray) -> np.ndarray:
    """Of the noise, of an integral of an integral of white noise, and of kicks."""
    low = np.minimum(times[:, None], times)
    high = np.maximum(times[:, None], times)
    total = noise[1] * (low**2 * high / 2 - low**3 / 6) + noise[0] ** 2 * np.eye(len(times))
    for time, _, speed in impacts:
        since = np.maximum(times - time, 0.0)
        total += (noise[2] * speed) ** 2 * np.outer(since, since)
    return total


def test_whitened_residuals_have_the_norm_and_the_determinant_of_the_covariance() -> None:
    """The filter and a Cholesky factor agree to rounding, at uneven times and past an impact."""
    rng = np.random.default_rng(0)
    scene = Scene(surfaces=Plane(contact=ContactLaw(restitution=0.9)), radius=0.02)
    model = BallModel.of(scene)
    laws = (model.ball, model.planes, model.laws)
    times = np.sort(rng.uniform(0.0, 0.6, 40))
    start = np.array([0, 0, 0.5, 1, 0, 0, 0, 0, 0], dtype=np.float64)
    states, impacts = np.zeros((40, 9)), np.zeros((8, 3))
    count, _ = path(start, 0.0, times, *laws, FREE, states, impacts)
    assert count == 1
    off = rng.normal(size=(40, 3))
    noise = np.array([1e-3, 0.05, 0.03])
    white, log = whitened(times, states[:, :3] + off, states, impacts, count, noise)
    matrix = covariance(times, noise, impacts[:1])
    expected = np.einsum('ma,ma->a', off, np.linalg.solve(matrix, off))
    np.testing.assert_allclose((white**2).sum(axis=0), expected, rtol=1e-8)
    np.testing.assert_allclose(3 * log, 3 * np.linalg.slogdet(matrix)[1], rtol=1e-8)
