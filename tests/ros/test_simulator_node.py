"""The simulator node with the shipped model, in this process; time stands still unless set."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PoseArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from rigid_gns_core.rollout import load_simulator
from rigid_gns_core.sampling import load_scene
from rigid_gns_core.state import rotate_quaternions, rotation_between
from rigid_gns_ros.bag_reader import read_bag
from rigid_gns_ros.messages import PoseArrayCodec, decode_pose_array
from rigid_gns_ros.simulator_node import SimulatorNode

T0 = 1_000_123_456_789  # [ns]; digits that a float32 or a rounded float64 would lose
DT = 100_000_000  # [ns], the shipped model's step at radius 1 m
Falling = Callable[..., np.ndarray]


class Setup:
    """A simulator on simulated time, and the tester's ends of its topics."""

    def __init__(self, bench: Any, **parameters: Any) -> None:
        self.bench = bench
        self.node = bench.add(SimulatorNode, use_sim_time=True, **parameters)
        self.clock = bench.clock(self.node)
        self.tracked = bench.tracked()
        self.clock.set(T0)

    def start(self, poses: np.ndarray, stamp_ns: int = T0) -> None:
        """Send one frame and wait until the first prediction is computed."""
        before = len(self.tracked.step_bytes)
        self.tracked.send(poses, stamp_ns)
        self.tracked.wait_computed(before + 1)

    def frame(self, poses: np.ndarray, stamp_ns: int) -> None:
        """Send one frame and wait until it is accepted."""
        self.tracked.send(poses, stamp_ns)
        self.bench.until(lambda: self.node._window.stamp_ns == stamp_ns, 'the frame')

    def follow(self, times_ns: list[int], interval_ns: int) -> list[int]:
        """Stamps of predictions while a tracker sends at the given times, counted from T0.

        The clock stops at each frame and each half of a period; a prediction that falls due at a
        stop is waited for.
        """
        start = self.node.get_clock().now().nanoseconds
        stops = set(times_ns) | set(range(0, max(times_ns) + interval_ns, interval_ns // 2))
        for stop in sorted(stop for stop in stops if T0 + stop >= start):
            self.clock.set(T0 + stop)
            if stop in times_ns:
                self.frame(self.bench.falling(stop * 1e-9), T0 + stop)
            self.bench.until(lambda stop=stop: self._next_ns() > T0 + stop, 'what is due')
        self.tracked.wait(self.node._predictor.counts['published'])
        return [frame.stamp_ns for frame in self.tracked.predicted]

    def _next_ns(self) -> int:
        """When the node publishes or computes next."""
        predictor = self.node._predictor
        half = 0 if predictor.pending else predictor.period_ns // 2
        return predictor.due_ns + half

    def run(self, count: int) -> list[Any]:
        """Advance the clock, period by period, until there are `count` predictions."""
        while len(self.tracked.predicted_bytes) < count:
            due = self.node.get_clock().now().nanoseconds + DT
            self.clock.set(due)
            self.tracked.wait(1 + sum(f.stamp_ns < due for f in self.tracked.predicted))
        return self.tracked.predicted


@pytest.fixture
def simulated(bench: Any) -> Callable[..., Setup]:
    def make(**parameters: Any) -> Setup:
        return Setup(bench, **{'velocity_window': 1, **parameters})

    return make


def expected(poses: np.ndarray, steps: int, velocities: np.ndarray | None = None) -> np.ndarray:
    """Poses of the model's own rollout, shape (steps + 1, n, 7)."""
    trajectory = load_simulator().rollout(
        load_scene('box_154')[0], poses[:, :3], velocities, steps=steps, quaternions=poses[:, 3:]
    )
    return np.concatenate([trajectory.positions, trajectory.quaternions], axis=2)


# --- predictions ---


def test_predictions_are_the_rollout_with_exact_stamps(
    simulated: Callable[..., Setup], falling: Falling
) -> None:
    setup, start = simulated(), falling(0.0)
    setup.start(start)
    frames = setup.run(5)
    assert [frame.stamp_ns for frame in frames] == [T0 + k * DT for k in range(1, 6)]
    assert {frame.frame_id for frame in frames} == {'world'}
    # the same model on the same start: bit for bit but for the order of additions
    np.testing.assert_allclose([f.poses for f in frames], expected(start, 5)[1:], atol=1e-6)


def test_a_prediction_is_computed_ahead_and_held_until_its_time(
    simulated: Callable[..., Setup], falling: Falling
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.clock.set(T0 + DT - 1_000_000)
    for _ in range(20):
        setup.bench.executor.spin_once(timeout_sec=0.01)
    assert not setup.tracked.predicted
    setup.clock.set(T0 + DT)
    setup.tracked.wait(1)


def test_velocities_come_from_the_window(simulated: Callable[..., Setup], falling: Falling) -> None:
    setup = simulated(velocity_window=4)
    for index in range(3):
        setup.tracked.send(falling(0.05 * index, velocity=2.0), T0 - (3 - index) * 50_000_000)
    last = falling(0.15, velocity=2.0)
    setup.start(last)
    velocities = np.tile([2.0, 0.0, -9.81 * 0.15], (3, 1))
    # the fit is exact to rounding of positions of 100 m; float32 networks amplify nothing here
    np.testing.assert_allclose(setup.run(1)[0].poses, expected(last, 1, velocities)[1], atol=1e-5)


def test_another_rate_interpolates_and_says_so(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup, start = simulated(rate=25.0), falling(0.0)
    assert '25 Hz, interpolated between model steps' in log()
    setup.start(start)
    for index in range(1, 6):
        setup.clock.set(T0 + index * 40_000_000)
        setup.tracked.wait(index)
    frames = setup.tracked.predicted
    assert [frame.stamp_ns - T0 for frame in frames] == [k * 40_000_000 for k in range(1, 6)]
    states = expected(start, 2)
    for frame, (step, weight) in zip(
        frames, [(0, 0.4), (0, 0.8), (1, 0.2), (1, 0.6), (1, 1.0)], strict=True
    ):
        before, after = states[step], states[step + 1]
        place = (1 - weight) * before[:, :3] + weight * after[:, :3]
        turn = weight * rotation_between(before[:, 3:], after[:, 3:])
        np.testing.assert_allclose(frame.poses[:, :3], place, atol=1e-6)
        np.testing.assert_allclose(
            frame.poses[:, 3:], rotate_quaternions(before[:, 3:], turn), atol=1e-6
        )


def test_small_spheres_have_a_faster_native_rate(
    simulated: Callable[..., Setup], falling: Falling, tmp_path: Path, log: Callable[[], str]
) -> None:
    scene = tmp_path / 'table.yaml'
    scene.write_text('scene: {radius: 0.02, restitution: 0.7746, rolling_friction: 0.03}\n')
    setup = simulated(scene=str(scene))
    period = 0.1 * np.sqrt(0.02)  # [s], dynamic similarity
    assert f'native rate {1 / period:.6g} Hz' in log()
    setup.start(falling(0.0) * [0.02, 0.02, 0.02, 1, 1, 1, 1])
    for index in range(1, 8):
        setup.clock.set(T0 + round(index * period * 1e9))
        setup.tracked.wait(index)
    stamps = [frame.stamp_ns - T0 for frame in setup.tracked.predicted]
    assert stamps == [round(index * period * 1e9) for index in range(1, 8)]


def test_every_starts_again_from_each_frame(
    simulated: Callable[..., Setup], falling: Falling
) -> None:
    setup = simulated(start='every')
    starts = [falling(0.0), falling(1.0, velocity=3.0), falling(2.0, velocity=-4.0)]
    for index, poses in enumerate(starts):
        setup.frame(poses, T0 + index * DT)
        setup.clock.set(T0 + (index + 1) * DT)
        frame = setup.tracked.wait(index + 1)[index]
        assert frame.stamp_ns == T0 + (index + 1) * DT
        np.testing.assert_allclose(frame.poses, expected(poses, 1)[1], atol=1e-6)


@pytest.mark.parametrize('hertz', [4, 14, 33, 200])
def test_every_holds_the_rate_whatever_the_trackers(
    simulated: Callable[..., Setup], hertz: int
) -> None:
    setup = simulated(start='every', rate=10.0)
    frames = [round(k * 1e9 / hertz) for k in range(hertz + hertz // 2)]
    stamps = setup.follow(frames, DT)
    assert len(stamps) >= 13
    assert stamps == [T0 + k * DT for k in range(1, len(stamps) + 1)]
    # computed half a period before it is due, from the newest frame: one to two model steps each
    assert len(setup.tracked.step_bytes) <= (2 if hertz > 10 else 4) * (len(stamps) + 1)


def test_every_samples_the_newest_forecast_at_its_stamps(simulated: Callable[..., Setup]) -> None:
    setup = simulated(start='every')
    setup.follow([0, 130_000_000], DT)
    poses, states = setup.tracked.predicted[1].poses, expected(setup.bench.falling(0.13), 1)
    place = 0.3 * states[0, :, :3] + 0.7 * states[1, :, :3]
    np.testing.assert_allclose(poses[:, :3], place, atol=1e-6)


def test_every_follows_the_clock_of_the_tracker(simulated: Callable[..., Setup]) -> None:
    setup = simulated(start='every')
    # 2 ms a frame slower than the node's clock: each stamp is one period after its frame
    frames = [k * 102_000_000 for k in range(6)]
    stamps = setup.follow(frames, DT)
    assert stamps[:5] == [T0 + frame + DT for frame in frames[:5]]


def test_every_recovers_from_overload(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated(start='every')
    setup.start(falling(0.0))
    waiting = [PoseArrayCodec('world', 3).encode(falling(0.9), T0 + 9 * DT)]
    setup.node._channels.drain = lambda: [setup.node._on_tracked(waiting.pop()) for _ in waiting]
    setup.clock.set(T0 + 9 * DT + DT // 2)  # as if computing had taken so long
    assert setup.tracked.wait(1)[0].stamp_ns == T0 + DT
    setup.clock.set(T0 + 10 * DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == T0 + 10 * DT
    np.testing.assert_allclose(frame.poses, expected(falling(0.9), 1)[1], atol=1e-6)
    assert 'a prediction is 0.850 s late' in log()
    setup.node.close()
    assert '2 published, 1 late, 8 skipped' in log()


def test_every_without_new_frames_goes_on_period_by_period(
    simulated: Callable[..., Setup], falling: Falling
) -> None:
    setup, start = simulated(start='every'), falling(0.0)
    setup.start(start)
    setup.clock.set(T0 + 9 * DT + DT // 2)
    # 1 is late, 2 to 8 would follow it at once, 9 is half a period late
    frames = setup.tracked.wait(2)
    assert [frame.stamp_ns for frame in frames] == [T0 + DT, T0 + 9 * DT]
    np.testing.assert_allclose(frames[1].poses, expected(start, 9)[9], atol=1e-6)


def test_every_resumes_from_new_frames(simulated: Callable[..., Setup], falling: Falling) -> None:
    setup = simulated(start='every')
    setup.start(falling(0.0))
    setup.run(1)
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    for index in range(2, 30):
        setup.clock.set(T0 + index * DT)
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).success
    setup.start(falling(2.9), T0 + 29 * DT)
    setup.clock.set(T0 + 30 * DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == T0 + 30 * DT
    np.testing.assert_allclose(frame.poses, expected(falling(2.9), 1)[1], atol=1e-6)


def test_what_is_late_is_published_but_never_in_a_burst(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.clock.set(T0 + 8 * DT + DT // 2)
    # 1 is published late, 2 to 7 would follow it at once, 8 is half a period late
    stamps = [frame.stamp_ns for frame in setup.tracked.wait(2)]
    assert stamps == [T0 + DT, T0 + 8 * DT]
    setup.tracked.wait_computed(9)
    setup.clock.set(T0 + 9 * DT)
    assert setup.tracked.wait(3)[2].stamp_ns == T0 + 9 * DT
    text = log()
    assert text.count('late, more than the period') == 1  # throttled
    assert 'cannot keep up' not in text
    setup.node.close()
    assert '3 published, 1 late, 6 skipped' in log()


def test_real_time(bench: Any, falling: Falling) -> None:
    bench.add(SimulatorNode, velocity_window=1)
    tracked, start = bench.tracked(), bench.now()
    tracked.send(falling(0.0), start)
    frames = tracked.wait(3)
    counts = [(frame.stamp_ns - start) / DT for frame in frames]
    assert counts == sorted(set(counts)) and all(count == int(count) for count in counts)
    assert all(frame.stamp_ns <= bench.now() for frame in frames)


@pytest.mark.parametrize('stamp', [0, 50_000_000_000])
def test_a_tracker_on_another_clock_is_followed_with_a_warning(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str], stamp: int
) -> None:
    setup = simulated()
    setup.start(falling(0.0), stamp)
    setup.clock.set(T0 + DT)
    assert setup.tracked.wait(1)[0].stamp_ns == stamp + DT
    assert "off the node's clock" in log()


def test_without_a_clock_nothing_starts(
    bench: Any, falling: Falling, log: Callable[[], str]
) -> None:
    bench.add(SimulatorNode, use_sim_time=True, velocity_window=1)
    tracked = bench.tracked()
    tracked.send(falling(0.0), T0)
    bench.until(lambda: 'no /clock has come yet' in log(), 'the rejection')


def test_a_clock_that_goes_back_starts_again(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(2)
    earlier = T0 - 10**11
    setup.clock.set(earlier)
    assert 'the clock went backwards' in log()
    setup.start(falling(0.0, count=4), earlier)
    setup.clock.set(earlier + DT)
    frame = setup.tracked.wait(3)[2]
    assert frame.stamp_ns == earlier + DT and len(frame.poses) == 4


def test_a_clock_that_jumps_ahead_starts_again(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(1)
    later = T0 + 100 * DT
    setup.clock.set(later)
    assert log().count('the clock went forward by 9.900 s') == 1
    setup.start(falling(0.0, count=4), later)
    setup.clock.set(later + DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == later + DT and len(frame.poses) == 4


# --- rejections ---


def test_one_stamp_far_ahead_does_not_shut_the_tracker_out(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated(start='every')
    setup.start(falling(0.0))
    setup.tracked.send(falling(0.0), T0 + 3600 * 10**9)
    setup.bench.until(lambda: 'ahead of its time by the frames before' in log(), 'the line')
    setup.frame(falling(0.04), T0 + 4 * DT // 10)
    assert [frame.stamp_ns for frame in setup.run(1)] == [T0 + DT]


@pytest.mark.parametrize('back', [-7200, 7200])
def test_a_tracker_started_again_is_followed(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str], back: int
) -> None:
    setup = simulated(velocity_window=2)
    setup.tracked.send(falling(0.0), T0 - DT)
    setup.start(falling(0.0))
    anew = T0 + back * 10**9
    for index in range(5):
        setup.tracked.send(falling(0.1 * index), anew + index * DT)
    setup.bench.until(lambda: 'the tracker has begun anew' in log(), 'the restart')
    setup.bench.until(lambda: setup.node._predictor.pending is not None, 'the start')
    setup.clock.set(T0 + DT)
    frame = setup.tracked.wait(1)[0]
    assert frame.stamp_ns == anew + 5 * DT


def with_value(poses: np.ndarray, place: tuple[Any, ...], value: float) -> np.ndarray:
    poses = poses.copy()
    poses[place] = value
    return poses


REJECTIONS: dict[str, tuple[Callable[[np.ndarray], np.ndarray], dict[str, Any], str]] = {
    'frame': (lambda p: p, {'frame_id': 'map'}, "its frame is 'map', expected 'world'"),
    'no frame': (lambda p: p, {'frame_id': ''}, "its frame is '', expected 'world'"),
    'nan': (lambda p: with_value(p, (1, 2), np.nan), {}, 'the pose of sphere 1 is'),
    'inf': (lambda p: with_value(p, (2, 5), np.inf), {}, 'the pose of sphere 2 is'),
    'quaternion': (
        lambda p: with_value(p, (1, slice(3, 7)), 0.0),
        {},
        'the quaternion of sphere 1 has norm 0',
    ),
    'far': (lambda p: with_value(p, (1, 0), -1.1e6), {}, 'sphere 1 is 1.1e+06 m out'),
    'count': (lambda p: p[:2], {}, 'it holds 2 spheres, expected 3 as before'),
    'empty': (lambda p: p[:0], {}, 'it holds no poses'),
    'too many': (lambda p: np.tile(p, (2, 1)), {}, 'it holds 6 spheres, expected at most 5'),
    'stamp': (lambda p: p, {'stamp_ns': T0}, f'does not come after {T0 // 10**9}.'),
    'back': (lambda p: p, {'stamp_ns': T0 - 1}, '~/reset when the tracker was started again'),
}


@pytest.mark.parametrize('name', REJECTIONS)
def test_a_bad_message_is_rejected_with_a_reason(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str], name: str
) -> None:
    change, fields, reason = REJECTIONS[name]
    setup = simulated(max_spheres=5)
    setup.start(falling(0.0))
    for repeat in range(3):
        setup.tracked.send(change(falling(0.0)), **{'stamp_ns': T0 + 1000 + repeat, **fields})
    setup.bench.until(lambda: reason in log(), 'the reason')
    frames = setup.run(2)
    assert [frame.stamp_ns for frame in frames] == [T0 + DT, T0 + 2 * DT]
    assert log().count('tracked message rejected') == 1  # throttled
    setup.node.close()
    assert '3 rejected' in log()


def test_bytes_that_are_no_message_are_rejected(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.tracked.publisher.publish(b'\x00\x01\x00\x00' + bytes(10))
    setup.bench.until(lambda: 'tracked message rejected: PoseArray' in log(), 'the reason')
    setup.run(1)


@pytest.mark.filterwarnings('ignore:overflow')
@pytest.mark.parametrize('size', [1e12, 1e160, 1e300])
@pytest.mark.parametrize('window', [1, 3])
def test_wild_poses_do_not_end_the_node(
    simulated: Callable[..., Setup], falling: Falling, size: float, window: int
) -> None:
    setup = simulated(velocity_window=window)
    for index in range(window):
        wild = falling(0.0) + [(-1) ** index * size, 0, 0, 0, 0, 0, 0]
        setup.tracked.send(wild, T0 + index)
    for _ in range(10):
        setup.bench.executor.spin_once(timeout_sec=0.01)
    setup.clock.set(T0 + 5 * DT)
    assert setup.bench.call(Trigger, '/simulator/reset').success
    published = len(setup.tracked.predicted)
    for index in range(window):
        setup.tracked.send(falling(0.1 * index), T0 + (3 + index) * DT)
    later = T0 + (3 + window) * DT
    setup.clock.set(later)
    setup.bench.until(lambda: len(setup.tracked.predicted) > published, 'a prediction')
    assert setup.tracked.predicted[-1].stamp_ns == later


def test_each_kind_of_rejection_has_its_line(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.tracked.send(falling(0.0), T0, 'map')
    setup.tracked.send(falling(0.0)[:0], T0)
    setup.bench.until(lambda: log().count('tracked message rejected') == 2, 'two lines')


def test_a_count_that_the_scene_does_not_have_is_rejected(
    simulated: Callable[..., Setup], falling: Falling, tmp_path: Path, log: Callable[[], str]
) -> None:
    scene = tmp_path / 'four.yaml'
    scene.write_text('scene: {friction: [0.5, 0.5, 0.5, 0.5]}\n')
    setup = simulated(scene=str(scene))
    setup.tracked.send(falling(0.0), T0)
    setup.bench.until(lambda: 'of 4 spheres, but there are 3' in log(), 'the reason')
    setup.start(falling(0.0, count=4))
    assert len(setup.run(1)[0].poses) == 4


def test_frames_before_a_long_gap_do_not_count(
    simulated: Callable[..., Setup], falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated(velocity_window=2)
    setup.tracked.send(falling(0.0), T0 - 20 * DT)
    setup.tracked.send(falling(1.0), T0 - DT)
    setup.start(falling(1.1))
    text = log()
    assert 'tracked frames are 1.9 s apart, more than 1 s' in text
    assert 'set velocity_window:=1' in text
    assert f'started from stamp {T0 // 10**9}.{T0 % 10**9:09d} s' in text
    velocities = np.tile([1.0, 0.0, -9.81 * 1.1], (3, 1))
    np.testing.assert_allclose(
        setup.run(1)[0].poses, expected(falling(1.1), 1, velocities)[1], atol=1e-5
    )


def test_a_tracker_too_slow_for_small_spheres_is_told(
    simulated: Callable[..., Setup], falling: Falling, tmp_path: Path, log: Callable[[], str]
) -> None:
    scene = tmp_path / 'table.yaml'
    scene.write_text('scene: {radius: 0.02, restitution: 0.7746, rolling_friction: 0.03}\n')
    setup = simulated(scene=str(scene), velocity_window=2)
    small = falling(0.0) * [0.02, 0.02, 0.02, 1, 1, 1, 1]
    for index in range(3):
        setup.frame(small, T0 + index * 400_000_000)
    text = log()
    assert text.count('tracked frames are 0.4 s apart, more than 0.25 s') == 1
    # 5 Hz is enough, though it is more than ten model steps
    setup.frame(small, T0 + 1_000_000_000)
    setup.tracked.wait_computed(1)


# --- services and parameters ---


def test_reset_takes_another_start(simulated: Callable[..., Setup], falling: Falling) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(1)
    assert setup.bench.call(Trigger, '/simulator/reset').success
    later = setup.node.get_clock().now().nanoseconds
    setup.start(falling(0.0, count=4), later)
    setup.clock.set(later + DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == later + DT and len(frame.poses) == 4


def test_pause_and_step(simulated: Callable[..., Setup], falling: Falling) -> None:
    setup, start = simulated(), falling(0.0)
    step = '/simulator/step'
    refused = setup.bench.call(Trigger, step)
    assert not refused.success and 'not paused' in refused.message
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).message == 'paused'
    refused = setup.bench.call(Trigger, step)
    assert not refused.success and 'not started' in refused.message
    setup.start(start)
    for index in range(1, 4):
        answer = setup.bench.call(Trigger, step)
        assert answer.success and answer.message.startswith(f'published prediction {index} ')
        assert setup.tracked.wait(index)[-1].stamp_ns == T0 + index * DT
    for index in range(1, 21):  # however long the pause, time goes on where it stood
        setup.clock.set(T0 + 5 * index * DT)
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).message == 'running'
    assert len(setup.tracked.predicted) == 3
    setup.clock.set(T0 + 101 * DT)
    frames = setup.tracked.wait(4)
    assert frames[3].stamp_ns == T0 + 4 * DT
    np.testing.assert_allclose([f.poses for f in frames], expected(start, 4)[1:], atol=1e-6)
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).message == 'no change'


def test_parameters_at_run_time(simulated: Callable[..., Setup], falling: Falling) -> None:
    setup = simulated()

    def change(name: str, **value: Any) -> Any:
        parameter = Parameter(name=name, value=ParameterValue(**value))
        return setup.bench.call(
            SetParameters, '/simulator/set_parameters', parameters=[parameter]
        ).results[0]

    def text(value: str) -> dict[str, Any]:
        return {'type': ParameterType.PARAMETER_STRING, 'string_value': value}

    assert change('start', **text('every')).successful
    refused = change('start', **text('sometimes'))
    assert not refused.successful and 'allowed: first, every' in refused.reason
    rate = {'type': ParameterType.PARAMETER_DOUBLE, 'double_value': 5.0}
    assert not change('rate', **rate).successful
    setup.start(falling(0.0))
    setup.clock.set(T0 + DT)
    setup.tracked.wait(1)
    second = falling(0.0, velocity=0.0, count=3) + [0, 0, 7, 0, 0, 0, 0]
    setup.frame(second, T0 + DT)
    setup.clock.set(T0 + 2 * DT)
    frame = setup.tracked.wait(2)[1]
    np.testing.assert_allclose(frame.poses, expected(second, 1)[1], atol=1e-6)


def test_parameters_describe_themselves(simulated: Callable[..., Setup]) -> None:
    setup = simulated()
    names = ['rate', 'start', 'max_spheres']
    rate, start, most = setup.bench.call(
        DescribeParameters, '/simulator/describe_parameters', names=names
    ).descriptors
    assert rate.read_only and rate.floating_point_range[0].to_value == 1000.0
    assert '[Hz]' in rate.description
    assert not start.read_only and start.additional_constraints == 'one of: first, every'
    assert most.integer_range[0].from_value == 1


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'model': 'nonesuch'}, "no model 'nonesuch'"),
        ({'scene': 'nonesuch'}, "'nonesuch'"),
        ({'rate': -1.0}, 'parameter rate.*allowed: 0 to 1000 Hz'),
        ({'rate': 0.01}, 'rate is 0.01, allowed: 0, or 0.1 to 1000 Hz'),
        ({'rate': 10}, 'parameter rate has the wrong type.*float, as 10.0'),
        ({'velocity_window': 0}, 'parameter velocity_window.*allowed: 1 to 100'),
        ({'start': 'later'}, "start is 'later', allowed: first, every"),
        ({'max_spheres': 0}, 'parameter max_spheres'),
    ],
)
def test_bad_parameters_are_named(bench: Any, parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bench.add(SimulatorNode, **parameters)
    assert not bench.tester.get_publishers_info_by_topic('/predicted_poses')


# --- scene and bag ---


def test_the_scene_is_latched(simulated: Callable[..., Setup]) -> None:
    setup, heard = simulated(), []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    setup.bench.tester.create_subscription(String, '/simulator/scene', heard.append, latched)
    setup.bench.until(lambda: heard, 'the scene')
    content = json.loads(heard[0].data)
    assert content['scene'] == load_scene('box_154')[0].to_mapping()
    assert content['model'] == 'contact' and content['dt'] == content['period'] == 0.1
    assert content['model_card']['format_version'] == 1
    assert content['parameters']['velocity_window'] == 1
    assert content['topics'] == {
        'tracked': '/tracked_poses',
        'predicted': '/predicted_poses',
        'step_time': '/simulator/step_time',
    }


def test_the_bag_holds_the_bytes(bench: Any, falling: Falling, tmp_path: Path) -> None:
    folder = tmp_path / 'bag'
    node = bench.add(
        SimulatorNode,
        remap=('__ns:=/lab', 'predicted_poses:=forecast'),
        velocity_window=1,
        record=str(folder),
        use_sim_time=True,
    )
    clock = bench.clock(node)
    received: list[bytes] = []
    bench.tester.create_subscription(PoseArray, '/lab/forecast', received.append, 10, raw=True)
    tracked = bench.tracked('/lab')
    bench.until(lambda: bench.tester.count_subscribers('/lab/forecast'), 'discovery')
    clock.set(T0)
    sent = [tracked.send(falling(0.0), T0)]
    tracked.wait_computed(1)
    tracked.send(falling(0.0), T0 + 1, 'map')
    for index in range(1, 4):
        clock.set(T0 + index * DT)
        sent.append(tracked.send(falling(0.1 * index), T0 + index * DT))
        bench.until(lambda expected=index: len(received) == expected, 'a prediction')
    tracked.wait_computed(4)
    node.close()
    bag = read_bag(folder)
    assert set(bag.topics) == {
        '/lab/tracked_poses',
        '/lab/forecast',
        '/lab/simulator/scene',
        '/lab/simulator/step_time',
    }
    assert [bytes(cdr) for cdr in bag.topics['/lab/forecast'].messages] == received
    assert [bytes(cdr) for cdr in bag.topics['/lab/tracked_poses'].messages] == sent
    steps = [bytes(cdr) for cdr in bag.topics['/lab/simulator/step_time'].messages]
    assert steps == tracked.step_bytes
    stamps = [decode_pose_array(cdr).stamp_ns for cdr in received]
    assert list(bag.topics['/lab/forecast'].times) == stamps  # the clock stood at each stamp
    assert (folder / 'metadata.yaml').is_file()


def test_a_bag_is_never_overwritten(bench: Any, tmp_path: Path) -> None:
    with pytest.raises(FileExistsError, match='parameter record is .*never overwritten'):
        bench.add(SimulatorNode, record=str(tmp_path))


def test_a_bag_that_failed_is_told_at_the_end(
    simulated: Callable[..., Setup], tmp_path: Path, log: Callable[[], str]
) -> None:
    setup = simulated(record=str(tmp_path / 'bag'))
    setup.node._channels.bag._error = 'no space left'  # as the recording thread sets it
    setup.node.close()
    assert 'INCOMPLETE: no space left' in log()


def test_steps_of_every_start_from_the_newest_frame(
    simulated: Callable[..., Setup], falling: Falling
) -> None:
    setup = simulated(start='every')
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    setup.start(falling(0.0))
    assert setup.bench.call(Trigger, '/simulator/step').success
    setup.clock.set(T0 + 8 * DT)
    setup.frame(falling(0.8), T0 + 8 * DT)
    assert setup.bench.call(Trigger, '/simulator/step').success
    frames = setup.tracked.wait(2)
    assert [frame.stamp_ns for frame in frames] == [T0 + DT, T0 + 9 * DT]
    np.testing.assert_allclose(frames[1].poses, expected(falling(0.8), 1)[1], atol=1e-6)
