# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Surfaces that move by a plan, whose twist changes: against closed forms, and to the bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene, Simulator, State
from rigid_gns_core.scenes.planned_motion import Moments, PlannedMotion
from scipy.spatial.transform import Rotation

R = 0.02  # [m]
START, BALL = -1.0, 0.5  # of racket and ball along x [m]


@pytest.fixture(scope='module')
def laws() -> Simulator:
    return load_simulator('laws')


def along_x(times: np.ndarray, places: np.ndarray, speeds: np.ndarray) -> PlannedMotion:
    zero = np.zeros(len(times))
    return PlannedMotion.of(
        times,
        Moments(
            np.stack([places, zero, zero], axis=1),
            np.tile([0.0, 0.0, 0.0, 1.0], (len(times), 1)),
            np.stack([speeds, zero, zero], axis=1),
            np.zeros((len(times), 3)),
        ),
    )


def racket(plan: PlannedMotion) -> Scene:
    plate = Plane((START, 0.0, 0.0), (1.0, 0.0, 0.0), length_x=4.0, length_y=4.0, plan=plan)
    return Scene(surfaces=(plate,), radius=R, restitution=1.0, friction=0.0)


@pytest.mark.parametrize('push', [5.0, 20.0, 50.0])
@pytest.mark.parametrize('points', [2, 11, 38])
def test_a_racket_that_accelerates_strikes_with_its_speed_then(
    laws: Simulator, push: float, points: int
) -> None:
    """An elastic wall at V meets v: 2 V - v, with V at the time of impact."""
    times, v = np.linspace(0.0, 0.8, points), -3.0
    plan = along_x(times, START + 0.2 * times + push / 2 * times**2, 0.2 + push * times)
    run = laws.rollout(racket(plan), [(BALL, 0.0, 0.0)], [(v, 0.0, 0.0)], steps=50)
    roots = np.roots([push / 2, 0.2 - v, START - BALL + R])
    meet = roots[roots > 0].min()
    after = 2 * (0.2 + push * meet) - v
    # the plan is a parabola, which a rate that is constant in a substep follows: rounding
    assert run.velocities[-1, 0, 0] == pytest.approx(after, rel=1e-9)
    where = BALL + v * meet + after * (run.times[-1] - meet)
    assert run.positions[-1, 0, 0] == pytest.approx(where, abs=1e-9)


def test_a_stroke_that_begins_later_and_stops_has_no_jumps(laws: Simulator) -> None:
    """It rests, strikes with a speed that jumps within a substep, and rests again."""
    speed, begin, end = 4.0, 0.1234, 0.3456
    knots = np.array([0.0, begin, begin, end, end, 0.8])
    places = START + speed * np.clip(knots - begin, 0.0, end - begin)
    plan = along_x(knots, places, np.array([0.0, 0.0, speed, speed, 0.0, 0.0]))
    for v, after in ((-3.0, 2 * speed + 3.0), (-0.2, -0.2)):  # struck, and not reached
        run = laws.rollout(racket(plan), [(BALL, 0.0, 0.0)], [(v, 0.0, 0.0)], steps=70)
        assert run.velocities[-1, 0, 0] == pytest.approx(after, rel=1e-9)


def turning(rate: float, arm: float, count: int = 21) -> PlannedMotion:
    """A body that begins to turn about z through a point `arm` behind it, W = `rate` t."""
    times = np.linspace(0.0, 1.0, count)
    angles = rate / 2 * times**2
    spins = np.stack([0 * times, 0 * times, rate * times], axis=1)
    turns = Rotation.from_rotvec(np.stack([0 * times, 0 * times, angles], axis=1))
    return PlannedMotion.of(
        times,
        Moments(
            np.tile([0.0, -arm, 0.0], (count, 1)), turns.as_quat(), np.zeros((count, 3)), spins
        ),
    )


def test_a_blade_that_begins_to_turn_strikes_a_ball_at_rest(laws: Simulator) -> None:
    """It meets the ball at an angle f with rate W = sqrt(2 a f): 2 W times the arm, along -n."""
    rate, arm, off = 20.0, 0.3, 0.15
    blade = Plane((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), length_x=2.0, length_y=2.0)
    blade = replace(blade, plan=turning(rate, arm))
    scene = Scene(surfaces=(blade,), radius=R, restitution=1.0, friction=0.0, gravity=0.0)
    run = laws.rollout(scene, [(-off, 0.0, 0.0)], steps=17)
    # distance of the centre from the plane through the pivot (0, -arm), turned by f, is R
    reach, at = np.hypot(off, arm), np.arctan2(off, arm)
    angle = at - np.arcsin(R / reach)
    spin = np.sqrt(2 * rate * angle)
    lever = np.sqrt(reach**2 - R**2)
    speed = 2 * spin * lever
    found = run.velocities[-1, 0]
    np.testing.assert_allclose(
        found, [-speed * np.cos(angle), -speed * np.sin(angle), 0.0], atol=1e-3 * speed
    )


def test_a_plan_with_one_twist_is_a_plane_with_that_twist(laws: Simulator) -> None:
    rng = np.random.default_rng(0)
    velocity, spin = np.array([0.3, -0.2, 0.4]), np.array([0.2, 0.5, -0.3])
    plane = Plane((0.0, 0.0, -0.1), length_x=2.0, length_y=2.0, friction=0.5)
    times = np.linspace(0.0, 2.0, 21)
    turns = Rotation.from_rotvec(times[:, None] * spin)
    plan = PlannedMotion.of(
        times,
        Moments(
            np.asarray(plane.point) + times[:, None] * velocity, turns.as_quat(),
            np.tile(velocity, (21, 1)), np.tile(spin, (21, 1)),
        ),
    )  # fmt: skip
    places = rng.uniform(-0.3, 0.3, (8, 3)) + [0.0, 0.0, 0.5]
    runs = [
        laws.rollout(
            Scene(surfaces=(one,), radius=R, restitution=0.6, friction=0.5), places, steps=40
        )
        for one in (
            replace(plane, velocity=velocity, angular_velocity=spin),
            replace(plane, plan=plan),
        )
    ]
    assert np.abs(runs[0].velocities[-1] - runs[0].velocities[0]).max() > 0.5  # blows
    assert np.abs(runs[1].positions - runs[0].positions).max() < 1e-10


def test_a_lift_that_starts_and_stops_carries_what_rests_on_it(laws: Simulator) -> None:
    """Up by 0.5 m with at most 5.1 m/s^2: nothing leaves it, and nothing sinks in."""
    times = np.linspace(0.0, 1.0, 41)
    phase = 2 * np.pi * times
    places = 0.5 * (times - np.sin(phase) / (2 * np.pi))
    plan = along_x(times, places, 0.5 * (1 - np.cos(phase)))
    swap = [2, 1, 0]
    moments = plan.moments
    plan = PlannedMotion.of(
        times,
        moments._replace(
            positions=moments.positions[:, swap], velocities=moments.velocities[:, swap]
        ),
    )
    scene = Scene(surfaces=(Plane(plan=plan),), radius=R, restitution=0.5, friction=0.5)
    start = State(positions=[(0.0, 0.0, R), (0.0, 0.0, 3 * R)])
    run = laws.rollout(scene, start.positions, steps=100)
    floor = plan.at(run.times).positions[:, 2]
    heights = (run.positions[..., 2] - floor[:, None]) / R - [1.0, 3.0]
    # between the points of a plan a cubic is off a sine by 1e-6 m
    assert np.abs(heights).max() < 1e-3
    assert run.positions[-1, 0, 2] == pytest.approx(0.5 + R, abs=1e-5)


def test_steps_blocks_and_samples_give_the_same_bytes(laws: Simulator) -> None:
    scene = replace(
        racket(turning(15.0, 0.4)),
        surfaces=(
            Plane((0.0, 0.0, -0.5)),
            Plane((-0.1, 0.0, 0.0), (1.0, 0.0, 0.0), length_x=1, length_y=1,
                  plan=turning(15.0, 0.4)),
        ),
    )  # fmt: skip
    places = np.array([(-0.3, 0.0, 0.0), (-0.4, 0.1, 0.1)])
    whole = laws.rollout(scene, places, steps=60)
    one = laws.start(scene, places)
    states = [one.step() for _ in range(60)]
    assert np.stack([s.positions for s in states]).tobytes() == whole.positions[1:].tobytes()
    starts = State.unchecked(*(np.stack([v, v]) for v in vars(State(positions=places)).values()))
    samples = laws.rollout_samples(scene, starts, 60)
    for k in range(2):
        assert samples.positions[k].tobytes() == whole.positions.tobytes()
        assert samples.velocities[k].tobytes() == whole.velocities.tobytes()
    assert np.abs(np.diff(whole.velocities[:, 0, 0])).max() > 0.1  # the blade struck


def test_no_centre_passes_a_plate_that_shakes(laws: Simulator) -> None:
    times = np.linspace(0.0, 1.0, 201)
    places, speeds = START + 1.2 * np.sin(40.0 * times) ** 2, 48.0 * np.sin(80.0 * times)
    scene = racket(along_x(times, places, speeds))
    balls = [(BALL + 0.1 * k, 0.1 * k, 0.0) for k in range(5)]
    run = laws.rollout(scene, balls, [(-5.0, 0.0, 0.0)] * 5, steps=60)
    plate = scene.surfaces[0].plan.at(run.times).positions[:, 0]
    assert (run.positions[..., 0] - plate[:, None]).min() > 0.0
