# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data association of poses that are shuffled, lost, false, late or repeated."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.tracking.tracks import Tracks
from rigid_gns_core.tracking.usable_frames import RejectedFrame, RESTART_FRAMES
from rigid_gns_core.tracking.window import TrackingWindow
from tracking_windows import tracking_window

DT = 100_000_000  # [ns]
SCENE = Scene(surfaces=(Plane(restitution=1.0),), restitution=0.8, friction=0.0)
COUNT = 12


def window(**values: Any) -> TrackingWindow:
    given: dict[str, Any] = {
        'length': 5,
        'max_spheres': 100,
        'gravity': SCENE.gravity,
        'max_gap': 1.0,
        'radius': 1.0,
        'scene': SCENE,
        'matched': True,
    }
    return tracking_window(**(given | values))


def poses(time: float, noise: float = 0.0, seed: int = 0) -> np.ndarray:
    """Spheres that fly side by side in different directions, shape (COUNT, 7)."""
    speeds = np.random.default_rng(5).normal(0.0, 1.5, (COUNT, 3))
    found = np.zeros((COUNT, 7))
    found[:, 0], found[:, 1], found[:, 2] = 8.0 * np.arange(COUNT), 0.0, 60.0
    found[:, :3] += speeds * time + 0.5 * np.asarray(SCENE.gravity) * time**2
    found[:, :3] += np.random.default_rng([seed, round(1e6 * time)]).normal(0, noise, (COUNT, 3))
    found[:, 6] = 1.0
    return found


def velocities(time: float) -> np.ndarray:
    speeds = np.random.default_rng(5).normal(0.0, 1.5, (COUNT, 3))
    return speeds + np.asarray(SCENE.gravity) * time


def frame(index: int, given: np.ndarray | None = None) -> PoseArrayFrame:
    given = poses(0.1 * index) if given is None else given
    return PoseArrayFrame(index * DT, 'world', given)


def feed(target: TrackingWindow, frames: list[PoseArrayFrame]) -> None:
    for one in frames:
        target.add(one, one.stamp_ns)


def state_of(target: TrackingWindow) -> dict[str, np.ndarray]:
    return vars(target.start()[1])


# --- order ---


@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('scene', [SCENE, None], ids=['scene', 'no scene'])
def test_poses_may_come_in_any_order(seed: int, scene: Scene | None) -> None:
    rng, target = np.random.default_rng(seed), window(scene=scene)
    first = rng.permutation(COUNT)
    feed(target, [frame(0, poses(0.0)[first])])
    for index in range(1, 12):
        feed(target, [frame(index, poses(0.1 * index)[rng.permutation(COUNT)])])
    assert target.ids == tuple(range(COUNT)) and target.generation == 1
    assert target.window_ns == tuple(index * DT for index in range(7, 12))
    state = target.start()[1]
    # ids are in the order of the first frame
    np.testing.assert_allclose(state.positions, poses(1.1)[first, :3], atol=1e-9)
    np.testing.assert_allclose(state.velocities, velocities(1.1)[first], atol=1e-8)


def test_a_tracker_that_keeps_the_order_needs_no_matching() -> None:
    matched, ordered = window(), window(matched=False)
    for target in (matched, ordered):
        feed(target, [frame(index) for index in range(6)])
    for name, value in state_of(matched).items():
        np.testing.assert_array_equal(value, state_of(ordered)[name])
    with pytest.raises(RejectedFrame, match=f'it holds 3 spheres, expected {COUNT} as before'):
        ordered.add(frame(6, poses(0.6)[:3]), 0)


def test_without_matching_only_the_window_counts() -> None:
    """What reproduces a prediction from the frames of its window relies on that."""
    long, short = window(matched=False), window(matched=False)
    frames = [frame(index, poses(0.1 * index, noise=1e-2)) for index in range(40)]
    feed(long, frames)
    feed(short, frames[-5:])
    for name, value in state_of(long).items():
        np.testing.assert_array_equal(value, state_of(short)[name])


# --- late, repeated, lost frames ---


@pytest.mark.parametrize('matched', [True, False])
def test_a_late_frame_is_put_in_its_place(matched: bool) -> None:
    straight, late = window(matched=matched), window(matched=matched)
    frames = [frame(index, poses(0.1 * index, noise=1e-2)) for index in range(12)]
    feed(straight, frames)
    feed(late, [*frames[:7], frames[8], frames[7], *frames[9:10], frames[11], frames[10]])
    assert late.counts['reordered'] == 2
    assert late.stamp_ns == 11 * DT and late.ids == straight.ids
    for name, value in state_of(straight).items():
        np.testing.assert_array_equal(value, state_of(late)[name])


def test_what_comes_too_late_or_twice_is_counted_by_kind() -> None:
    target = window()
    feed(target, [frame(index) for index in range(12)])
    before = state_of(target)
    for index, kind in ((11, 'duplicate'), (9, 'duplicate'), (1, 'late')):
        with pytest.raises(RejectedFrame) as caught:
            target.add(frame(index), 12 * DT)
        assert caught.value.kind == kind
    with pytest.raises(RejectedFrame, match='its poses are those of the frame 0.1 s before'):
        target.add(frame(12, poses(1.1)), 12 * DT)
    assert target.counts == {
        'accepted': 12,
        'duplicate': 2,
        'late': 1,
        'content': 1,
        'appeared': COUNT,
        'missed': 0,
        'vanished': 0,
    }
    for name, value in before.items():
        np.testing.assert_array_equal(value, state_of(target)[name])


def test_spheres_that_stop_at_once_are_believed_after_a_few_frames() -> None:
    target = window()
    feed(target, [frame(index) for index in range(6)])
    refused = 0
    for index in range(6, 16):
        try:
            target.add(frame(index, poses(0.5)), index * DT)
        except RejectedFrame:
            refused += 1
    assert 0 < refused < 10 and target.stamp_ns == 15 * DT


@pytest.mark.parametrize('hertz', [1.0, 3.0, 10.0, 71.0, 240.0])
def test_any_rate_and_lost_frames(hertz: float) -> None:
    target, rng = window(length=3, max_gap=3.0), np.random.default_rng(1)
    for index in range(min(30, int(3.0 * hertz) + 1)):
        time = index / hertz
        if index > 3 and rng.random() < 0.2:
            continue
        shown = poses(time)[rng.permutation(COUNT)]
        feed(target, [PoseArrayFrame(round(time * 1e9), 'world', shown)])
    assert len(target.ids) == COUNT and target.generation == 1
    stamp, state = target.start()
    places = poses(stamp * 1e-9)[:, :3]
    whose = np.linalg.norm(state.positions[:, None] - places, axis=-1).argmin(axis=1)
    assert sorted(whose) == list(range(COUNT))
    np.testing.assert_allclose(state.velocities, velocities(stamp * 1e-9)[whose], atol=1e-5)


# --- spheres that come and go ---


def test_a_sphere_that_misses_frames_is_coasted_and_then_dropped() -> None:
    target = window(coast_time=0.5)
    feed(target, [frame(index) for index in range(6)])
    for index in range(6, 11):
        feed(target, [frame(index, np.delete(poses(0.1 * index), 4, axis=0))])
        assert target.ids == tuple(range(COUNT)) and target.generation == 1
        np.testing.assert_allclose(
            target.start()[1].positions[4], poses(0.1 * index)[4, :3], atol=1e-6
        )
    feed(target, [frame(11, np.delete(poses(1.1), 4, axis=0))])
    assert target.ids == tuple(np.delete(np.arange(COUNT), 4).tolist())
    assert target.generation == 2 and len(target.start()[1]) == COUNT - 1
    assert target.counts['vanished'] == 1 and target.counts['missed'] == 5


def test_one_that_is_seen_again_in_time_keeps_its_id() -> None:
    target = window(coast_time=0.5)
    for index in range(20):
        shown = poses(0.1 * index)
        feed(target, [frame(index, np.delete(shown, 7, axis=0) if 8 <= index < 11 else shown)])
    assert target.ids == tuple(range(COUNT)) and target.generation == 1
    np.testing.assert_allclose(target.start()[1].velocities, velocities(1.9), atol=1e-6)


def test_a_new_sphere_is_admitted_after_three_frames_that_agree() -> None:
    target = window()
    for index in range(6):
        feed(target, [frame(index, poses(0.1 * index)[:-1])])
    for index in (6, 7, 8):
        assert len(target.ids) == COUNT - 1
        feed(target, [frame(index)])
    assert target.ids == tuple(range(COUNT)) and target.generation == 2
    np.testing.assert_allclose(target.start()[1].velocities, velocities(0.8), atol=1e-6)


def test_false_poses_are_not_admitted() -> None:
    target, rng = window(), np.random.default_rng(3)
    for index in range(40):
        false = np.zeros((2, 7))
        false[:, :3], false[:, 6] = rng.uniform(0, 100, (2, 3)), 1.0
        shown = poses(0.1 * index, noise=1e-3)
        if index >= 3:
            shown = np.concatenate([shown, false])
        feed(target, [frame(index, shown[rng.permutation(len(shown))])])
    assert target.ids == tuple(range(COUNT)) and target.generation == 1


def test_a_frame_without_poses_lets_all_coast() -> None:
    target = window(coast_time=0.15)
    with pytest.raises(RejectedFrame, match='no poses'):
        target.add(frame(0, np.zeros((0, 7))), 0)
    feed(target, [frame(index) for index in range(5)])
    feed(target, [frame(index, np.zeros((0, 7))) for index in (5, 6)])
    assert len(target.ids) == COUNT
    feed(target, [frame(7, np.zeros((0, 7)))])
    assert not target.ids and not target.full and target.count is None


def test_ids_are_never_used_twice() -> None:
    target = window(coast_time=0.0)
    feed(target, [frame(index) for index in range(5)])
    feed(target, [frame(index, poses(0.1 * index)[1:]) for index in range(5, 9)])
    feed(target, [frame(index) for index in range(9, 13)])
    assert target.ids == (*range(1, COUNT), COUNT)
    feed(target, [frame(index) for index in range(40, 45)])  # after a gap nobody is known
    assert target.ids == tuple(range(COUNT + 1, 2 * COUNT + 1))


def test_a_restarted_tracker_is_followed() -> None:
    target = window()
    feed(target, [frame(100 + index) for index in range(6)])
    for index in range(RESTART_FRAMES - 1):
        with pytest.raises(RejectedFrame):
            target.add(frame(index), 0)
    assert target.add(frame(RESTART_FRAMES - 1), 0)
    assert target.full and target.stamp_ns == (RESTART_FRAMES - 1) * DT


# --- noise, gravity ---


@pytest.mark.parametrize('noise', [1e-4, 1e-3, 1e-2])
def test_noise_is_estimated_from_the_poses(noise: float) -> None:
    target = window()
    feed(target, [frame(index, poses(0.1 * index, noise)) for index in range(40)])
    # 1200 third differences, of which neighbours are correlated
    assert target.noise == pytest.approx(noise, rel=0.15)
    assert window(noise=0.02).noise == 0.02


def test_gravity_may_point_anywhere() -> None:
    gravity = (3.0, -7.0, 2.0)
    scene = Scene(surfaces=(Plane((0.0, -50.0, 0.0), (0.0, 1.0, 0.0)),), gravity=gravity)
    target = window(scene=scene, gravity=gravity)
    for index in range(8):
        shown = poses(0.0)
        shown[:, :3] += 0.5 * np.array(gravity) * (0.1 * index) ** 2
        feed(target, [frame(index, shown[::-1] if index % 2 else shown)])
    expected = np.tile(0.7 * np.array(gravity), (COUNT, 1))
    np.testing.assert_allclose(target.start()[1].velocities, expected, atol=1e-8)


@pytest.mark.parametrize('length', [1, 2, 3, 6])
def test_spheres_in_one_place_are_not_the_end(length: int) -> None:
    """Two that approach are measured in one place for three frames, and part again."""
    target = window(length=length, radius=0.02, scene=Scene(radius=0.02))
    for index in range(40):
        shown = np.zeros((2, 7))
        shown[:, 0] = [-1.0, 1.0]
        shown[:, 0] *= 0.02 * max(abs(index - 20) - 1, 0)
        shown[:, 2], shown[:, 6] = 0.3, 1.0
        stamp = 10**18 + index * 14_000_000
        with contextlib.suppress(RejectedFrame):
            target.add(PoseArrayFrame(stamp, 'world', shown), stamp)
    assert target.stamp_ns == stamp and target.count == 2
    found = target.start()[1].positions  # nobody can tell whether they bounced or passed
    np.testing.assert_allclose(found[np.argsort(found[:, 0])], shown[:, :3], atol=1e-12)


def test_a_frame_that_cannot_be_taken_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    target = window()
    feed(target, [frame(index) for index in range(5)])
    before = target.window_ns, target.lead_ns, target.start()[1].positions

    def fail(*_: Any) -> None:
        raise ValueError('not thought of')

    monkeypatch.setattr(Tracks, 'updated', fail)
    with pytest.raises(ValueError, match='not thought of'):
        feed(target, [frame(5)])
    assert (target.window_ns, target.lead_ns) == before[:2]
    np.testing.assert_array_equal(target.start()[1].positions, before[2])


def test_old_calls_go_on_working() -> None:
    target = TrackingWindow(
        frame_id='world',
        length=3,
        max_spheres=100,
        gravity=SCENE.gravity,
        max_gap=1.0,
        radius=1.0,
        check=lambda _: None,
        on_gap=lambda _: None,
    )
    feed(target, [frame(index) for index in range(3)])
    assert target.full and target.count == COUNT and target.ids == tuple(range(COUNT))
    np.testing.assert_allclose(target.start()[1].velocities, velocities(0.2), atol=1e-9)
    target.clear()
    assert target.count is None and not target.full and target.generation == 2


@pytest.mark.parametrize('name', ['noise', 'coast_time', 'max_speed'])
def test_bad_settings_are_named(name: str) -> None:
    with pytest.raises(ValueError, match=f'{name} is -1, expected 0 or more'):
        window(**{name: -1})
