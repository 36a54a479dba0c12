# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rollouts at times that are not steps, and what the laws leave open beside them."""

from __future__ import annotations

from dataclasses import replace

from csv_balls import bounces, RADIUS, RESTITUTION
import numpy as np
import pytest
from rigid_gns_core import load_scene, load_simulator, Plane, Scene, State
from rigid_gns_core.rollout.model_error import approach_speeds, drawn_motion, spread_at
from rigid_gns_core.rollout.paths import Paths
from rigid_gns_core.scenes.tracker import Tracker
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_estimate import BallEstimate, forecast_ball
from rigid_gns_core.tracking.ball_model import BallModel

SCENE = Scene(
    surfaces=(Plane(restitution=RESTITUTION, friction=0.0),),
    radius=RADIUS,
    restitution=1.0,
    friction=0.0,
    rolling_friction=0.0,
)
G = np.array([0.0, 0.0, -9.81])


def sampled(
    times: np.ndarray, acceleration: np.ndarray, dt: float, *, exact: bool = True
) -> Paths:
    """Steps of a motion of constant acceleration from (1, 2, 3) with velocity (4, 5, 6)."""
    t = np.arange(int(times[-1] / dt) + 2)[None, :, None, None] * dt
    velocities = [4.0, 5.0, 6.0] + acceleration * t
    positions = [1.0, 2.0, 3.0] + t * [4.0, 5.0, 6.0] + 0.5 * acceleration * t**2
    turns = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*positions.shape[:3], 4))
    states = State.unchecked(positions, turns, velocities, np.zeros_like(positions))
    return Paths.of(SCENE, states, dt, exact=exact)


def paths_of(scene: Scene, start: State, steps: int) -> Paths:
    simulator = load_simulator()
    one = State.unchecked(*(values[None] for values in vars(start).values()))
    states = simulator.rollout_samples(scene, one, steps)
    return Paths.of(scene, states, simulator.native_dt(scene), exact=True)


@pytest.mark.parametrize('acceleration', [G, G + [-2.0, 0.0, 0.0], 0.0 * G])
def test_parabolas_are_exact(acceleration: np.ndarray) -> None:
    times = np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 50))
    places, speeds = sampled(times, acceleration, 0.014).at(times)
    t = times[:, None]
    truth = [1.0, 2.0, 3.0] + t * [4.0, 5.0, 6.0] + 0.5 * acceleration * t**2
    np.testing.assert_allclose(places[0, :, 0], truth, atol=1e-12)
    np.testing.assert_allclose(speeds[0, :, 0], [4.0, 5.0, 6.0] + acceleration * t, atol=1e-10)


def test_velocities_of_a_step_before_give_straight_lines() -> None:
    times = np.array([0.005, 0.014, 0.021])
    paths = sampled(times, G, 0.014, exact=False)
    found = paths.at(times)[0][0]
    np.testing.assert_allclose(found[1], paths.positions[0, 1], atol=1e-15)
    np.testing.assert_allclose(found[2], paths.positions[0, 1:3].mean(axis=0), atol=1e-15)


def test_bounces_are_met_between_steps() -> None:
    """Steps of 14 ms against the closed form: a straight line through a bounce is 1 cm off."""
    start = State(positions=[[0.0, 0.0, 0.3]], velocities=[[3.0, 0.2, 1.0]])
    times = np.linspace(1e-4, 1.0, 1500)
    paths = paths_of(SCENE, start, 72)
    truth = bounces(times, [0.0, 0.0, 0.3], [3.0, 0.2, 1.0])
    off = np.abs(paths.at(times)[0][0, :, 0] - truth).max()
    steps = np.arange(73) * paths.dt
    line = np.stack([np.interp(times, steps, paths.positions[0, :, 0, k]) for k in range(3)], 1)
    assert np.abs(line - truth).max() > 5e-3
    # the engine's own error in two bounces, 1e-5 m and less, is left
    assert off < 2e-5


def test_a_bounce_of_a_ball_with_spin_in_air_is_met_between_steps() -> None:
    """Against other code, the tracker's path: steps of 8 ms, its own impact, in the same air."""
    scene = load_scene('table_tennis')
    table, floor = scene.surfaces
    assert table.contact is not None
    table = replace(table, contact=replace(table.contact, rolling_friction=0.0))
    scene = replace(scene, surfaces=(table, floor))
    start = State(
        positions=[[-1.0, 0.1, 0.25]],
        velocities=[[5.0, 0.3, 0.5]],
        angular_velocities=[[10.0, 80.0, 5.0]],
    )
    paths = paths_of(scene, start, 20)
    (step,) = np.flatnonzero(paths.blows[0, :, 0].any(axis=-1))
    times = (step + np.linspace(-1.0, 2.0, 300)) * paths.dt
    state = np.concatenate([start.positions[0], start.velocities[0], start.angular_velocities[0]])
    estimate = BallEstimate(state, np.eye(9), FREE, 1.0, 0.0, 0)
    truth = forecast_ball(BallModel.of(scene), estimate, 0.0, times)
    assert len(truth.impacts) == 1
    places, _ = paths.at(times)
    # flights in vacuum would be 0.2 mm off in this step; engine and tracker part by 1e-4 m/s
    assert np.abs(places[0, :, 0] - truth.states[:, :3]).max() < 1e-5


def test_a_ball_that_rolls_is_not_struck() -> None:
    start = State(positions=[[0.0, 0.0, RADIUS]], velocities=[[2.0, 0.0, 0.0]])
    assert not paths_of(SCENE, start, 30).blows.any()


def test_impacts_of_a_rollout_widen_what_comes_after() -> None:
    """A ball dropped from h: u = sqrt(2 g h) at t = sqrt(2 h / g), to a step of 14 ms."""
    height = 0.5
    paths = paths_of(SCENE, State(positions=[[0.0, 0.0, RADIUS + height]]), 40)
    fall = np.sqrt(2 * height / 9.81)
    times = np.array([0.9 * fall, fall + 0.1, fall + 0.2])
    speed = np.sqrt(2 * 9.81 * height)
    assert approach_speeds(paths).max() == pytest.approx(speed, rel=0.1)
    tracker = Tracker(noise=1e-3, forecast_drift=0.0, forecast_impact=0.1)
    found = spread_at(paths, times, tracker)[0, :, 0]
    assert found[0] == 0.0
    np.testing.assert_allclose(found[1:], (0.1 * speed * np.array([0.1, 0.2])) ** 2, rtol=0.25)


def test_drawn_motions_have_the_spread_that_is_stated() -> None:
    """1000 draws: deviations to 1 / sqrt(2000) = 2 %."""
    start = State(positions=[[0.0, 0.0, RADIUS + 0.5]], velocities=[[2.0, 0.0, 0.0]])
    paths = paths_of(SCENE, start, 40)
    tracker = Tracker(
        noise=1e-3, forecast_drift=0.02, forecast_impact=0.03, forecast_acceleration=0.5
    )
    many = Paths(
        *(np.repeat(one, 1000, axis=0) for one in (
            paths.positions, paths.velocities, paths.flights, paths.blows,
        )),
        paths.dt,
        True,
    )  # fmt: skip
    moves, speeds = drawn_motion(many, tracker, np.random.default_rng(3))
    times = np.arange(41) * paths.dt
    truth = np.sqrt(spread_at(paths, times, tracker)[0, 1:, 0])
    np.testing.assert_allclose(moves[:, 1:, 0].std(axis=0).mean(axis=1), truth, rtol=0.06)
    # the change of position over a step is that of its velocity, but for 1 / sqrt(12) of its noise
    steps = np.diff(moves, axis=1) / paths.dt - 0.5 * (speeds[:, 1:] + speeds[:, :-1])
    assert steps.std() == pytest.approx(np.sqrt(0.02 * paths.dt / 12), rel=0.05)
