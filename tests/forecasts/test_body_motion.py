# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion of bodies by poses, twists and plans, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_gns_core import UserError
from rigid_gns_core.forecasts.body_motion import BodyTrack
from rigid_gns_core.forecasts.plan import Plan
from rigid_gns_core.messages.trajectories import FutureFrame
from scipy.spatial.transform import Rotation

T0, STEP = 1_000_123_456_789, 4_166_667  # [ns]; 240 Hz
VELOCITY, SPIN = np.array([3.0, -0.2, 1.0]), np.array([0.3, -8.0, 1.0])


def pose_at(time: float) -> np.ndarray:
    """Pose of a body with a constant twist, shape (7,)."""
    turn = Rotation.from_rotvec(time * SPIN) * Rotation.from_rotvec([0.1, 0.2, 0.3])
    return np.concatenate([[0.1, 0.2, 0.3] + time * VELOCITY, turn.as_quat()])


def test_a_constant_twist_is_found_and_goes_on() -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    for k in range(20):
        track.add_pose(T0 + k * STEP, pose_at(k * STEP * 1e-9))
    stamp = T0 + 19 * STEP + 30_000_000
    found = track.at(stamp)
    assert found is not None and found.source == 'poses'
    truth = pose_at((stamp - T0) * 1e-9)
    # exact but for rounding: positions lie on a line, and so do rotations about one axis
    np.testing.assert_allclose(found.position, truth[:3], atol=1e-12)
    turned = found.rotation.inv() * Rotation.from_quat(truth[3:])
    assert turned.magnitude() < 1e-7
    np.testing.assert_allclose(found.velocity, VELOCITY, atol=1e-9)
    np.testing.assert_allclose(found.angular_velocity, SPIN, atol=1e-6)


def test_noise_of_a_twist_is_that_of_a_line() -> None:
    """A slope of m poses T apart has the deviation s / (T sqrt(m (m^2 - 1) / 12))."""
    rng, noise, count, found = np.random.default_rng(0), 1e-3, 13, []
    for _ in range(200):
        track = BodyTrack(span=0.0501, timeout=0.25)
        for k in range(count):
            pose = pose_at(k * STEP * 1e-9)
            pose[:3] += rng.normal(0.0, noise, 3)
            track.add_pose(T0 + k * STEP, pose)
        motion = track.at(T0 + (count - 1) * STEP)
        assert motion is not None
        found.append(motion.velocity - VELOCITY)
    expected = noise / (STEP * 1e-9 * np.sqrt(count * (count**2 - 1) / 12))
    # 600 values: 3 % of a deviation
    assert np.std(found) == pytest.approx(expected, rel=0.12)


def test_a_twist_that_is_sent_counts_and_an_old_one_does_not() -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    for k in range(5):
        track.add_pose(T0 + k * STEP, pose_at(0.0))
    sent = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 4.0])
    track.add_twist(T0, sent)
    found = track.at(T0 + 4 * STEP + 100_000_000)
    assert found is not None and found.source == 'twist'
    np.testing.assert_allclose(found.position, pose_at(0.0)[:3] + 0.1 * sent[:3], atol=1e-12)
    track.add_pose(T0 + 300_000_000, pose_at(0.0))
    old = track.at(T0 + 300_000_000)
    assert old is not None and old.source == 'poses' and not old.velocity.any()


def test_poses_that_stop_leave_the_body_where_it_was() -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    assert track.at(T0) is None and not track.known
    for k in range(5):
        track.add_pose(T0 + k * STEP, pose_at(k * STEP * 1e-9))
    last = T0 + 4 * STEP
    assert track.at(last + 249_000_000).source == 'poses'  # type: ignore[union-attr]
    found = track.at(last + 251_000_000)
    assert found is not None and found.source == ''
    np.testing.assert_array_equal(found.position, pose_at(4 * STEP * 1e-9)[:3])
    assert not found.velocity.any() and not found.angular_velocity.any()


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        (lambda pose: pose * np.array([1, 1, 1, 2, 2, 2, 2]), 'quaternion has length 2, expected'),
        (lambda pose: pose + np.nan, 'not finite: the body is not seen'),
    ],
)
def test_what_is_no_pose_is_refused(change, message) -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    with pytest.raises(UserError, match=message):
        track.add_pose(T0, change(pose_at(0.0)))
    assert not track.known


def test_a_late_pose_is_refused_and_a_restart_is_followed() -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    track.add_pose(T0, pose_at(0.0))
    with pytest.raises(UserError, match='is not later than that before'):
        track.add_pose(T0 - STEP, pose_at(0.0))
    track.add_pose(T0 - 5_000_000_000, pose_at(1.0))
    assert track.age(T0 - 5_000_000_000) == 0.0


def plan_of(count: int, *, twists: bool) -> FutureFrame:
    times = [k * 100_000_000 for k in range(count)]
    poses = np.array([[pose_at(time * 1e-9)] for time in times])
    twist = np.tile(np.concatenate([VELOCITY, SPIN]), (count, 1, 1))
    return FutureFrame(
        T0, 'world', ('racket',), tuple(times), poses, twist if twists else np.nan * twist
    )


@pytest.mark.parametrize('twists', [False, True])
def test_a_plan_is_followed_between_its_points(twists: bool) -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    track.plan = Plan.of(plan_of(4, twists=twists), 'racket', 0)
    stamp = T0 + 130_000_000
    found = track.at(stamp)
    assert found is not None and found.source == 'plan'
    np.testing.assert_allclose(found.position, pose_at(0.13)[:3], atol=1e-12)
    np.testing.assert_allclose(found.velocity, VELOCITY, atol=1e-9)
    np.testing.assert_allclose(found.angular_velocity, SPIN, atol=1e-9)
    # poses say where it is, the plan how it moves
    track.add_pose(stamp, pose_at(0.0))
    both = track.at(stamp)
    assert both is not None and both.source == 'plan'
    np.testing.assert_allclose(both.position, pose_at(0.0)[:3], atol=1e-12)
    np.testing.assert_allclose(both.velocity, VELOCITY, atol=1e-9)


def test_a_plan_alone_rests_before_it_and_after_it() -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    track.plan = Plan.of(plan_of(4, twists=True), 'racket', 0)
    for stamp, time in ((T0 - 1, 0.0), (T0 + 300_000_001, 0.3)):
        found = track.at(stamp)
        assert found is not None and found.source == '' and not found.velocity.any()
        np.testing.assert_allclose(found.position, pose_at(time)[:3], atol=1e-12)


def test_a_plan_without_a_stamp_begins_when_it_comes() -> None:
    message = plan_of(2, twists=True)
    own = FutureFrame(0, *(getattr(message, n) for n in ('frame_id', 'names', 'times_ns', 'poses',
                                                         'twists')))  # fmt: skip
    assert Plan.of(own, 'any', T0).begin_ns == T0


def test_what_is_no_plan_is_refused() -> None:
    with pytest.raises(UserError, match='has 1 points, expected two or more'):
        Plan.of(plan_of(1, twists=True), 'racket', 0)
    message = plan_of(2, twists=True)
    two = FutureFrame(
        T0, 'world', ('left', 'right'), message.times_ns, np.repeat(message.poses, 2, axis=1),
        np.repeat(message.twists, 2, axis=1),
    )  # fmt: skip
    with pytest.raises(UserError, match='joint_names are left, right, expected racket'):
        Plan.of(two, 'racket', 0)


def changing(stamp_ns: int, *, twists: bool) -> Plan:
    """Along x it accelerates with 10 m/s^2 and turns about y ever faster, from a stamp on."""
    times = np.arange(6) * 0.1
    poses, rates = np.zeros((6, 1, 7)), np.zeros((6, 1, 6))
    poses[:, 0, 0], rates[:, 0, 0], rates[:, 0, 4] = 5 * times**2, 10 * times, 4 * times
    turns = Rotation.from_rotvec(np.outer(2 * times**2, [0.0, 1.0, 0.0]))
    poses[:, 0, 3:] = turns.as_quat()
    stamps = tuple(round(time * 1e9) for time in times)
    rates = rates if twists else np.nan * rates
    return Plan.of(FutureFrame(stamp_ns, 'world', ('racket',), stamps, poses, rates), 'racket', 0)


def test_a_plan_that_changes_its_twist_is_known_ahead() -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    track.plan = changing(T0, twists=True)
    motion = track.at(T0 + 50_000_000, ahead=0.3)
    assert motion is not None and motion.plan is not None
    np.testing.assert_allclose(motion.velocity, [0.5, 0.0, 0.0], atol=1e-12)
    times = np.linspace(0.0, 0.3, 13)
    found, late = motion.plan.at(times), times + 0.05
    np.testing.assert_allclose(found.positions[:, 0], 5 * late**2, atol=1e-9)
    np.testing.assert_allclose(found.velocities[:, 0], 10 * late, atol=1e-9)
    np.testing.assert_allclose(found.angular_velocities[:, 1], 4 * late, atol=1e-9)
    assert len(motion.plan.times) == 5  # what follows is left out
    assert track.at(T0 + 600_000_000, ahead=0.3).plan is None  # type: ignore[union-attr]


def test_without_velocities_the_twist_jumps_from_chord_to_chord() -> None:
    track = BodyTrack(span=0.05, timeout=0.25)
    track.plan = changing(T0, twists=False)
    motion = track.at(T0, ahead=1.0)
    assert motion is not None and motion.plan is not None
    found = motion.plan.at(np.array([0.05, 0.0999, 0.1001, 0.15]))
    np.testing.assert_allclose(found.velocities[:, 0], [0.5, 0.5, 1.5, 1.5], atol=1e-9)
    np.testing.assert_allclose(found.angular_velocities[:, 1], [0.2, 0.2, 0.6, 0.6], atol=1e-9)


def test_a_body_that_is_seen_goes_on_from_where_it_is_and_then_as_planned() -> None:
    """The plan begins in 0.1 s, elsewhere and turned otherwise: what it changes counts."""
    track = BodyTrack(span=0.05, timeout=0.25)
    for k in range(5):
        track.add_pose(T0 + k * STEP, pose_at(k * STEP * 1e-9))
    now = T0 + 4 * STEP
    track.plan = changing(now + 100_000_000, twists=True)
    motion = track.at(now, ahead=0.5)
    assert motion is not None and motion.source == 'poses' and motion.plan is not None
    before, after = np.array([0.0, 0.06, 0.0999]), np.array([0.1001, 0.2, 0.4])
    found = motion.plan.at(before)
    truth = np.stack([pose_at(4 * STEP * 1e-9 + time) for time in before])
    np.testing.assert_allclose(found.positions, truth[:, :3], atol=1e-9)
    np.testing.assert_allclose(found.velocities, np.tile(VELOCITY, (3, 1)), atol=1e-6)
    np.testing.assert_allclose(found.angular_velocities, np.tile(SPIN, (3, 1)), atol=1e-5)
    found, late = motion.plan.at(after), after - 0.1
    begin = pose_at(4 * STEP * 1e-9 + 0.1)
    np.testing.assert_allclose(found.positions[:, 0], begin[0] + 5 * late**2, atol=1e-8)
    np.testing.assert_allclose(found.velocities[:, 0], 10 * late, atol=1e-6)
    turned = Rotation.from_rotvec(np.outer(2 * late**2, [0.0, 1.0, 0.0]))
    expected = turned * Rotation.from_quat(begin[3:])
    assert (expected.inv() * Rotation.from_quat(found.quaternions)).magnitude().max() < 1e-7
