# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Starts of tracked balls by the laws of the scene: those of `estimate_state`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, Plane, Scene
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.state import State
from rigid_gns_core.scenes.tracker import Tracker
from rigid_gns_core.tracking import estimate_state
from rigid_gns_core.tracking.ball_contact import FREE
from rigid_gns_core.tracking.ball_model import BallModel
from rigid_gns_core.tracking.ball_path import path
from rigid_gns_core.tracking.known_laws import KnownLaws, MOST_BALLS, state_by_laws
from rigid_gns_core.tracking.motion_models import Motion
from rigid_gns_core.tracking.window import TrackingWindow
from tracking_windows import tracking_window

NOISE, RATE = 1e-3, 180.0
LEARNED = Scene(
    surfaces=(Plane(contact=ContactLaw(restitution=0.94, friction=0.25)),),
    radius=0.02,
    mass=0.0027,
    inertia_factor=2 / 3,
    air=Air(drag_coefficient=0.4, lift_coefficient=0.42),
    tracker=Tracker(noise=NOISE, drift=1e-4, impact=1e-3),
)
VACUUM = replace(LEARNED, air=None, tracker=None)
STARTS = [
    [0.0, 0.0, 0.5, 4.0, 0.3, 1.0, -20.0, 110.0, 15.0],
    [0.0, 2.0, 0.4, 4.0, 0.3, -1.5, 10.0, -80.0, 30.0],
]


def tracked(scene: Scene, end: float, starts: list[list[float]] = STARTS) -> np.ndarray:
    """True states of balls, shape (m, n, 9)."""
    model, times = BallModel.of(scene), np.arange(round(end * RATE) + 1) / RATE
    found = np.zeros((len(starts), len(times), 9))
    for own, start in zip(found, starts, strict=True):
        laws = (model.ball, model.planes, model.laws)
        path(np.array(start), 0.0, times, *laws, FREE, own, np.zeros((8, 3)))
    return found.transpose(1, 0, 2)


def frames(states: np.ndarray, noise: float = NOISE, seed: int = 0) -> list[PoseArrayFrame]:
    """Frames of noisy positions, whose rotations are unknown."""
    rng = np.random.default_rng(seed)
    places = states[..., :3] + rng.normal(0.0, noise, states[..., :3].shape)
    turns = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*places.shape[:2], 4))
    return [
        PoseArrayFrame(stamp_ns=10**12 + round(k / RATE * 1e9), frame_id='world', poses=poses)
        for k, poses in enumerate(np.concatenate([places, turns], axis=2))
    ]


def window(scene: Scene, *, matched: bool = False, noise: float | None = None) -> TrackingWindow:
    return tracking_window(
        max_spheres=100, gravity=scene.gravity, scene=scene, matched=matched, noise=noise
    )


def start_of(target: TrackingWindow, given: list[PoseArrayFrame]) -> State:
    for frame in given:
        target.add(frame, frame.stamp_ns)
    return target.start()[1]


def bytes_of(state: State) -> list[bytes]:
    return [value.tobytes() for value in vars(state).values()]


@pytest.mark.parametrize('matched', [False, True])
@pytest.mark.parametrize('scene', [LEARNED, replace(LEARNED, tracker=None), VACUUM])
def test_a_start_is_the_estimate_from_the_memory(matched: bool, scene: Scene) -> None:
    """Through a bounce; stamps of whole nanoseconds move a ball at 5 m/s by 3e-9 m."""
    # without air a spin shows only in a bounce: one that is large is not met, see the next test
    spin = 0.1 if scene is VACUUM else 1.0
    starts = [[*start[:6], *(spin * np.array(start[6:]))] for start in STARTS]
    states = tracked(scene, 0.5, starts)
    given, target = frames(states), window(scene, matched=matched)
    found = start_of(target, given)
    times = np.array([frame.stamp_ns - given[0].stamp_ns for frame in given]) * 1e-9
    places = np.stack([frame.poses[:, :3] for frame in given])
    noise = None if scene.tracker is not None else target.noise
    expected = estimate_state(scene, times, places, noise=noise)
    np.testing.assert_allclose(found.positions, expected.state.positions, atol=1e-6)
    np.testing.assert_allclose(found.velocities, expected.state.velocities, atol=1e-4)
    covariance = target.estimate()[1].covariance
    # those next to nothing beside the deviations are of rounding
    deviations = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    bound = 1e-2 * np.abs(covariance) + 1e-4 * deviations[:, :, None] * deviations[:, None]
    assert (np.abs(covariance - expected.covariance) <= bound + 1e-12).all()
    # deviations of 72 frames with a millimetre: 0.3 mm and 1 cm/s, and 0.5 m/s of a free spin
    assert np.abs(found.positions - states[-1, :, :3]).max() < 2e-3
    assert np.abs(found.velocities - states[-1, :, 3:6]).max() < 0.06


def test_a_start_that_misses_the_frames_is_that_of_the_window() -> None:
    """The spin of a ball in a vacuum shows only in its bounce, where it may be mistaken."""
    states = tracked(VACUUM, 0.5)
    found = start_of(window(VACUUM), frames(states))
    # six frames at 1 mm: 0.7 mm and 0.04 m/s on each axis
    assert np.abs(found.positions - states[-1, :, :3]).max() < 3e-3
    assert np.abs(found.velocities - states[-1, :, 3:6]).max() < 0.2


@pytest.mark.parametrize(('error', 'by_laws'), [(4.0, True), (1.0, True), (0.1, False)])
def test_a_doubted_start_is_that_of_the_window_where_the_window_knows_better(
    error: float, by_laws: bool
) -> None:
    """The window says 1 m/s more, known to `error`; no loss is as small as asked."""
    states = tracked(VACUUM, 0.35, STARTS[:1])
    times = np.arange(len(states)) / RATE
    places = states[..., :3] + np.random.default_rng(0).normal(0.0, NOISE, states[..., :3].shape)
    turns = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*places.shape[:2], 4))
    seen = np.ones(places.shape[:2], dtype=bool)
    laws = replace(KnownLaws.of(VACUUM, (0,)), worst=0.6)
    true = states[-1, :, 3:6]

    def window() -> tuple[Motion, np.ndarray]:
        motion = Motion.unknown(np.concatenate([places[-1], turns[-1]], axis=1))
        known = replace(motion, velocities=true + [1.0, 0.0, 0.0])
        return known, np.eye(9)[None] * error**2

    assert laws.states(times, places, seen, noise=NOISE)[3].all()
    state, _ = state_by_laws(laws, times, places, turns, seen, window, noise=NOISE)
    off = np.abs(state.velocities - true).max()
    assert (off < 0.1) if by_laws else (off == pytest.approx(1.0, abs=1e-9))


def test_all_frames_of_the_memory_are_told_and_no_others_count() -> None:
    """What reproduces a prediction from the frames of its start relies on that."""
    given = frames(tracked(LEARNED, 0.8))
    long, short = window(LEARNED), window(LEARNED)
    found = start_of(long, given)
    assert len(long.window_ns) == 73  # 0.4 s at 180 Hz
    again = start_of(short, [frame for frame in given if frame.stamp_ns in long.window_ns])
    assert bytes_of(again) == bytes_of(found)


def test_a_late_frame_makes_no_difference() -> None:
    given = frames(tracked(LEARNED, 0.3))
    late = [*given[:-3], given[-2], given[-3], given[-1]]
    found = [start_of(window(LEARNED), each) for each in (given, late)]
    assert bytes_of(found[0]) == bytes_of(found[1])


def test_many_balls_without_air_and_tracker_start_from_their_window() -> None:
    starts = [[0.0, k, 2.0, 0.2 * k, 0.0, 1.0, 0.0, 0.0, 0.0] for k in range(MOST_BALLS + 1)]
    given, target, short = frames(tracked(VACUUM, 0.3, starts)), window(VACUUM), window(VACUUM)
    found = start_of(target, given)
    assert len(target.window_ns) == 6
    again = start_of(short, [frame for frame in given if frame.stamp_ns in target.window_ns])
    assert bytes_of(again) == bytes_of(found)


@pytest.mark.parametrize('noise', [0.3e-3, 3e-3])
def test_the_noise_of_one_ball_is_estimated_and_a_guess_is_told(noise: float) -> None:
    """From the 16 third differences of 19 frames on each axis: within a factor of two."""
    found: list[float] = []
    for seed in range(20):
        given = frames(tracked(VACUUM, 0.1, STARTS[:1]), noise, seed)
        target = window(VACUUM)
        start_of(target, given[:6])
        assert not target.knows_noise and target.noise == 0.5e-2 * 0.02
        start_of(target, given[6:])
        assert target.knows_noise and len(target.window_ns) == 19
        found.append(target.noise)
    assert 0.75 < np.median(found) / noise < 1.33
    assert all(0.4 < each / noise < 2.0 for each in found)


def test_of_many_balls_the_fastest_are_estimated_by_the_laws() -> None:
    count = MOST_BALLS + 6
    starts = [[0.0, k, 2.0, 0.2 * k, 0.0, 1.0, 0.0, 0.0, 0.0] for k in range(count)]
    given = frames(tracked(LEARNED, 0.4, starts))
    found = start_of(window(LEARNED), given)
    plain = start_of(window(replace(LEARNED, air=None, tracker=None), noise=NOISE), given)
    same = (found.velocities == plain.velocities).all(axis=1)
    np.testing.assert_array_equal(same, np.arange(count) < 6)
    spins = np.linalg.norm(found.angular_velocities, axis=1)
    assert (spins[6:] > 0).all() and not spins[:6].any()


def test_a_ball_that_two_surfaces_clamp_is_no_endless_path() -> None:
    walls = (Plane(), Plane((0, 0, 0.038), (0, 0, -1)))
    scene = replace(LEARNED, surfaces=walls)
    still = np.zeros((30, 1, 9))
    still[..., 2] = 0.019
    found = start_of(window(scene), frames(still))
    assert np.isfinite(found.velocities).all() and np.abs(found.velocities).max() < 1.0


def test_a_ball_that_is_held_does_not_start_by_a_flight() -> None:
    """In the hand of somebody who walks: no law of the scene moves it so."""
    held = np.zeros((60, 1, 9))
    held[:, 0, 0], held[:, 0, 2] = 1.5 * np.arange(60) / RATE, 0.8
    found = start_of(window(VACUUM), frames(held, 1e-4))
    np.testing.assert_allclose(found.velocities, [[1.5, 0.0, 0.0]], atol=0.05)
