# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Velocities from windows that hold a contact, against closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import rotate_quaternions
from rigid_gns_core.tracking.coasting import coast
from rigid_gns_core.tracking.environment import Environment
from rigid_gns_core.tracking.motion_models import FLIGHT, Motion, ROLLING
from rigid_gns_core.tracking.velocity import estimate_motion

DT, RADIUS = 0.1, 1.0
UP = {
    'z': (0.0, 0.0, 1.0),
    'y': (0.0, 1.0, 0.0),
    'minus x': (-1.0, 0.0, 0.0),
    'askew': (0.48, 0.6, 0.64),
}


def level_scene(up: tuple[float, float, float], **values: float) -> Scene:
    gravity = tuple(-9.81 * np.array(up))
    return Scene(surfaces=(Plane(normal=up),), gravity=gravity, **values)


def bouncing(times: np.ndarray, impact: float, scene: Scene, along: float) -> tuple:
    """Return a sphere without friction that hits the floor at `impact`, at 8 m/s, and flies off.

    Returns:
        Positions, shape (frames, 1, 3), and velocities of the same shape.
    """
    plane = scene.surfaces[0]
    normal, side = np.array(plane.normal), np.array(plane.direction)
    gravity = np.asarray(scene.gravity)
    bounce = float(scene.surface_values('restitution')[0] * np.mean(scene.restitution))
    t = (times - impact)[:, None]
    speed = np.where(t < 0, -8.0, 8.0 * bounce) * normal + along * side + gravity * t
    place = np.where(t < 0, -8.0, 8.0 * bounce) * t * normal + along * side * t
    place = place + 0.5 * gravity * t**2 + RADIUS * normal
    return place[:, None], speed[:, None]


def estimate(times: np.ndarray, places: np.ndarray, scene: Scene, noise: float) -> Motion:
    count = places.shape[1]
    return estimate_motion(
        times,
        places,
        np.tile([0.0, 0.0, 0.0, 1.0], (len(times), count, 1)),
        environment=Environment.of(scene),
        radii=np.full(count, RADIUS),
        noise=noise,
    )


@pytest.mark.parametrize('up', UP.values(), ids=UP)
@pytest.mark.parametrize('ago', [0.03, 0.07, 0.13, 0.18, 0.25, 0.36])
def test_a_bounce_in_the_window_does_not_spoil_it(
    up: tuple[float, float, float], ago: float
) -> None:
    scene = level_scene(up, friction=0.0, restitution=0.8)
    times = 7.0 + DT * np.arange(6)
    places, speeds = bouncing(times, times[-1] - ago, scene, along=3.0)
    motion = estimate(times, places, scene, noise=1e-4)
    np.testing.assert_allclose(motion.velocities[0], speeds[-1, 0], atol=1e-2)
    assert motion.kinds[0] == FLIGHT


@pytest.mark.parametrize('ago', [0.05, 0.15, 0.25])
def test_errors_after_a_bounce_are_those_claimed(ago: float) -> None:
    scene, noise, draws = level_scene(UP['z'], friction=0.0, restitution=0.8), 5e-3, 3000
    times = DT * np.arange(6)
    places, speeds = bouncing(times, times[-1] - ago, scene, along=3.0)
    rng = np.random.default_rng(0)
    # far from each other, and each at a place of its own
    apart = np.zeros((1, draws, 3))
    apart[0, :, 0] = 100.0 * np.arange(draws)
    noisy = places + apart + rng.normal(0.0, noise, (len(times), draws, 3))
    motion = estimate(times, noisy, scene, noise)
    off = motion.velocities - speeds[-1]
    # the law of impact may help more than claimed; 3 frames in 1000 may be mistaken
    ratio = np.median(np.abs(off), axis=0) / 0.6745 / np.median(motion.errors)
    assert (ratio < 1.3).all()
    assert (np.linalg.norm(off, axis=1) < 6.0 * motion.errors).mean() > 0.99


def test_a_wall_and_an_unknown_contact_differ_from_flight() -> None:
    wall = Plane((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), restitution=1.0)
    scene = Scene(surfaces=(wall,), friction=0.0, restitution=1.0)
    times = DT * np.arange(6)
    hit = 0.44
    gravity = np.asarray(scene.gravity)
    t = times[:, None]
    fall = 0.5 * gravity * t**2
    there = np.abs(12.0 * (times - hit)) + RADIUS
    places = np.c_[there, np.zeros((6, 2))] + fall + [0.0, 0.0, 50.0]
    motion = estimate(times, places[:, None], scene, noise=1e-4)
    np.testing.assert_allclose(motion.velocities[0], [12.0, 0.0, -9.81 * 0.5], atol=1e-2)
    # the same far from the wall: two frames after the blow tell its velocity
    hit = 0.35
    there = np.abs(12.0 * (times - hit)) + 40.0
    places = np.c_[there, np.zeros((6, 2))] + fall + [0.0, 0.0, 50.0]
    motion = estimate(times, places[:, None], scene, noise=1e-4)
    np.testing.assert_allclose(motion.velocities[0], [12.0, 0.0, -9.81 * 0.5], atol=1e-2)
    assert motion.frames[0] == 2


def test_two_spheres_that_collide_between_the_last_two_frames() -> None:
    scene = Scene(surfaces=(), restitution=1.0, friction=0.0, gravity=(0.0, 0.0, -9.81))
    times = DT * np.arange(6)
    t, hit = times[:, None], 0.45
    fall = 0.5 * np.asarray(scene.gravity) * t**2
    ahead = np.abs(4.0 * (t - hit)) + RADIUS
    side = np.array([1.0, 0.0, 0.0])
    places = np.stack([-ahead * side + fall, ahead * side + fall], axis=1)
    motion = estimate(times, places, scene, noise=1e-4)
    np.testing.assert_allclose(
        motion.velocities, [[-4.0, 0.0, -4.905], [4.0, 0.0, -4.905]], atol=2e-2
    )


@pytest.mark.parametrize('up', UP.values(), ids=UP)
def test_what_rolls_does_not_fall(up: tuple[float, float, float]) -> None:
    scene = level_scene(up, rolling_friction=0.03)
    plane = scene.surfaces[0]
    times = DT * np.arange(6)
    brake = 0.03 * 9.81 / 1.4
    since = (times - times[-1])[:, None]
    along = 2.0 * since - 0.5 * brake * since**2
    places = RADIUS * np.array(plane.normal) + along * np.array(plane.direction)
    rng = np.random.default_rng(0)
    noisy = places[:, None] + rng.normal(0.0, 1e-3, (6, 1, 3))
    motion = estimate(times, noisy, scene, noise=1e-3)
    assert motion.kinds[0] == ROLLING and motion.frames[0] == 6
    expected = 2.0 * np.array(plane.direction)
    np.testing.assert_allclose(motion.velocities[0], expected, atol=5 * motion.errors[0])
    assert abs(motion.velocities[0] @ np.array(plane.normal)) < 1e-12


def test_what_rolls_down_a_slope() -> None:
    normal = (np.sin(0.3), 0.0, np.cos(0.3))
    scene = Scene(surfaces=(Plane(normal=normal),), rolling_friction=0.0)
    down = np.array([np.cos(0.3), 0.0, -np.sin(0.3)])
    times = DT * np.arange(6)
    pull = 5.0 / 7.0 * 9.81 * np.sin(0.3)
    places = np.array(normal) + (0.5 * pull * times**2)[:, None] * down
    motion = estimate(times, places[:, None], scene, noise=1e-4)
    assert motion.kinds[0] == ROLLING
    np.testing.assert_allclose(motion.velocities[0], pull * times[-1] * down, atol=1e-9)


LENGTHS = [(50.0, np.inf), (np.inf, 50.0), (50.0, 50.0)]


def with_ends(scene: Scene, lengths: tuple[float, float], face: float) -> Scene:
    """The scene with ends to its surface, and its normal turned round where `face` is -1."""
    (plane,) = scene.surfaces
    normal = tuple(face * np.array(plane.normal))
    ends = replace(plane, normal=normal, length_x=lengths[0], length_y=lengths[1])
    return replace(scene, surfaces=(ends,))


@pytest.mark.parametrize('face', [1.0, -1.0])
@pytest.mark.parametrize('lengths', LENGTHS)
def test_both_faces_of_strips_and_plates_are_as_a_half_space(
    lengths: tuple[float, float], face: float
) -> None:
    scene = level_scene(UP['askew'], friction=0.0, restitution=0.8)
    times = DT * np.arange(6)
    plane = scene.surfaces[0]
    rolling = RADIUS * np.array(plane.normal) + np.outer(2.0 * times, plane.direction)
    bounces = [bouncing(times, times[-1] - ago, scene, along=3.0)[0] for ago in (0.07, 0.25)]
    for places in (*bounces, rolling[:, None]):
        expected = estimate(times, places, scene, noise=1e-4)
        motion = estimate(times, places, with_ends(scene, lengths, face), noise=1e-4)
        assert motion.kinds[0] == expected.kinds[0]
        # the axes of the turned plane are others: some roundings
        np.testing.assert_allclose(motion.velocities, expected.velocities, atol=1e-9)
        np.testing.assert_allclose(motion.positions, expected.positions, atol=1e-9)


@pytest.mark.parametrize('face', [1.0, -1.0])
@pytest.mark.parametrize('lengths', LENGTHS)
def test_a_ceiling_turns_back_what_is_below_it_and_not_what_is_beside(
    lengths: tuple[float, float], face: float
) -> None:
    floor = level_scene(UP['z'], friction=0.0, restitution=0.8)
    ceiling = with_ends(floor, lengths, face)
    times = DT * np.arange(6)
    t, hit = times[:, None], 0.45
    up = np.array(UP['z'])
    speed = 8.0 - 9.81 * (t - hit)  # 8 m/s at the blow
    free = (8.0 * (t - hit) - 4.905 * (t - hit) ** 2 - RADIUS) * up
    back = free - np.where(t > hit, 1.64 * 8.0 * (t - hit), 0.0) * up  # e = 0.8^2
    seen = np.array([[True]] * 5 + [[False]])
    for place, ends in ((0.0, back), (30.0, free)):
        places = (ends + place * np.array([1.0, 1.0, 0.0]))[:, None]
        for shown in (np.ones((6, 1), dtype=bool), seen):
            motion = estimate_motion(
                times,
                np.where(shown[..., None], places, 0.0),
                np.tile([0.0, 0.0, 0.0, 1.0], (6, 1, 1)),
                environment=Environment.of(ceiling),
                radii=np.ones(1),
                noise=1e-4,
                seen=shown,
            )
            law = speed[-1] * up if place else (speed[-1] - 1.64 * 8.0) * up
            np.testing.assert_allclose(motion.velocities[0], law, atol=1e-2)
            np.testing.assert_allclose(motion.positions[0], places[-1, 0], atol=1e-3)


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_what_flies_away_from_a_strip_has_not_met_its_other_face(side: float) -> None:
    strip = Plane((0.0, 0.0, 5.0), direction=(1.0, 0.0, 0.0), length_x=20.0)
    environment = Environment.of(Scene(surfaces=(strip,), gravity=0.0))
    places, speeds = np.array([[0.0, 0.0, 5.0 + 1.1 * side]]), np.array([[0.0, 0.0, 60.0 * side]])
    found = coast(environment, places, speeds, np.ones(1, bool), np.ones(1), np.full(1, DT))
    np.testing.assert_array_equal(found[0], places + DT * speeds)
    np.testing.assert_array_equal(found[1], speeds)


def test_spin_since_a_bounce_is_not_mixed_with_that_before() -> None:
    scene = level_scene(UP['z'], friction=0.0, restitution=0.8)
    times = DT * np.arange(6)
    places, _ = bouncing(times, 0.33, scene, along=0.0)
    before, after = np.array([0.0, 4.0, 0.0]), np.array([1.0, -2.0, 3.0])
    turns, now = [], np.array([0.0, 0.0, 0.0, 1.0])
    for index, time in enumerate(times):
        last = times[index - 1] if index else 0.0
        for spin, span in ((before, min(time, 0.33) - min(last, 0.33)),):
            now = rotate_quaternions(now, spin * span)
        now = rotate_quaternions(now, after * (max(time, 0.33) - max(last, 0.33)))
        turns.append(now)
    motion = estimate_motion(
        times,
        places,
        np.array(turns)[:, None],
        environment=Environment.of(scene),
        radii=np.ones(1),
        noise=1e-4,
    )
    np.testing.assert_allclose(motion.angular_velocities[0], after, atol=1e-9)


def test_a_sphere_not_seen_lately_is_coasted_through_a_bounce() -> None:
    scene = level_scene(UP['z'], friction=0.0, restitution=0.8)
    times = DT * np.arange(6)
    places, speeds = bouncing(times, 0.44, scene, along=3.0)
    seen = np.array([[True], [True], [True], [True], [False], [False]])
    motion = estimate_motion(
        times,
        np.where(seen[..., None], places, 0.0),
        np.tile([0.0, 0.0, 0.0, 1.0], (6, 1, 1)),
        environment=Environment.of(scene),
        radii=np.ones(1),
        noise=1e-4,
        seen=seen,
    )
    np.testing.assert_allclose(motion.velocities[0], speeds[-1, 0], atol=1e-9)
    np.testing.assert_allclose(motion.positions[0], places[-1, 0], atol=1e-9)


@pytest.mark.parametrize('name', ['positions', 'quaternions', 'radii', 'seen'])
def test_shapes_that_disagree_are_refused(name: str) -> None:
    given = {
        'positions': np.zeros((3, 2, 3)),
        'quaternions': np.ones((3, 2, 4)),
        'radii': np.ones(2),
        'seen': np.ones((3, 2), dtype=bool),
    }
    given[name] = given[name][..., :1]
    environment = Environment.of(level_scene(UP['z']))
    with pytest.raises(ValueError, match=f'{name} have shape'):
        estimate_motion(np.arange(3.0), **given, environment=environment, noise=0.1)
