# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trackers in a coordinate frame of their own, with tf present, late and absent, over DDS."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import sys
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import TransformStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import decode_pose_array
from scipy.spatial.transform import Rotation

T0, DT = 1_000_123_456_789, 100_000_000  # [ns]; the first as in conftest.py
STATIC = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
PLACE, TURN = np.array([1.0, -2.0, 0.5]), Rotation.from_rotvec([0.4, -0.9, 1.3])


def transform(place: np.ndarray, stamp_ns: int, child: str = 'camera') -> TransformStamped:
    """Of a camera at a place, turned by `TURN`."""
    found = TransformStamped(child_frame_id=child)
    found.header.frame_id = 'world'
    found.header.stamp.sec, found.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    at, turn = found.transform.translation, found.transform.rotation
    at.x, at.y, at.z = place.tolist()
    turn.x, turn.y, turn.z, turn.w = TURN.as_quat().tolist()
    return found


def seen_from(place: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Poses as the camera sees them."""
    turns = TURN.inv() * Rotation.from_quat(poses[:, 3:])
    return np.concatenate([TURN.inv().apply(poses[:, :3] - place), turns.as_quat()], axis=1)


@pytest.fixture
def tf(message_package: Callable[[str], Any]) -> Any:
    return message_package('tf2_msgs').TFMessage


def test_a_camera_that_stands_and_one_that_moves(
    simulated: Callable[..., Any], falling: Callable[..., Any], tf: Any, tmp_path: Path
) -> None:
    """Transforms come before, with, and after the frames that need them."""
    setup = simulated(record=str(tmp_path / 'bag'), velocity_window=3, transform_timeout=10.0)
    bench, window = setup.bench, setup.node.simulation.window
    static = bench.tester.create_publisher(tf, '/tf_static', STATIC)
    static.publish(tf(transforms=[transform(PLACE, 0)]))
    speed = np.array([0.3, 0.1, 0.0])  # [m/s], of the camera `moving`
    moving = bench.tester.create_publisher(tf, '/tf', 100)
    stamps = [T0 + (index - 2) * DT // 5 for index in range(3)]
    for index, stamp in enumerate(stamps):
        poses = falling(0.02 * index)
        if index == 0:
            setup.tracked.send(seen_from(PLACE, poses), stamp, 'camera')
        else:
            place = PLACE + speed * 0.02 * index
            setup.tracked.send(seen_from(place, poses), stamp, 'moving')
            bench.until(moving.get_subscription_count, 'the node on /tf')
            # the frame is between the two; the second one comes after it
            for offset in (-0.01, 0.01):
                at = transform(place + speed * offset, stamp + round(offset * 1e9), 'moving')
                assert window.stamp_ns != stamp
                moving.publish(tf(transforms=[at]))
        bench.until(lambda stamp=stamp: window.stamp_ns == stamp, 'the frame')
    setup.clock.set(T0 + DT)
    (found,) = setup.tracked.wait(1)
    assert found.frame_id == 'world'
    np.testing.assert_allclose(found.poses[:, :3], falling(0.14)[:, :3], atol=1e-6)
    setup.node.simulation.close()
    recorded = read_bag(tmp_path / 'bag').topics['/tracked_poses'].messages
    frames = [decode_pose_array(cdr) for cdr in recorded]
    assert [(frame.frame_id, frame.stamp_ns) for frame in frames] == [('world', s) for s in stamps]
    for index, frame in enumerate(frames):
        poses = falling(0.02 * index)
        np.testing.assert_allclose(frame.poses[:, :3], poses[:, :3], atol=1e-9)
        turned = Rotation.from_quat(frame.poses[:, 3:]).inv() * Rotation.from_quat(poses[:, 3:])
        assert turned.magnitude().max() < 1e-9


def test_a_transform_that_comes_too_late_costs_its_frames(
    simulated: Callable[..., Any], falling: Callable[..., Any], tf: Any, log: Callable[[], str]
) -> None:
    setup = simulated(transform_timeout=0.2)
    bench, simulation = setup.bench, setup.node.simulation
    moving = bench.tester.create_publisher(tf, '/tf', 100)
    setup.tracked.send(falling(0.0), T0, 'camera')
    bench.until(moving.get_subscription_count, 'the node on /tf')
    moving.publish(tf(transforms=[transform(PLACE, T0 - DT)]))
    bench.until(lambda: simulation.diagnostics.rejected == 1, 'the refusal')
    assert "the transform of 'camera' in 'world' at its stamp is not known" in log()
    for stamp in (T0 + DT, T0 + 3 * DT):
        moving.publish(tf(transforms=[transform(PLACE, stamp)]))
    setup.tracked.send(seen_from(PLACE, falling(0.2)), T0 + 2 * DT, 'camera')
    bench.until(lambda: simulation.window.stamp_ns == T0 + 2 * DT, 'the frame')
    bad = transform(PLACE, T0)
    bad.transform.rotation.w = 5.0
    moving.publish(tf(transforms=[bad]))
    bench.until(lambda: "on /tf transform from 'camera' to 'world'" in log(), 'the warning')


def test_without_a_transform_the_error_names_the_frames_and_the_remedy(
    simulated: Callable[..., Any], falling: Callable[..., Any], tf: Any, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.tracked.send(falling(0.0), T0, 'camera')
    setup.bench.until(lambda: setup.node.simulation.diagnostics.rejected == 1, 'the refusal')
    said = log()
    assert "its frame is 'camera', expected 'world' (parameter frame_id)" in said
    assert 'static_transform_publisher' in said and '--child-frame-id camera' in said


def test_without_tf_the_error_names_the_package(
    simulated: Callable[..., Any],
    falling: Callable[..., Any],
    log: Callable[[], str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)  # an import fails, as without it
    setup = simulated()
    setup.tracked.send(falling(0.0), T0, 'camera')
    setup.bench.until(lambda: setup.node.simulation.diagnostics.rejected == 1, 'the refusal')
    assert "its frame is 'camera', expected 'world' (parameter frame_id); to transform it" in log()
    assert 'install the ROS package tf2_msgs' in log()
