# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`estimate_state`: states of a window of positions, and their covariance."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.tracking import estimate_state

SCENE = Scene(surfaces=(Plane(),), radius=0.02)
TIMES = np.arange(20) / 180.0
G = np.array([0.0, 0.0, -9.81])


def flight(velocity: np.ndarray) -> np.ndarray:
    """Centres that end at (0, 0, 1) with a velocity [m/s], shape (20, 1, 3)."""
    left = (TIMES - TIMES[-1])[:, None]
    return ([0.0, 0.0, 1.0] + left * velocity + 0.5 * G * left**2)[:, None]


def test_a_flight_is_exact() -> None:
    velocity = np.array([3.0, -0.5, 1.0])
    found = estimate_state(SCENE, TIMES, flight(velocity))
    np.testing.assert_allclose(found.state.positions, [[0.0, 0.0, 1.0]], atol=1e-9)
    np.testing.assert_allclose(found.state.velocities, [velocity], atol=1e-8)
    assert found.covariance.shape == (1, 9, 9)


def test_the_covariance_is_that_of_repeated_noise() -> None:
    """The normalised square of the error has its mean, 6 of 6 degrees of freedom."""
    rng, noise, velocity = np.random.default_rng(0), 0.7e-3, np.array([3.0, -0.5, 1.0])
    truth = np.append([0.0, 0.0, 1.0], velocity)
    squares = []
    for _ in range(200):
        places = flight(velocity) + rng.normal(0.0, noise, (20, 1, 3))
        found = estimate_state(SCENE, TIMES, places, noise=noise)
        off = np.append(found.state.positions[0], found.state.velocities[0]) - truth
        squares.append(off @ np.linalg.solve(found.covariance[0, :6, :6], off))
    # chi-squared with 6 degrees of freedom: 6 +- sqrt(12 / 200) = 0.25; a window whose tail was
    # cut by chance at an outlier is worse than its covariance says, hence the median beside it
    assert 5.0 < np.mean(squares) < 8.0
    assert 4.8 < np.median(squares) < 6.2  # of chi-squared: 5.35


def test_a_sphere_that_is_lost_at_times_is_coasted() -> None:
    velocity = np.array([1.0, 0.0, 2.0])
    places = np.concatenate([flight(velocity), flight(velocity) + [1.0, 0.0, 0.0]], axis=1)
    places[[3, 18, 19], 1] = np.nan
    found = estimate_state(SCENE, TIMES, places)
    np.testing.assert_allclose(found.state.positions[1], [1.0, 0.0, 1.0], atol=1e-8)
    np.testing.assert_allclose(found.state.velocities[1], velocity, atol=1e-7)


def test_a_sphere_seen_once_is_at_rest_and_its_velocity_unknown() -> None:
    places = np.concatenate([flight(np.ones(3)), np.full((20, 1, 3), np.nan)], axis=1)
    places[-1, 1] = [1.0, 0.0, 0.02]
    found = estimate_state(SCENE, TIMES, places)
    np.testing.assert_array_equal(found.state.velocities[1], np.zeros(3))
    assert np.isnan(found.covariance[1]).any() and np.isfinite(found.covariance[0]).all()


@pytest.mark.parametrize(
    ('times', 'positions', 'quaternions', 'message'),
    [
        (TIMES, flight(G)[:, 0], None, r'positions have shape \(20, 3\), expected \(20, n, 3\)'),
        (TIMES, np.full((20, 1, 3), np.nan), None, 'sphere 0 is seen in no frame; leave it out'),
        (TIMES, flight(G), np.zeros((20, 1, 3)), 'quaternions have shape'),
        (TIMES[::-1], flight(G), None, 'expected increasing ones'),
        (TIMES[::-1], np.tile(flight(G), (1, 9, 1)), None, 'expected increasing ones'),
        (TIMES * np.nan, flight(G), None, 'expected increasing ones'),
        (TIMES * 1e-300, flight(G), None, 'expected seconds: steps of 1e-09 s or more'),
        (TIMES * 1e300, flight(G), None, 'expected seconds: .* within 1e.19 s'),
        (TIMES, 1e7 * flight(G), None, r'a position is .* m out, expected at most .*in metres'),
    ],
)
def test_input_is_checked(
    times: np.ndarray, positions: np.ndarray, quaternions: np.ndarray | None, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        estimate_state(SCENE, times, positions, quaternions)


@pytest.mark.parametrize('frames', [2, 3, 4, 5])
def test_few_frames_do_not_tell_the_noise_and_the_covariance_knows(frames: int) -> None:
    """Two or three frames have no third difference: a noise of 0 made errors of 0.6 m/s 1 mm/s."""
    rng, velocity, squares = np.random.default_rng(3), np.array([3.0, -0.5, 1.0]), []
    for _ in range(100):
        places = flight(velocity)[-frames:] + rng.normal(0.0, 1e-3, (frames, 1, 3))
        found = estimate_state(SCENE, TIMES[-frames:], places)
        off = found.state.velocities[0] - velocity
        squares.append(off @ np.linalg.solve(found.covariance[0, 3:6, 3:6], off))
    # chi-squared with 3 degrees of freedom where the noise is that of the guess
    assert 1.5 < np.mean(squares) < 4.5
