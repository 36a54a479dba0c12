# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""States by the laws of a scene with air: spin, bounces, unknown blows, lost frames."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, Plane, Scene
from rigid_gns_core.scenes.tracker import Spins, Tracker
from rigid_gns_core.tracking import estimate_state
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_estimate import estimate_ball, forecast_ball, sampled_covariances
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path
from rigid_gns_core.tracking.kinks import kinks
from rigid_gns_core.tracking.start_prior import StartPrior

NOISE = 0.7e-3
SPIN = np.array([-20.0, 110.0, 15.0])
TABLE = ContactLaw(restitution=0.94, friction=0.25, tangential_restitution=0.2)
AIR = Air(drag_coefficient=0.4, drag_slope=0.3, lift_coefficient=0.42)


def scene(**learned: object) -> Scene:
    """Table tennis with a tracker."""
    return Scene(
        surfaces=Plane(contact=TABLE),
        radius=0.02,
        mass=0.0027,
        inertia_factor=2 / 3,
        air=AIR,
        tracker=Tracker(noise=NOISE, drift=1e-6, impact=1e-4, **learned),  # type: ignore[arg-type]
    )


def track(end: float, start: list[float], rate: float = 180.0) -> tuple[np.ndarray, np.ndarray]:
    """Times and true states from a position and velocity with SPIN."""
    model = BallModel.of(scene())
    times = np.arange(round(end * rate) + 1) / rate
    states = np.zeros((len(times), 9))
    laws = (model.ball, model.planes, model.laws)
    path(np.array([*start, *SPIN]), 0.0, times, *laws, FREE, states, np.zeros((8, 3)))
    return times, states


FLIGHT = [0.0, 0.0, 0.5, 4.0, 0.3, 1.0]
BOUNCE = [0.0, 0.0, 0.4, 4.0, 0.3, -1.5]


@pytest.mark.parametrize('start', [FLIGHT, BOUNCE])
def test_the_covariance_is_that_of_repeated_noise(start: list[float]) -> None:
    """Normalised squares of position, velocity and spin: 9 in the mean, 8.3 in the median.

    Of 60 draws they spread by sqrt(18 / 60) = 0.55; the window's laws are not linear.
    """
    rng = np.random.default_rng(1)
    times, states = track(0.3, start)
    squares = []
    for _ in range(60):
        places = states[:, None, :3] + rng.normal(0.0, NOISE, (len(times), 1, 3))
        found = estimate_state(scene(), times, places)
        got = np.concatenate(
            [
                found.state.positions[0],
                found.state.velocities[0],
                found.state.angular_velocities[0],
            ]
        )
        off = got - states[-1]
        squares.append(off @ np.linalg.solve(found.covariance[0], off))
    assert 7.0 < np.mean(squares) < 11.0
    assert 6.5 < np.median(squares) < 10.0


def test_without_noise_the_state_is_exact_through_a_bounce() -> None:
    """Of the spin about the path little is seen in the air: the prior holds it near 0."""
    times, states = track(0.4, BOUNCE)
    found = estimate_state(scene(), times, states[:, None, :3])
    np.testing.assert_allclose(found.state.positions[0], states[-1, :3], atol=1e-4)
    np.testing.assert_allclose(found.state.velocities[0], states[-1, 3:6], atol=2e-3)
    np.testing.assert_allclose(found.state.angular_velocities[0], states[-1, 6:], atol=10.0)


def test_a_frame_that_is_far_off_is_dropped() -> None:
    times, states = track(0.2, FLIGHT)
    places = states[:, None, :3].copy()
    places[20] += 0.05
    found = estimate_state(scene(), times, places)
    np.testing.assert_allclose(found.state.velocities[0], states[-1, 3:6], atol=0.01)


def test_after_a_blow_only_what_came_since_counts() -> None:
    """A racket turns the ball about in mid-air: no law of the scene does that."""
    times, _ = track(0.2, FLIGHT)
    before, later = track(0.15, [0.2, 0.0, 0.7, -4.0, 0.3, 2.0])
    first = later[0, :3] - 4.0 * (times - times[-1])[:, None] * [-1.0, 0.0, 0.0] - 0.02
    places = np.concatenate([first, later[:, :3]])[:, None]
    stamps = np.concatenate([times, times[-1] + before + 1 / 180])
    found = estimate_state(scene(), stamps, places)
    np.testing.assert_allclose(found.state.velocities[0], later[-1, 3:6], atol=0.05)


def test_a_path_that_leaves_out_the_newest_frames_yields_to_the_last_four() -> None:
    """Five frames after a blow that no law tells; the last four span 17 ms."""
    times, states = track(0.4, [0.0, 0.0, 1.9, 4.0, 0.3, -0.5])
    places = states[:, :3].copy()
    places[-5:] -= 6.0 * (times[-5:] - times[-6])[:, None] * [1.0, 0.0, 0.0]
    estimate = estimate_ball(
        BallModel.of(scene()), np.array([NOISE, 0.0, 0.0]), None, times, places
    )
    expected = states[-1, 3:6] - np.array([6.0, 0.0, 0.0])
    np.testing.assert_allclose(estimate.state[3:6], expected, atol=5 * 0.056)
    deviations = np.sqrt(np.diag(estimate.covariance)[3:6])
    np.testing.assert_allclose(deviations, 0.056, rtol=0.2)  # 0.7 mm, spread over four frames


def test_a_path_that_misses_the_last_two_frames_yields_to_a_shorter_window() -> None:
    """A push to the side in mid-air, and then eight frames, which were dropped as outliers.

    The state was 89 mm and 2 m/s off. Of a window that holds the push and eleven frames, the
    velocity is within 5 %, and the place within three deviations of a frame.
    """
    times, states = track(0.4, [0.0, 0.0, 1.9, 4.0, 0.3, -0.5])
    places = states[:, :3].copy()
    places[-8:] += 2.0 * (times[-8:] - times[-9])[:, None] * [0.0, 1.0, 0.0]
    noise = np.array([NOISE, 0.0, 0.0])
    estimate = estimate_ball(BallModel.of(scene()), noise, None, times, places)
    np.testing.assert_allclose(estimate.state[:3], places[-1], atol=3 * NOISE)
    np.testing.assert_allclose(estimate.state[4], states[-1, 4] + 2.0, atol=0.1)


def test_a_ball_that_was_lost_is_carried_on_and_less_well_known() -> None:
    times, states = track(0.3, BOUNCE)
    places = states[:, None, :3].copy()
    seen = estimate_state(scene(), times, places)
    places[-12:] = np.nan
    lost = estimate_state(scene(), times, places)
    np.testing.assert_allclose(lost.state.positions[0], states[-1, :3], atol=2e-3)
    assert np.trace(lost.covariance[0, :3, :3]) > 4 * np.trace(seen.covariance[0, :3, :3])


def test_balls_do_not_know_of_each_other_but_where_they_are_near() -> None:
    """What came before two balls met does not count: the first's velocity before was another."""
    times, states = track(0.2, FLIGHT)
    one = states[:, :3].copy()
    other = states[:, :3] + [0.0, 0.5, 0.0]
    alone = estimate_state(scene(), times, one[:, None])
    both = estimate_state(scene(), times, np.stack([one, other], axis=1))
    np.testing.assert_allclose(both.state.velocities[0], alone.state.velocities[0], atol=1e-12)
    other[:20] = one[:20] + [0.0, 0.0, 0.0405]
    met = estimate_state(scene(), times, np.stack([one, other], axis=1))
    assert met.covariance[0, 3, 3] > 4 * alone.covariance[0, 3, 3]


def test_a_blow_shows_and_a_bounce_or_an_outlier_does_not() -> None:
    model = BallModel.of(scene())
    times, states = track(0.4, BOUNCE)
    places = states[:, :3].copy()
    assert not len(kinks(model, times, places, NOISE))
    places[30] += 0.05
    assert not len(kinks(model, times, places, NOISE))
    struck = states[:, :3].copy()
    struck[20:, 1] += 3.0 * (times[20:] - times[20])
    assert kinks(model, times, struck, NOISE).tolist() in ([20], [21])  # between two frames


def test_a_prior_looks_at_like_windows_and_turns_with_the_shot() -> None:
    rows = []
    for x, spin in ((0.0, 50.0), (5.0, -50.0)):
        rows += [(x, 0, 1, 4, 0, 1, 0, spin, 0, 1, 0, 0, 1, 0, 1)] * 3
    prior = StartPrior.of(Spins(tuple(rows), bandwidth=0.2, shrinkage=0.3))
    mean, covariance = prior.at(np.array([0.0, 0, 1]), np.array([4.0, 0, 1]))
    # three windows at 50, and 0.3 of the mean of all, 0
    np.testing.assert_allclose(mean, [0.0, 50 * 3 / 3.3, 0.0], rtol=0.02)
    every = StartPrior.of(Spins(tuple(rows[:3])))
    turned, _ = every.at(np.array([0.0, 0, 1]), np.array([0.0, 4.0, 1]))
    np.testing.assert_allclose(turned, [-50.0, 0.0, 0.0], atol=1e-12)
    # far from all windows: that of all
    wide = prior.at(np.array([0.0, 90.0, 1]), np.array([4.0, 0, 1]))[1]
    assert wide[1, 1] > 50**2 * 0.9 > covariance[1, 1]


def test_a_learned_prior_tells_the_spin_that_a_window_does_not() -> None:
    rows = ((*FLIGHT, *SPIN, 25.0, 0, 0, 25.0, 0, 25.0),) * 2
    times, states = track(0.05, FLIGHT)
    places = states[:, None, :3]
    known = estimate_state(scene(spins=Spins(rows)), times, places)
    unknown = estimate_state(scene(), times, places)
    assert np.abs(known.state.angular_velocities[0] - SPIN).max() < 20.0
    assert np.abs(unknown.state.angular_velocities[0] - SPIN).max() > 40.0


def test_drawn_covariances_are_those_of_slopes_where_paths_are_smooth() -> None:
    """400 draws know a variance to 7 %."""
    model = BallModel.of(scene())
    times, states = track(0.2, FLIGHT)
    noise = np.array([NOISE, 1e-6, 1e-4])
    found = estimate_ball(model, noise, StartPrior.of_any_spin(0.02), times, states[:, :3])
    stamps = times[-1] + np.array([0.05, 0.15])
    slopes = forecast_ball(model, found, times[-1], stamps).covariances[:, :3, :3]
    drawn = sampled_covariances(model, found, times[-1], stamps, 400, 0)
    for one, other in zip(slopes, drawn, strict=True):
        np.testing.assert_allclose(np.trace(one), np.trace(other), rtol=0.25)


@pytest.mark.parametrize('start', [FLIGHT, BOUNCE])
@pytest.mark.parametrize('air', [True, False])
@pytest.mark.parametrize('frame', [-1, -2])
@pytest.mark.parametrize('off', [[0.3, 0.1, 0.2], [-0.1, 0.12, 0.05], [0.0, 0.0, 0.3]])
def test_one_wild_frame_at_the_end_is_no_blow(
    start: list[float], air: bool, frame: int, off: list[float]
) -> None:
    """It was taken for one: the velocity was off / interval, 29 to 67 m/s."""
    given = scene() if air else Scene(surfaces=Plane(contact=TABLE), radius=0.02)
    model = BallModel.of(given)
    times, states = np.arange(55) / 180.0, np.zeros((55, 9))
    laws = (model.ball, model.planes, model.laws)
    path(np.array([*start, 0.0, 0.0, 0.0]), 0.0, times, *laws, FREE, states, np.zeros((8, 3)))
    places = states[:, None, :3] + np.random.default_rng(0).normal(0.0, NOISE, (55, 1, 3))
    places[frame, 0] += off
    found = estimate_state(given, times, places)
    # deviations of a velocity are 3 to 30 mm/s, and of a place 0.7 mm at most
    np.testing.assert_allclose(found.state.velocities[0], states[-1, 3:6], atol=0.1)
    np.testing.assert_allclose(found.state.positions[0], states[-1, :3], atol=3e-3)


@pytest.mark.parametrize('frames', [3, 4, 5])
def test_a_blow_some_frames_ago_is_one(frames: int) -> None:
    """A racket turns the ball: the frames since then count, not those before."""
    times, turn, after = np.arange(40) / 180.0, 39 - frames, np.array([-6.0, 0.5, 3.0])
    since = (times - times[turn])[:, None]
    velocity = np.where(since > 0.0, after, [5.0, 0.0, 1.0])
    places = [0.0, 0.0, 1.0] + velocity * since - [0.0, 0.0, 0.5 * 9.81] * since**2
    given = Scene(surfaces=Plane(contact=TABLE), radius=0.02)
    found = estimate_state(given, times, places[:, None], noise=0.1e-3)
    expected = after - [0.0, 0.0, 9.81 * since[-1, 0]]
    # of a line through four frames of 0.1 mm, and what gravity adds within one of them
    np.testing.assert_allclose(found.state.velocities[0], expected, atol=0.06)
