# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Correction of estimated starts by what like ones missed."""

from __future__ import annotations

from dataclasses import replace

from launched_balls import launched, true_scene
import numpy as np
from rigid_gns_core.scenes.correction import Correction
from rigid_gns_core.scenes.tracker import Tracker
from rigid_gns_core.tracking import estimate_state
from rigid_gns_core.tracking.spin_windows import heading
from rigid_gns_core.tracking.start_correction import features_of, headings, StartCorrection

RADII = np.array([0.02])
SCALES = (0.5,) * 10
FLOOR = 0.05
# deviations of position, velocity and spin
DEVIATIONS = np.repeat([1e-3, 0.12, 40.0], 3)
COVARIANCE = np.diag(DEVIATIONS**2)[None]
STATE = np.array([[0.1, -0.2, 1.0, 3.0, 4.0, 0.5, 10.0, 60.0, -20.0]])


def seen(state: np.ndarray, weights: list[float]) -> StartCorrection:
    """Correction that one start alone makes."""
    row = (*features_of(state, COVARIANCE, RADII)[0].tolist(), *weights)
    return StartCorrection.of(Correction((row,), SCALES, 0.5, FLOOR))


def test_a_start_that_was_seen_moves_by_its_deviations() -> None:
    """One unit is sqrt(P + f^2): 0.13 m/s of velocity, hypot(0.8, 0.05) / 0.02 rad/s of spin."""
    moved = (
        seen(STATE, [1.0, 0.0, 0.0, 0.0, 0.0, -1.0]).corrected(STATE, COVARIANCE, RADII) - STATE
    )
    velocity, spin = np.hypot(0.12, FLOOR), np.hypot(0.8, FLOOR) / 0.02
    # along the horizontal velocity, (0.6, 0.8); and up
    expected = [0, 0, 0, 0.6 * velocity, 0.8 * velocity, 0, 0, 0, -spin]
    np.testing.assert_allclose(moved[0], expected, atol=1e-12)


def test_what_is_well_known_hardly_moves() -> None:
    well = 1e-6 * COVARIANCE
    row = (*features_of(STATE, well, RADII)[0].tolist(), *[1.0] * 6)
    correction = StartCorrection.of(Correction((row,), SCALES, 0.5, 1e-3))
    assert np.abs(correction.corrected(STATE, well, RADII) - STATE)[0, 3:6].max() < 2e-3


def test_strangers_fall_back_to_the_laws() -> None:
    """Five scales off in any one of ten features a kernel is below 0.007; far off it is 0."""
    correction = seen(STATE, [1.0] * 6)
    near = np.abs(correction.corrected(STATE, COVARIANCE, RADII) - STATE).max()
    for part, off in enumerate([2.5] * 6):
        other = STATE.copy()
        other[0, part] += off
        moved = correction.corrected(other, COVARIANCE, RADII) - other
        assert np.abs(moved).max() < 0.02 * near
    far = STATE + [[5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 0.0, 0.0, 0.0]]
    np.testing.assert_allclose(correction.corrected(far, COVARIANCE, RADII), far, atol=1e-10)


def test_axes_are_those_of_the_prior_of_spins() -> None:
    velocities = np.array([[3.0, 4.0, 1.0], [-1.0, 0.2, 0.0], [0.0, 0.0, 2.0]])
    for velocity, turn in zip(velocities, headings(velocities), strict=True):
        np.testing.assert_allclose(turn, heading(velocity[0], velocity[1]), atol=1e-15)


def test_estimates_in_flight_are_corrected_and_those_on_a_surface_are_not() -> None:
    (shot,) = launched(1)
    times, places = shot.times[:37], shot.positions[:37]
    tracker = Tracker(noise=1e-3, drift=1e-4, impact=1e-3)
    plain = replace(true_scene(), tracker=tracker)
    before = estimate_state(plain, times, places)
    state = before.state
    own = np.concatenate([state.positions, state.velocities, state.angular_velocities], axis=1)
    row = (*features_of(own, before.covariance, RADII)[0].tolist(), 1.0, *[0.0] * 5)
    everywhere = Correction((row,), (1e6,) * 10, 0.5, FLOOR)
    corrected = replace(plain, tracker=replace(tracker, correction=everywhere))
    after = estimate_state(corrected, times, places)
    change = after.state.velocities[0] - state.velocities[0]
    # forwards, by the floor and what the estimate itself leaves open
    assert 0.9 * FLOOR < np.linalg.norm(change) < 3 * FLOOR
    assert change[:2] @ state.velocities[0, :2] > 0
    np.testing.assert_array_equal(after.covariance, before.covariance)
    rolling = np.zeros((len(times), 1, 3)) + [0.0, 0.0, 0.022]
    rolling[:, 0, 0] += 0.4 * times
    found = [estimate_state(one, times, rolling).state.velocities for one in (plain, corrected)]
    np.testing.assert_array_equal(*found)
