# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import signal
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PoseArray
from rclpy.qos import qos_profile_sensor_data, QoSReliabilityPolicy
from rigid_gns_core.data.records import demo_record, Record, write_record
from rigid_gns_core.messages.poses import decode_pose_array, PoseArrayFrame
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Trajectory
from rigid_gns_ros.node.process import Finished
from rigid_gns_ros.node.tracker import TrackerNode

COUNT, FRAMES, DT = 50, 6, 0.02


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """Return a short record of spheres that move and turn."""
    rng = np.random.default_rng(0)
    positions = rng.uniform(-20, 20, (FRAMES, COUNT, 3))
    quaternions = rng.normal(size=(FRAMES, COUNT, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    trajectory = Trajectory.from_poses(positions, quaternions, DT)
    path = tmp_path / 'record.h5'
    write_record(path, Record(trajectory=trajectory, scene=Scene(), seed=0, name='test'))
    return path


def listen(bench: Any, topic: str = '/tracked_poses') -> list[PoseArrayFrame]:
    heard: list[PoseArrayFrame] = []
    bench.tester.create_subscription(
        PoseArray,
        topic,
        lambda cdr: heard.append(decode_pose_array(cdr)),
        qos_profile_sensor_data,
        raw=True,
    )
    return heard


def play(bench: Any, **parameters: Any) -> list[PoseArrayFrame]:
    """Return what a subscriber hears until the record ends."""
    heard = listen(bench)
    bench.add(TrackerNode, **parameters)
    with pytest.raises(Finished):
        bench.until(lambda: False)
    bench.until(lambda: heard, 'a frame')
    for _ in range(20):
        bench.executor.spin_once(timeout_sec=0.01)
    return heard


def indices(heard: list[PoseArrayFrame]) -> np.ndarray:
    """Which frame of the record each message is, counted from the first one heard."""
    return np.array([round((frame.stamp_ns - heard[0].stamp_ns) * 1e-9 / DT) for frame in heard])


def test_frames_come_with_stamps_of_equal_distance(bench: Any, record: Path) -> None:
    start = bench.now()
    heard = play(bench, trajectory=str(record), noise=0.0, frame_id='lab', rate_factor=0.2)
    # best effort and a busy machine may lose some, but none is changed or out of order
    assert len(heard) >= 2
    stamps = [frame.stamp_ns for frame in heard]
    assert stamps == sorted(stamps) and start <= stamps[0] <= bench.now()
    assert {(stamp - stamps[0]) % round(DT * 1e9) for stamp in stamps} == {0}
    assert {frame.frame_id for frame in heard} == {'lab'}
    trajectory = demo_trajectory(record)
    first = int(np.argmin([np.abs(p - heard[0].poses[:, :3]).max() for p in trajectory.positions]))
    for frame, index in zip(heard, first + indices(heard), strict=True):
        np.testing.assert_array_equal(frame.poses[:, :3], trajectory.positions[index])
        np.testing.assert_array_equal(frame.poses[:, 3:], trajectory.quaternions[index])


def demo_trajectory(path: Path) -> Trajectory:
    from rigid_gns_core.data.records import read_record

    return read_record(path).trajectory


def test_noise_is_on_positions_and_follows_from_the_seed(bench: Any, record: Path) -> None:
    settings = {'trajectory': str(record), 'noise': 0.01, 'rate_factor': 0.2}
    heard = play(bench, seed=3, **settings)
    trajectory = demo_trajectory(record)
    first = int(np.argmin([np.abs(p - heard[0].poses[:, :3]).max() for p in trajectory.positions]))
    noise = np.concatenate(
        [
            frame.poses[:, :3] - trajectory.positions[index]
            for frame, index in zip(heard, first + indices(heard), strict=True)
        ]
    )
    # at least 300 normal draws: five standard deviations of their mean and of their variance
    assert abs(noise.mean()) < 5 * 0.01 / np.sqrt(noise.size)
    assert abs(noise.var() / 0.01**2 - 1) < 5 * np.sqrt(2 / noise.size)
    np.testing.assert_array_equal(heard[0].poses[:, 3:], trajectory.quaternions[first])
    if first == 0:
        expected = np.random.default_rng(3).normal(0.0, 0.01, (COUNT, 3))
        np.testing.assert_allclose(heard[0].poses[:, :3] - trajectory.positions[0], expected)


def test_it_waits_for_a_subscriber_and_is_best_effort(
    bench: Any, record: Path, log: Callable[[], str]
) -> None:
    # a name of its own: DDS may take nodes of the test before for alive that were just ending
    bench.add(TrackerNode, ('tracked_poses:=alone',), trajectory=str(record), loop=True)
    for _ in range(20):
        bench.executor.spin_once(timeout_sec=0.02)
    assert 'waiting for a subscriber' in log() and 'started at stamp' not in log()
    heard = listen(bench, '/alone')
    bench.until(lambda: heard, 'a frame')
    assert 'started at stamp' in log()
    (publisher,) = bench.tester.get_publishers_info_by_topic('/alone')
    assert publisher.qos_profile.reliability == QoSReliabilityPolicy.BEST_EFFORT


@pytest.mark.parametrize('waits', [True, False])
def test_it_starts_with_a_simulated_clock(bench: Any, record: Path, waits: bool) -> None:
    heard = listen(bench)
    node = bench.add(
        TrackerNode, trajectory=str(record), use_sim_time=True, wait_for_subscriber=waits
    )
    clock = bench.clock(node)
    (heard_on,) = (s for s in bench.tester.subscriptions if s.topic_name == '/tracked_poses')
    # both sides, as nothing is sent twice
    bench.until(heard_on.get_publisher_count, 'the tracker')
    bench.until(node._publisher.get_subscription_count, 'the listener')
    origin, step = 100_000_000_000, round(DT * 1e9)
    for index in range(4):
        clock.set(origin + index * step)
        bench.until(lambda number=index + 1: len(heard) == number, f'frame {index}')
    assert [frame.stamp_ns - origin for frame in heard] == [0, step, 2 * step, 3 * step]
    for jumped in (origin // 2, 10 * origin):  # it goes on with the frame that is next
        before = len(heard)
        clock.set(jumped)
        bench.until(lambda before=before: len(heard) > before, 'a frame after the jump')
        assert heard[-1].stamp_ns == jumped
    np.testing.assert_allclose(
        [frame.poses[:, :3] for frame in heard], demo_trajectory(record).positions, atol=0.01
    )


def test_a_loop_goes_on_with_rising_stamps(bench: Any, record: Path) -> None:
    heard = listen(bench)
    bench.add(TrackerNode, trajectory=str(record), loop=True, noise=0.0)
    bench.until(lambda: heard and indices(heard)[-1] > 2 * FRAMES, 'two rounds')
    trajectory = demo_trajectory(record)
    first = int(np.argmin([np.abs(p - heard[0].poses[:, :3]).max() for p in trajectory.positions]))
    for frame, index in zip(heard, first + indices(heard), strict=True):
        np.testing.assert_array_equal(frame.poses[:, :3], trajectory.positions[index % FRAMES])


def test_it_plays_the_shipped_record(bench: Any) -> None:
    shipped, heard = demo_record().trajectory, listen(bench)
    bench.add(TrackerNode)
    bench.until(lambda: heard, 'a frame')
    assert heard[0].poses.shape == (shipped.count, 7) == (154, 7)
    # the first or second frame, as discovery goes, and 1 mm of noise
    distances = [np.abs(p - heard[0].poses[:, :3]).max() for p in shipped.positions[:20]]
    assert min(distances) < 0.01


def test_it_runs_bullet_live(bench: Any, tmp_path: Path) -> None:
    pytest.importorskip('pybullet', reason='pybullet has no wheel for this Python')
    scene = tmp_path / 'scene.yaml'
    scene.write_text(
        'scene: {box: {length_x: 20.0, length_y: 20.0}}\nstart: {spheres: 3, height: [5.0, 9.0]}\n'
    )
    heard = listen(bench)
    bench.add(TrackerNode, live=True, scene=str(scene), noise=0.0)
    bench.until(lambda: len(heard) >= 3, 'three frames')
    fallen = heard[-1].poses[:, 2] - heard[0].poses[:, 2]
    assert (fallen < 0).all()


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'trajectory': 'nonesuch.h5'}, 'nonesuch.h5'),
        ({'live': True, 'trajectory': 'some.h5'}, 'give one'),
        ({'noise': -1.0}, 'parameter noise'),
        ({'rate_factor': 0.0}, 'parameter rate_factor'),
    ],
)
def test_bad_parameters_are_named(bench: Any, parameters: dict[str, Any], message: str) -> None:
    with pytest.raises((ValueError, OSError), match=message):
        bench.add(TrackerNode, **parameters)


def test_the_process_ends_with_the_record_or_by_a_signal(
    run_process: Callable[..., Any], record: Path
) -> None:
    play_once = ('-p', f'trajectory:={record}', '-p', 'wait_for_subscriber:=false')
    run = run_process('rigid_gns_ros.tracker_node', *play_once)
    assert run.exit_code() == 0, run.output
    assert 'frames published' in run.output and 'Traceback' not in run.output
    run = run_process('rigid_gns_ros.tracker_node', *play_once, '-p', 'loop:=true')
    run.wait_for('started at stamp')
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
    assert 'Traceback' not in run.output
