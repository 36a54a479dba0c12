# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forecasts at times that are not steps of the model, and their spread."""

from __future__ import annotations

from csv_balls import bounces, RADIUS, RESTITUTION
import numpy as np
import pytest
from rigid_gns_core.forecasts.lead_times import forecast_at, kicks_at, positions_at
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import State, Trajectory
from rigid_gns_core.tracking import StateEstimate

SCENE = Scene(
    surfaces=(Plane(restitution=RESTITUTION, friction=0.0),),
    radius=RADIUS,
    restitution=1.0,
    friction=0.0,
    rolling_friction=0.0,
)
G = np.array([0.0, 0.0, -9.81])


def sampled(times: np.ndarray, acceleration: np.ndarray, dt: float) -> Trajectory:
    """Steps of a motion of constant acceleration from (1, 2, 3) with velocity (4, 5, 6)."""
    t = np.arange(int(times[-1] / dt) + 2)[:, None, None] * dt
    velocities = [4.0, 5.0, 6.0] + acceleration * t
    positions = [1.0, 2.0, 3.0] + t * [4.0, 5.0, 6.0] + 0.5 * acceleration * t**2
    turns = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (len(t), 1, 4))
    return Trajectory(
        positions=positions,
        velocities=velocities,
        quaternions=turns,
        angular_velocities=np.zeros_like(positions),
        dt=dt,
    )


@pytest.mark.parametrize('acceleration', [G, G + [-2.0, 0.0, 0.0], 0.0 * G])
def test_parabolas_are_exact(acceleration: np.ndarray) -> None:
    times = np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 50))
    found = positions_at(sampled(times, acceleration, 0.014), times, G, exact=True)
    t = times[:, None]
    truth = [1.0, 2.0, 3.0] + t * [4.0, 5.0, 6.0] + 0.5 * acceleration * t**2
    np.testing.assert_allclose(found[:, 0], truth, atol=1e-12)


def test_velocities_of_a_step_before_give_straight_lines() -> None:
    times = np.array([0.005, 0.014, 0.021])
    run = sampled(times, G, 0.014)
    found = positions_at(run, times, G, exact=False)
    np.testing.assert_allclose(found[1], run.positions[1], atol=1e-15)
    np.testing.assert_allclose(found[2], run.positions[1:3].mean(axis=0), atol=1e-15)


def test_bounces_are_met_between_steps() -> None:
    """Steps of 14 ms against the closed form: a straight line through a bounce is 1 cm off."""
    start = State(positions=[[0.0, 0.0, 0.3]], velocities=[[3.0, 0.2, 1.0]])
    times = np.linspace(1e-4, 1.0, 1500)
    run = load_simulator().rollout(SCENE, steps=72, **vars(start))
    truth = bounces(times, [0.0, 0.0, 0.3], [3.0, 0.2, 1.0])
    off = np.abs(positions_at(run, times, G, exact=True)[:, 0] - truth).max()
    line = np.abs(positions_at(run, times, G, exact=False)[:, 0] - truth).max()
    assert line > 5e-3
    # the engine's own error in two bounces, 1e-5 m and less, is left
    assert off < 2e-5


def test_the_spread_of_a_flight_is_that_of_its_start() -> None:
    """Of p + v t it is P + t (C + C^T) + t^2 V, with samples to 1 / sqrt(2 x 400) = 4 %."""
    covariance = np.zeros((1, 9, 9))
    root = np.random.default_rng(1).normal(size=(6, 6)) * 1e-3
    covariance[0, :6, :6] = root @ root.T
    state = State(positions=[[0.0, 0.0, 50.0]], velocities=[[3.0, 0.0, 1.0]])
    times = np.array([0.2, 0.5])
    found = forecast_at(
        load_simulator(), SCENE, StateEstimate(state, covariance), times, samples=400
    )
    assert found.covariance is not None
    p, c, v = covariance[0, :3, :3], covariance[0, :3, 3:6], covariance[0, 3:6, 3:6]
    for time, spread in zip(times, found.covariance[:, 0], strict=True):
        truth = p + time * (c + c.T) + time**2 * v
        assert np.linalg.norm(spread - truth) < 5 * 0.04 * np.linalg.norm(truth)
    truth = bounces(times, [0.0, 0.0, 50.0], [3.0, 0.0, 1.0])
    np.testing.assert_allclose(found.positions[:, 0], truth, atol=1e-9)


def test_what_is_not_known_has_no_spread() -> None:
    covariance = np.full((2, 9, 9), np.nan)
    covariance[1] = 1e-6 * np.eye(9)
    state = State(positions=[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
    simulator, estimate = load_simulator(), StateEstimate(state, covariance)
    found = forecast_at(simulator, SCENE, estimate, np.array([0.1]), samples=8)
    assert found.covariance is not None
    assert np.isnan(found.covariance[0, 0]).all() and np.isfinite(found.covariance[0, 1]).all()
    assert forecast_at(simulator, SCENE, estimate, np.array([0.1]), samples=0).covariance is None


def test_impacts_of_a_rollout_widen_what_comes_after() -> None:
    """A ball dropped from h: u = sqrt(2 g h) at t = sqrt(2 h / g), to a step of 14 ms."""
    height = 0.5
    run = load_simulator().rollout(SCENE, [[0.0, 0.0, RADIUS + height]], steps=40)
    fall = np.sqrt(2 * height / 9.81)
    times = np.array([0.9 * fall, fall + 0.1, fall + 0.2])
    found = kicks_at(run, times, G)
    speed = np.sqrt(2 * 9.81 * height)
    assert found[0, 0] == 0.0
    np.testing.assert_allclose(found[1:, 0], (speed * np.array([0.1, 0.2])) ** 2, rtol=0.25)
