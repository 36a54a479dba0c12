# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames that the simulator node refuses, or takes for a restart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from std_srvs.srv import Trigger

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Callable[..., np.ndarray]
Simulated = Callable[..., Any]


def test_one_stamp_far_ahead_does_not_shut_the_tracker_out(
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated(start='every')
    setup.start(falling(0.0))
    setup.tracked.send(falling(0.0), T0 + 3600 * 10**9)
    setup.bench.until(lambda: 'ahead of its time by the frames before' in log(), 'the line')
    setup.frame(falling(0.04), T0 + 4 * DT // 10)
    assert [frame.stamp_ns for frame in setup.run(1)] == [T0 + DT]


@pytest.mark.parametrize('back', [-7200, 7200])
def test_a_tracker_started_again_is_followed(
    simulated: Simulated, falling: Falling, log: Callable[[], str], back: int
) -> None:
    setup = simulated(velocity_window=2)
    setup.tracked.send(falling(0.0), T0 - DT)
    setup.start(falling(0.0))
    anew = T0 + back * 10**9
    for index in range(5):
        setup.tracked.send(falling(0.1 * index), anew + index * DT)
    setup.bench.until(lambda: 'the tracker has restarted' in log(), 'the restart')
    setup.bench.until(lambda: setup.node.simulation.predictor.pending is not None, 'the start')
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
    'inf': (lambda p: with_value(p, (2, 1), np.inf), {}, 'the pose of sphere 2 is'),
    'long quaternion': (
        lambda p: with_value(p, (1, slice(3, 7)), 1e200),
        {},
        'the quaternion of sphere 1 has norm 2e+200',
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
    simulated: Simulated, falling: Falling, log: Callable[[], str], name: str
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
    simulated: Simulated, falling: Falling, log: Callable[[], str]
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
    simulated: Simulated, falling: Falling, size: float, window: int
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
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.tracked.send(falling(0.0), T0, 'map')
    setup.tracked.send(falling(0.0)[:0], T0)
    setup.bench.until(lambda: log().count('tracked message rejected') == 2, 'two lines')


def test_a_count_that_the_scene_does_not_have_is_rejected(
    simulated: Simulated, falling: Falling, tmp_path: Path, log: Callable[[], str]
) -> None:
    scene = tmp_path / 'four.yaml'
    scene.write_text('scene: {friction: [0.5, 0.5, 0.5, 0.5]}\n')
    setup = simulated(scene=str(scene))
    setup.tracked.send(falling(0.0), T0)
    setup.bench.until(lambda: 'of 4 spheres, but there are 3' in log(), 'the reason')
    setup.start(falling(0.0, count=4))
    assert len(setup.run(1)[0].poses) == 4


def test_frames_before_a_long_gap_do_not_count(
    simulated: Simulated, falling: Falling, log: Callable[[], str], expected: Rollout
) -> None:
    setup = simulated(velocity_window=2)
    setup.tracked.send(falling(0.0), T0 - 20 * DT)
    setup.tracked.send(falling(1.0), T0 - DT)
    setup.start(falling(1.1))
    text = log()
    assert 'tracked frames are 1.9 s apart, more than 1.25 s' in text
    assert 'set velocity_window:=1' in text
    assert f'started from stamp {T0 // 10**9}.{T0 % 10**9:09d} s' in text
    velocities = np.tile([1.0, 0.0, -9.81 * 1.1], (3, 1))
    np.testing.assert_allclose(
        setup.run(1)[0].poses, expected(falling(1.1), 1, velocities)[1], atol=1e-5
    )


def test_a_tracker_of_1_hz_is_slow_but_followed(
    simulated: Simulated, falling: Falling, tmp_path: Path, log: Callable[[], str]
) -> None:
    scene = tmp_path / 'table.yaml'
    scene.write_text('scene: {radius: 0.02, restitution: 0.7746, rolling_friction: 0.03}\n')
    setup = simulated(scene=str(scene), velocity_window=2)
    small = falling(0.0) * [0.02, 0.02, 0.02, 1, 1, 1, 1]
    for index in range(3):
        setup.frame(small, T0 + index * 1_300_000_000)
    assert log().count('tracked frames are 1.3 s apart, more than 1.25 s') == 1
    # 1 Hz and some jitter is enough, though it is 70 model steps
    setup.frame(small, T0 + 3_700_000_000)
    setup.tracked.wait_computed(1)
