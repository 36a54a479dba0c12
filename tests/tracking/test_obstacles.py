# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balls off obstacles and planes that move, within a window: closed forms without air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import ContactLaw, Obstacle, Plane, Scene
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.planned_motion import Moments, PlannedMotion
from rigid_gns_core.tracking import estimate_state
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path
from rigid_gns_core.tracking.environment import Environment
from rigid_gns_core.tracking.kinks import kinks
from rigid_gns_core.tracking.path_slopes import path_and_slopes
from scipy.optimize import brentq
from tracking_windows import tracking_window

R, NOISE, RATE = 0.02, 1e-3, 240.0
PULL = np.array([0.0, 0.0, -9.81])
E, MU, KAPPA = 0.8, 0.2, 0.4
LAW = ContactLaw(restitution=E, friction=MU)
SCENE = Scene(surfaces=(), radius=R)

SPHERE = Obstacle('sphere', (0.0, 0.0, 0.0), radius=0.1, contact=LAW)
RIM = Obstacle('ring', (0.0, 0.0, 0.0), radius=0.15, thickness=0.012, contact=LAW)
WALL = Plane((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), contact=LAW)
# obstacle and start: falls on a sphere, on the near side of a rim and on the far side from within
FALLS = {
    'sphere': (SPHERE, [0.04, -0.02, 0.35], [0.3, 0.1, -0.5], [5.0, -20.0, 10.0]),
    'rim': (RIM, [-0.45, 0.03, 0.25], [1.25, 0.0, 0.15], [0.0, 30.0, 0.0]),
    'within': (RIM, [-0.05, 0.02, 0.20], [1.0, 0.2, -0.3], [0.0, 0.0, 0.0]),
}


def blow(
    v: np.ndarray, w: np.ndarray, n: np.ndarray, surface: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Restitution along the normal, Coulomb friction or grip across it, relative to a surface."""
    v = v - surface
    push = -(1 + E) * (v @ n)
    slip = v - (v @ n) * n + np.cross(w, -R * n)
    size = np.linalg.norm(slip)
    kick = -min(MU * push, size * KAPPA / (1 + KAPPA)) * slip / max(size, 1e-300)
    return v + push * n + kick + surface, w + np.cross(-R * n, kick) / (KAPPA * R**2)


def parabola(p: np.ndarray, v: np.ndarray, t: np.ndarray) -> np.ndarray:
    t = np.asarray(t)[..., None]
    return p + v * t + 0.5 * PULL * t**2


def off_sphere_or_rim(name: str, times: np.ndarray) -> tuple[Scene, np.ndarray, float]:
    """Scene, true states at times, shape (m, 9), and the time of the impact."""
    obstacle, p, v, w = FALLS[name][0], *(np.array(one) for one in FALLS[name][1:])

    def closest(place: np.ndarray) -> np.ndarray:
        if obstacle.shape == 'sphere':
            return np.zeros(3)
        around = np.array([place[0], place[1], 0.0])
        return obstacle.radius * around / np.linalg.norm(around)

    far = R + (obstacle.radius if obstacle.shape == 'sphere' else obstacle.thickness / 2)

    def gap(t: float) -> float:
        place = parabola(p, v, t)
        return float(np.linalg.norm(place - closest(place))) - far

    grid = np.linspace(0.0, 0.5, 5001)
    first = grid[np.argmax([gap(t) < 0 for t in grid])]
    hit = brentq(gap, first - 1e-4, first, xtol=1e-15)
    at, speed = parabola(p, v, hit), v + PULL * hit
    n = (at - closest(at)) / far
    after, spin = blow(speed, w, n, np.zeros(3))
    return (
        replace(SCENE, obstacles=obstacle),
        states(times, hit, (p, v, w), (at, after, spin)),
        hit,
    )


def states(times: np.ndarray, hit: float, before: tuple, after: tuple) -> np.ndarray:
    found = np.empty((len(times), 9))
    for row, t in zip(found, times, strict=True):
        p, v, w = before if t < hit else after
        t = t if t < hit else t - hit
        row[:] = [*parabola(p, v, t), *(v + PULL * t), *w]
    return found


def follow(scene: Scene, start: np.ndarray, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States of the path at times, and impacts, with planes as at the first time."""
    model = BallModel.of(scene)
    found, impacts = np.zeros((len(times), 9)), np.zeros((64, 3))
    laws = (model.ball, model.planes, model.laws)
    count, _ = path(start, times[0], times, *laws, FREE, found, impacts)
    return found, impacts[:count]


@pytest.mark.parametrize('name', FALLS)
def test_a_path_meets_the_closest_point(name: str) -> None:
    times = np.arange(0.0, 0.4, 1 / RATE)
    scene, true, hit = off_sphere_or_rim(name, times)
    found, impacts = follow(scene, true[0], times)
    # the step's own parabola is off by rounding in a vacuum
    np.testing.assert_allclose(impacts[0, 0], hit, atol=1e-10)
    before = times < times[np.searchsorted(times, hit)] + 0.05
    np.testing.assert_allclose(found[before], true[before], atol=1e-7)


@pytest.mark.parametrize('name', FALLS)
def test_an_estimate_goes_through_a_contact_with_an_obstacle(name: str) -> None:
    """Errors of position and velocity in 12 draws, in deviations that the estimate tells.

    Their squares are chi-squared of 72 degrees: 43 to 109 but in 1 of 100 cases; not linear.
    """
    times = np.arange(0.0, 0.3, 1 / RATE)
    scene, true, hit = off_sphere_or_rim(name, times)
    last = int(np.searchsorted(times, hit)) + 8
    times, true, total = times[:last], true[:last], 0.0
    rng = np.random.default_rng(1)
    for _ in range(12):
        places = true[:, None, :3] + rng.normal(0.0, NOISE, (last, 1, 3))
        places[5] = np.nan
        known = estimate_state(scene, times, places, noise=NOISE)
        off = np.concatenate([known.state.positions[0], known.state.velocities[0]]) - true[-1, :6]
        total += off @ np.linalg.solve(known.covariance[0, :6, :6], off)
        # 8 frames alone tell a velocity to 12 NOISE RATE / 8^1.5 = 37 mm/s; with those before it
        # is told by several times better
        blind = estimate_state(SCENE, times, places, noise=NOISE)
        assert known.covariance[0, 3, 3] < 0.5 * blind.covariance[0, 3, 3]
    assert 25.0 < total < 130.0


def test_a_contact_with_an_obstacle_is_no_unknown_blow() -> None:
    times = np.arange(0.0, 0.3, 1 / RATE)
    scene, true, _ = off_sphere_or_rim('rim', times)
    assert not len(kinks(BallModel.of(scene), times, true[:, :3], NOISE))
    assert len(kinks(BallModel.of(SCENE), times, true[:, :3], NOISE))


def off_moving_wall(
    times: np.ndarray, speed: float, push: float
) -> tuple[Scene, np.ndarray, float]:
    """A wall that is at x = 0 at the last time, with `speed` and `push` along -x until then."""
    last = times[-1]
    p, v, w = np.array([-0.25, 0.0, 1.0]), np.array([3.0, 0.2, 1.0]), np.array([5.0, 10.0, 0.0])

    def wall(t: float) -> float:
        return -(speed * (t - last) + push / 2 * (t - last) ** 2)

    hit = brentq(lambda t: wall(t) - R - p[0] - v[0] * t, 0.0, last)
    surface = np.array([-speed - push * (hit - last), 0.0, 0.0])
    at = parabola(p, v, hit)
    after, spin = blow(v + PULL * hit, w, np.array([-1.0, 0.0, 0.0]), surface)
    plane = Plane((0.0, 0.0, 1.0), (-1.0, 0.0, 0.0), length_x=2.0, length_y=2.0, contact=LAW)
    if push:
        knots = np.array([-0.5, -0.2, 0.0])
        still, ones = np.zeros(3), np.ones(3)
        along = -(speed * knots + push / 2 * knots**2)
        plan = PlannedMotion.of(
            knots,
            Moments(
                np.stack([along, still, ones], axis=1),
                np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)),
                np.stack([-(speed + push * knots), still, still], axis=1),
                np.zeros((3, 3)),
            ),
        )
        plane = replace(plane, plan=plan)
    else:
        plane = replace(plane, velocity=(-speed, 0.0, 0.0))
    scene = replace(SCENE, surfaces=plane)
    return scene, states(times, hit, (p, v, w), (at, after, spin)), hit


@pytest.mark.parametrize('face', [1.0, -1.0])
@pytest.mark.parametrize(('speed', 'push'), [(2.0, 0.0), (2.5, 20.0)])
def test_an_estimate_goes_through_a_contact_with_a_wall_that_moves(
    speed: float, push: float, face: float
) -> None:
    """The wall is where the scene says at the last frame; before by its twist, or by its plan."""
    times = 7.0 + np.arange(0.0, 0.14, 1 / RATE)
    scene, true, hit = off_moving_wall(times - 7.0, speed, push)
    surface = scene.surfaces[0]
    if face < 0:  # a plate has two
        scene = replace(scene, surfaces=replace(surface, normal=(1.0, 0.0, 0.0)))
    places, seen = true[:, None, :3].copy(), np.searchsorted(times - 7.0, hit)
    assert 4 < seen < len(times) - 4
    known = estimate_state(scene, times, places, noise=1e-5)
    # exact but for the prior of the spin, and pieces of the plan
    np.testing.assert_allclose(known.state.positions[0], true[-1, :3], atol=1e-4)
    np.testing.assert_allclose(known.state.velocities[0], true[-1, 3:6], atol=5e-3)
    rng, total = np.random.default_rng(2), 0.0
    for _ in range(12):
        noisy = places + rng.normal(0.0, NOISE, places.shape)
        noisy[3] = np.nan
        known = estimate_state(scene, times, noisy, noise=NOISE)
        off = np.concatenate([known.state.positions[0], known.state.velocities[0]]) - true[-1, :6]
        total += off @ np.linalg.solve(known.covariance[0, :6, :6], off)
    assert 25.0 < total < 130.0  # as above


def test_a_window_knows_the_surfaces_that_bodies_carry() -> None:
    """A start with the wall is far better known than one without, and is asked for anew."""
    times = np.arange(0.0, 0.13, 1 / RATE)
    scene, true, _ = off_moving_wall(times, 2.0, 0.0)
    window = tracking_window(gravity=SCENE.gravity, radius=R, scene=SCENE, noise=NOISE)
    rng = np.random.default_rng(5)
    for k, state in enumerate(true):
        pose = np.concatenate([state[:3] + rng.normal(0.0, NOISE, 3), [0.0, 0.0, 0.0, 1.0]])
        frame = PoseArrayFrame(10**12 + round(k / RATE * 1e9), 'world', pose[None])
        window.add(frame, frame.stamp_ns)
    blind = window.estimate()[1]
    known = window.estimate(scene.surfaces)[1]
    assert window.estimate(scene.surfaces)[1] is known
    np.testing.assert_allclose(known.state.velocities[0], true[-1, 3:6], atol=0.1)
    assert known.covariance[0, 3, 3] < 0.5 * blind.covariance[0, 3, 3]
    again = window.estimate()[1]
    np.testing.assert_array_equal(again.state.velocities, blind.state.velocities)


def test_a_wall_that_is_somewhere_else_leaves_what_came_since() -> None:
    """Poses of a racket that do not fit are not believed more than the frames of the ball."""
    times = np.arange(0.0, 0.2, 1 / RATE)
    scene, true, _ = off_moving_wall(times, 2.0, 0.0)
    surface = replace(scene.surfaces[0], point=(0.3, 0.0, 1.0))
    places = true[:, None, :3] + np.random.default_rng(3).normal(0, NOISE, (len(times), 1, 3))
    found = estimate_state(replace(scene, surfaces=surface), times, places, noise=NOISE)
    np.testing.assert_allclose(found.state.velocities[0], true[-1, 3:6], atol=0.1)


def test_a_racket_that_turns_strikes_with_its_velocity_there() -> None:
    """A blade that turns about y hits a ball at rest without gravity: n and V + W x r at the hit.

    The path in steps is followed with the blade's pose at each time, not by a step's parabola in
    its frame: Newton's method to 1e-13 m.
    """
    spin, arm = 8.0, 0.3
    blade = Plane(
        (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), length_x=1.0, length_y=1.0, contact=LAW,
        angular_velocity=(0.0, spin, 0.0),
    )  # fmt: skip
    scene = replace(SCENE, surfaces=blade, gravity=0.0)
    start = np.array([-0.1, 0.0, -arm, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    found, impacts = follow(scene, start, np.arange(0.0, 0.2, 1 / RATE))
    time = impacts[0, 0]
    turn = spin * time  # about y: -x goes to (-cos, 0, sin)
    n = np.array([-np.cos(turn), 0.0, np.sin(turn)])
    assert abs(start[:3] @ n - R) < 1e-12
    foot = start[:3] - R * n
    after, _ = blow(np.zeros(3), np.zeros(3), n, np.cross([0.0, spin, 0.0], foot))
    np.testing.assert_allclose(found[-1, 3:6], after, atol=1e-9)


def test_a_ball_comes_to_roll_on_a_belt_and_on_the_end_of_a_post() -> None:
    """Laid on a belt it takes 2/7 of its speed; on a post it keeps 5/7 of its own.

    On the post it hops by 0.13 mm, which is what the tolerances allow for.
    """
    law = ContactLaw(restitution=0.5, friction=0.4)
    belt = replace(SCENE, surfaces=Plane(surface_velocity=(0.5, 0.0, 0.0), contact=law))
    found, _ = follow(belt, np.array([0.0, 0, R, 0, 0, 0, 0, 0, 0]), np.linspace(0, 0.5, 121))
    np.testing.assert_allclose(found[-1, 3:5], [0.5 * 2 / 7, 0.0], atol=1e-3)
    np.testing.assert_allclose(found[:, 2], R, atol=5e-5)
    post = Obstacle('cylinder', (0, 0, -0.1), radius=0.3, length=0.2, contact=law)
    scene = replace(SCENE, obstacles=post)
    start = np.array([0.0, 0, R, 0.35, 0, 0, 0, 0, 0])
    found, _ = follow(scene, start, np.linspace(0, 0.5, 121))
    np.testing.assert_allclose(found[-1, 3], 0.35 * 5 / 7, atol=1e-3)
    np.testing.assert_allclose(found[:, 2], R, atol=1.5e-4)


@pytest.mark.parametrize('name', ['rim', 'wall'])
def test_slopes_through_a_contact_are_those_of_differences(name: str) -> None:
    times = np.arange(0.0, 0.25, 1 / RATE)
    if name == 'rim':
        scene, true, _ = off_sphere_or_rim('rim', times)
    else:
        scene, true, _ = off_moving_wall(times, 2.0, 0.0)
        scene = replace(scene, surfaces=replace(scene.surfaces[0], point=(0.5, 0.0, 1.0)))
    model, start = BallModel.of(scene), true[0]
    laws, stamps = (model.ball, model.planes, model.laws), times[[0, 30, 59]]
    found, slopes = np.zeros((3, 9)), np.zeros((3, 9, 9))
    impacts = np.zeros((8, 3))
    count, _ = path_and_slopes(start, np.ones(9), 0.0, stamps, *laws, FREE, found, slopes, impacts)
    assert count == 1
    for j, move in enumerate([1e-5] * 3 + [1e-4] * 3 + [1e-2] * 3):
        ends = []
        for sign in (1, -1):
            moved = start.copy()
            moved[j] += sign * move
            ends.append(follow(scene, moved, stamps)[0])
        central = (ends[0] - ends[1]) / (2 * move)
        np.testing.assert_allclose(
            slopes[:, :, j], central, atol=1e-3 * max(1.0, abs(central).max())
        )


def test_a_lost_pose_at_the_origin_is_none_inside_an_obstacle() -> None:
    post = Obstacle('cylinder', (0.0, 0.0, 0.0), radius=0.05, length=0.3)
    assert Environment.of(replace(SCENE, obstacles=post)).overlaps_origin()
    assert not Environment.of(replace(SCENE, obstacles=RIM)).overlaps_origin()
