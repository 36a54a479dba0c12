# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Path of one ball: closed forms, and a reference integration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, Plane, Scene
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path
from rigid_gns_core.tracking.path_slopes import path_and_slopes
from scipy.integrate import solve_ivp

RADIUS, G = 0.03, 9.81
BALL = {'radius': RADIUS, 'mass': 0.21}
SMOOTH = ContactLaw(restitution=0.8, friction=0.0)


def follow(
    scene: Scene, start: list[float], stamps: np.ndarray, on: int = FREE
) -> tuple[np.ndarray, np.ndarray]:
    """States at stamps, shape (m, 9), and impacts, shape (impacts, 3)."""
    model = BallModel.of(scene)
    states, impacts = np.zeros((len(stamps), 9)), np.zeros((64, 3))
    laws = (model.ball, model.planes, model.laws)
    count, _ = path(np.array(start), 0.0, stamps, *laws, on, states, impacts)
    return states, impacts[:count]


def test_bounces_are_those_of_the_closed_form() -> None:
    """Dropped from h: impacts at t0, t0 + 2 e t0, ...; only rounding differs."""
    scene = Scene(surfaces=Plane(contact=SMOOTH), **BALL)
    height = 0.5
    _, impacts = follow(scene, [0, 0, RADIUS + height, 1, 0, 0, 0, 0, 0], np.array([2.0]))
    first = np.sqrt(2 * height / G)
    times = first * (1 + 2 * np.cumsum(0.8 ** np.arange(1, 4)))
    np.testing.assert_allclose(impacts[:4, 0], [first, *times], atol=1e-9)
    np.testing.assert_allclose(impacts[:4, 2], G * first * 0.8 ** np.arange(4), atol=1e-8)


def test_flight_in_air_is_that_of_a_reference() -> None:
    """Table tennis, 20 m/s and 100 turns a second: 1e-6 m is far below a tracker's noise."""
    air = Air(drag_coefficient=0.4, drag_slope=0.3, lift_coefficient=0.4, spin_decay=0.2)
    scene = Scene(surfaces=(), radius=0.02, mass=0.0027, air=air)
    start = [0.0, 0.0, 1.0, 18.0, 2.0, 8.0, 100.0, -600.0, 150.0]
    stamps = np.linspace(0.05, 1.0, 20)
    states, _ = follow(scene, start, stamps)
    x, y, z, *wind, load, radius, drag, slope, lift, half, decay = BallModel.of(scene).ball[0, :13]

    def rate(time: float, state: np.ndarray) -> np.ndarray:
        u, spin = state[3:] - wind, np.array(start[6:]) * np.exp(-decay * time)
        turning, speed = np.cross(spin, u), np.linalg.norm(u)
        ratio = radius * np.linalg.norm(turning) / speed**2
        force = lift * ratio / (ratio + half) * speed**2 * turning / np.linalg.norm(turning)
        pull = [x, y, z] + load * (force - (drag + slope * ratio) * speed * u)
        return np.concatenate([state[3:], pull])

    reference = solve_ivp(rate, (0, 1), start[:6], t_eval=stamps, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(states[:, :6], reference.y.T, atol=1e-6)


@pytest.mark.parametrize('inertia', [0.4, 2 / 3])
def test_a_ball_that_slides_comes_to_roll(inertia: float) -> None:
    """From v without spin: v / (1 + kappa) after v kappa / ((1 + kappa) mu g)."""
    scene = Scene(surfaces=Plane(contact=ContactLaw(friction=0.2)), inertia_factor=inertia, **BALL)
    speed = 2.0
    end = speed * inertia / ((1 + inertia) * 0.2 * G)
    stamps = np.array([0.5 * end, end, end + 0.3])
    # the start's spin is what comes to that of rolling
    states, _ = follow(scene, [0, 0, RADIUS, speed, 0, 0, 0, -speed / RADIUS, 0], stamps, on=0)
    rolling = speed / (1 + inertia)
    np.testing.assert_allclose(states[:, 3], [speed - 0.1 * G * end, rolling, rolling], rtol=1e-9)
    np.testing.assert_allclose(states[1:, 7], rolling / RADIUS, rtol=1e-9)
    assert abs(states[1, 0] - 0.5 * (speed + rolling) * end) < 1e-9


def test_rolling_slows_by_a_constant_and_a_part_of_the_speed() -> None:
    """dv/dt = -(a + b v): v = (v0 + a/b) exp(-b t) - a/b; steps of second order meet 1e-5."""
    law = ContactLaw(friction=0.2, rolling_friction=0.006, rolling_friction_slope=0.003)
    scene = Scene(surfaces=Plane(contact=law), **BALL)
    a, b = 0.006 * G / 1.4, 0.003 * G / 1.4
    stamps = np.linspace(0.5, 5.0, 10)
    states, _ = follow(scene, [0, 0, RADIUS, 1, 0, 0, 0, 0, 0], stamps, on=0)
    np.testing.assert_allclose(states[:, 3], (1 + a / b) * np.exp(-b * stamps) - a / b, atol=1e-5)
    rested, _ = follow(scene, [0, 0, RADIUS, 1, 0, 0, 0, 0, 0], np.array([60.0]), on=0)
    np.testing.assert_array_equal(rested[0, 3:], np.zeros(6))


@pytest.mark.parametrize('beta', [-0.5, 0.0, 0.4])
def test_a_bounce_that_grips_turns_the_slip_by_beta(beta: float) -> None:
    law = ContactLaw(restitution=0.9, friction=5.0, tangential_restitution=beta)
    scene = Scene(surfaces=Plane(contact=law), inertia_factor=2 / 3, **BALL)
    start = [0, 0, RADIUS + 1e-9, 1.0, -0.5, -3.0, 20.0, 10.0, 5.0]
    states, _ = follow(scene, start, np.array([1e-6]))

    def slip(state: np.ndarray) -> np.ndarray:
        return (state[3:6] + np.cross(state[6:], [0, 0, -RADIUS]))[:2]

    np.testing.assert_allclose(slip(states[0]), -beta * slip(np.array(start)), atol=1e-9)
    assert abs(states[0, 5] - 2.7) < 1e-4


def test_a_fast_ball_does_not_pass_a_plane_and_flies_over_its_end() -> None:
    """At 30 m/s a step is longer than the ball is wide."""
    plate = Plane(length_x=1.0, length_y=1.0, contact=SMOOTH)
    scene = Scene(surfaces=plate, **BALL)
    states, impacts = follow(scene, [0, 0, 1.0, 0, 0, -30, 0, 0, 0], np.array([0.05]))
    assert len(impacts) == 1 and states[0, 5] > 0
    states, impacts = follow(scene, [0.7, 0, 1.0, 0, 0, -30, 0, 0, 0], np.array([0.05]))
    assert len(impacts) == 0 and states[0, 2] < 0


def test_a_ball_rolls_into_a_cushion_and_over_an_end() -> None:
    law = ContactLaw(friction=0.2)
    table = Plane(length_x=2.0, length_y=2.0, contact=law)
    cushion = Plane((-1.0, 0, 0), (1, 0, 0), contact=ContactLaw(restitution=0.5, friction=0.0))
    scene = Scene(surfaces=(table, cushion), **BALL)
    states, impacts = follow(scene, [0, 0, RADIUS, -1, 0, 0, 0, 0, 0], np.array([1.0, 9.0]), on=0)
    np.testing.assert_allclose(impacts[0], [1 - RADIUS, 1, 1], atol=1e-9)
    # v = 0.5 and a spin of -1 / r: friction turns it to 0.5 - (1 + 0.5) 2 / 7
    assert abs(states[0, 3] - (0.5 - 0.2 * G * RADIUS)) < 1e-9
    assert abs(states[1, 3] - (0.5 - 3 / 7)) < 1e-9
    states, _ = follow(scene, [0.9, 0, RADIUS, 1, 0, 0, 0, 0, 0], np.array([0.6]), on=0)
    assert states[0, 2] < -1.0  # 0.5 s of fall


AIR = Air(
    drag_coefficient=0.4, drag_slope=0.3, lift_coefficient=0.4, spin_decay=0.3, wind=(1, 2, 0)
)
# half of the drag goes within the speeds of these starts
CRISIS = replace(AIR, drag_drop=0.2, crisis_speed=4.0)
GRIP = ContactLaw(restitution=0.9, friction=0.3, rolling_friction=0.01)
# flight and a bounce; a bounce that slides and rolls into a cushion; flight with gaps
STARTS = {
    'bounce': ([0.0, 0.0, 0.3, 2.0, 0.0, -1.0, 0.0, 5.0, 3.0], FREE),
    'rolling': ([0.0, 0.0, RADIUS, -1.5, 0.3, 0.0, 0.0, 5.0, 3.0], 0),
    'flight': ([0.0, 0.0, 9.0, 2.0, 9.0, 3.0, 100.0, 50.0, 30.0], FREE),
}


@pytest.mark.parametrize('air', [None, AIR])
@pytest.mark.parametrize('spin', [(5.0, 3.0, 2.0), (40.0, -60.0, 2.0), (0.0, 0.0, 0.0)])
def test_slopes_on_a_surface_are_those_of_differences(
    spin: tuple[float, float, float], air: Air | None
) -> None:
    """Frame by frame, sliding and then rolling with resistance, on a surface that is tilted.

    Central differences with wide steps: 5e-3 of the largest slope, as air and the tilt turn the
    slip while it comes to an end.
    """
    law = ContactLaw(restitution=0.5, friction=0.2, rolling_friction=0.02)
    scene = Scene(surfaces=Plane(normal=(0.002, 0.0, 1.0), contact=law), air=air, **BALL)
    model = BallModel.of(scene)
    laws, stamps = (model.ball, model.planes, model.laws), np.arange(0.0, 0.8, 0.02)
    along = np.array([1.0, 0.3, -0.002])
    start = np.array([*(RADIUS * model.planes[0, 9:12]), *along, *spin])
    states, slopes = np.zeros((40, 9)), np.zeros((40, 9, 9))
    path_and_slopes(start, np.ones(9), 0.0, stamps, *laws, 0, states, slopes, np.zeros((8, 3)))
    for j, move in enumerate([1e-4] * 2 + [1e-3] * 2 + [1e-1] * 3):
        part = (0, 1, 3, 4, 6, 7, 8)[j]
        ends = []
        for sign in (1, -1):
            moved = start.copy()
            moved[part] += sign * move
            ends.append(follow(scene, moved.tolist(), stamps, 0)[0])
        central = (ends[0] - ends[1]) / (2 * move)
        np.testing.assert_allclose(
            slopes[:, :, part], central, atol=5e-3 * max(1, abs(central).max())
        )


@pytest.mark.parametrize('air', [None, AIR, CRISIS])
@pytest.mark.parametrize('name', STARTS)
def test_slopes_are_those_of_differences(name: str, air: Air | None) -> None:
    """Against central differences with wide steps: 1e-4 of the largest slope."""
    cushion = Plane((-1.0, 0, 0), (1, 0, 0), contact=ContactLaw(restitution=0.5, friction=0.1))
    scene = Scene(surfaces=(Plane(contact=GRIP), cushion), air=air, **BALL)
    model = BallModel.of(scene)
    laws, stamps = (model.ball, model.planes, model.laws), np.array([0.005, 0.2, 0.205, 0.8])
    start, on = np.array(STARTS[name][0]), STARTS[name][1]
    states, slopes = np.zeros((4, 9)), np.zeros((4, 9, 9))
    path_and_slopes(start, np.ones(9), 0.0, stamps, *laws, on, states, slopes, np.zeros((8, 3)))
    np.testing.assert_array_equal(states, follow(scene, start.tolist(), stamps, on)[0])
    for j, move in enumerate([1e-4] * 3 + [1e-3] * 3 + [1e-1] * 3):
        if on != FREE and j in (2, 5):  # a ball on a surface is not moved off it
            continue
        ends = []
        for sign in (1, -1):
            moved = start.copy()
            moved[j] += sign * move
            ends.append(follow(scene, moved.tolist(), stamps, on)[0])
        central = (ends[0] - ends[1]) / (2 * move)
        np.testing.assert_allclose(
            slopes[:, :, j], central, atol=1e-4 * max(1, abs(central).max())
        )


def test_a_part_of_the_start_that_is_held_has_no_slope() -> None:
    scene = Scene(surfaces=Plane(contact=GRIP), **BALL)
    model = BallModel.of(scene)
    laws, varied = (model.ball, model.planes, model.laws), np.repeat([1.0, 1.0, 0.0], 3)
    states, slopes = np.zeros((1, 9)), np.ones((1, 9, 9))
    start, stamps = np.array(STARTS['bounce'][0]), np.array([0.6])
    path_and_slopes(start, varied, 0.0, stamps, *laws, FREE, states, slopes, np.zeros((8, 3)))
    assert not slopes[..., 6:].any() and slopes[..., :6].any()
