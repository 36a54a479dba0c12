# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
import pytest
from rigid_gns_core.scenes.state import rotate_quaternions
from rigid_gns_core.tracking.environment import Environment
from rigid_gns_core.tracking.velocity import estimate_motion

GRAVITY = np.array([0.0, 0.0, -9.81])
SPHERES = 4


def estimate_velocities(
    times: ArrayLike, positions: np.ndarray, quaternions: np.ndarray, gravity: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities where neither the scene nor the noise is known: frames are all of one motion."""
    motion = estimate_motion(
        times,
        positions,
        quaternions,
        environment=Environment.unknown(gravity, 1.0),
        radii=np.ones(np.shape(positions)[1] if np.ndim(positions) == 3 else 0),
        noise=1e6,  # nothing is left out, and the motion that fits better is taken
    )
    return motion.velocities, motion.angular_velocities


def flight(
    times: np.ndarray, seed: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Positions and quaternions in free flight, and the velocities and spins at the last time."""
    rng = np.random.default_rng(seed)
    velocities = rng.normal(0.0, 10.0, (SPHERES, 3))
    spins = rng.normal(0.0, 3.0, (SPHERES, 3))
    since = (times - times[-1])[:, None, None]
    positions = rng.normal(0.0, 50.0, (SPHERES, 3)) + velocities * since + GRAVITY * since**2 / 2
    start = rng.normal(size=(SPHERES, 4))
    quaternions = np.stack([rotate_quaternions(start, spins * t) for t in since[:, 0, 0]])
    return positions, quaternions, velocities, spins


@pytest.mark.parametrize('frames', [2, 3, 4, 7, 30])
@pytest.mark.parametrize('even', [True, False])
def test_free_flight_is_exact(frames: int, even: bool) -> None:
    steps = np.full(frames, 0.1) if even else np.random.default_rng(1).uniform(0.02, 0.2, frames)
    times = 1000.0 + np.cumsum(steps)
    positions, quaternions, velocities, spins = flight(times)
    # the longest window turns a sphere by several turns in all
    v, w = estimate_velocities(times, positions, quaternions, GRAVITY)
    np.testing.assert_allclose(v, velocities, atol=1e-9)
    np.testing.assert_allclose(w, spins, atol=1e-9)


def test_the_sign_of_a_quaternion_does_not_matter() -> None:
    times = np.arange(5) * 0.1
    positions, quaternions, _, spins = flight(times)
    quaternions[::2] *= -1
    _, w = estimate_velocities(times, positions, quaternions, GRAVITY)
    np.testing.assert_allclose(w, spins, atol=1e-9)


def test_one_frame_is_at_rest() -> None:
    positions, quaternions, _, _ = flight(np.zeros(1))
    v, w = estimate_velocities([5.0], positions, quaternions, GRAVITY)
    assert not v.any() and not w.any()
    assert v.shape == w.shape == (SPHERES, 3)


@pytest.mark.parametrize('frames', [3, 6])
def test_a_sphere_on_a_floor_does_not_fall(frames: int) -> None:
    times = np.arange(frames) * 0.1
    positions, quaternions, velocities, _ = flight(times)
    rolling = np.array([2.0, -1.0, 0.0])
    positions[:, 1] = [0.0, 0.0, 1.0] + rolling * times[:, None]
    v, _ = estimate_velocities(times, positions, quaternions, GRAVITY)
    np.testing.assert_allclose(v[1], rolling, atol=1e-9)
    np.testing.assert_allclose(np.delete(v, 1, 0), np.delete(velocities, 1, 0), atol=1e-9)


@pytest.mark.parametrize('frames', [2, 3, 5, 10])
def test_noise_propagates_as_in_a_straight_line_fit(frames: int) -> None:
    noise, draws = 1e-3, 4000
    times = np.arange(frames) * 0.1
    positions, quaternions, velocities, _ = flight(times)
    noisy = np.repeat(positions, draws, axis=1)
    noisy = noisy + np.random.default_rng(2).normal(0.0, noise, noisy.shape)
    v, _ = estimate_velocities(times, noisy, np.repeat(quaternions, draws, axis=1), GRAVITY)
    error = (v - np.repeat(velocities, draws, axis=0)).ravel()
    expected = noise / np.sqrt(((times - times.mean()) ** 2).sum())
    # of 48 000 normal draws: five standard deviations of their mean and of their variance
    assert abs(error.mean()) < 5 * expected / np.sqrt(error.size)
    assert abs(error.var() / expected**2 - 1) < 5 * np.sqrt(2 / error.size)


def test_components_and_spheres_are_independent() -> None:
    times = np.arange(4) * 0.1
    positions, quaternions, _, _ = flight(times)
    draws = 5000
    noisy = np.repeat(positions[:, :1], draws, axis=1)
    noisy = noisy + np.random.default_rng(3).normal(0.0, 1e-3, noisy.shape)
    v, _ = estimate_velocities(times, noisy, np.repeat(quaternions[:, :1], draws, axis=1), GRAVITY)
    correlation = np.corrcoef(v.T) - np.eye(3)
    assert np.abs(correlation).max() < 5 / np.sqrt(draws)


@pytest.mark.parametrize(
    ('times', 'frames', 'message'),
    [([], 0, '0 times'), ([0.0, 0.1], 3, '2 times, 3 frames'), ([0.1, 0.1], 2, 'increasing')],
)
def test_bad_windows_are_named(times: list[float], frames: int, message: str) -> None:
    positions, quaternions = np.zeros((frames, 2, 3)), np.ones((frames, 2, 4))
    with pytest.raises(ValueError, match=message):
        estimate_velocities(times, positions, quaternions, GRAVITY)
