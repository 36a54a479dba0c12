# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories, markers and diagnostics as bytes, beside what rclpy makes of the same messages."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest
from rigid_gns_core.messages.cdr import MessageError
from rigid_gns_core.messages.covariances import (
    encode_pose_with_covariance,
    encode_twist_with_covariance,
)
from rigid_gns_core.messages.diagnostics import encode_diagnostics, ERROR, OK, Status, WARN
from rigid_gns_core.messages.markers import (
    ellipsoid_markers,
    encode_markers,
    path_markers,
    sphere_markers,
)
from rigid_gns_core.messages.trajectories import decode_trajectory, encode_trajectory

# every residue of the length modulo 8, since padding depends on it; empty; UTF-8
FRAMES = ['', 'w', 'wo', 'wor', 'worl', 'world', 'world_', 'worlds_', 'Kugeln_äöü']
STAMP = 1_700_000_000_123_456_789
SIZES = [(0, 0), (0, 3), (1, 0), (3, 0), (1, 1), (2, 1), (3, 2), (21, 154)]


def future(points: int, count: int) -> tuple[list[str], list[int], np.ndarray, np.ndarray]:
    rng = np.random.default_rng(points + count)
    names = [f'sphere_{3**index}' if index < 20 else f'sphere_{index}' for index in range(count)]
    times = [round(index * 14_142_135.6) + index // 2 * 10**9 for index in range(points)]
    return names, times, rng.normal(size=(points, count, 7)), rng.normal(size=(points, count, 6))


@pytest.mark.parametrize('frame_id', FRAMES)
@pytest.mark.parametrize(('points', 'count'), SIZES)
def test_trajectory_round_trip(frame_id: str, points: int, count: int) -> None:
    names, times, poses, twists = future(points, count)
    cdr = encode_trajectory(STAMP, frame_id, names, times, poses, twists)
    found = decode_trajectory(cdr)
    assert (found.stamp_ns, found.frame_id) == (STAMP, frame_id)
    assert found.names == tuple(names) and found.times_ns == tuple(times)
    np.testing.assert_array_equal(found.poses, poses)
    np.testing.assert_array_equal(found.twists, twists)
    assert encode_trajectory(STAMP, frame_id, names, times, poses, twists) == cdr


def test_trajectory_of_the_wrong_shape_is_refused() -> None:
    names, times, poses, twists = future(3, 2)
    with pytest.raises(MessageError, match='poses have shape'):
        encode_trajectory(STAMP, 'world', names, times, poses[:2], twists)
    with pytest.raises(MessageError, match='twists have shape'):
        encode_trajectory(STAMP, 'world', names, times, poses, twists[:, :1])
    with pytest.raises(MessageError, match='NUL'):
        encode_trajectory(STAMP, 'world', ['a\0', 'b'], times, poses, twists)


def test_every_truncation_of_a_trajectory_is_refused() -> None:
    cdr = encode_trajectory(STAMP, 'world', *future(2, 2))
    for length in range(len(cdr)):
        with pytest.raises(MessageError):
            decode_trajectory(cdr[:length])
    with pytest.raises(MessageError, match='after the last field'):
        decode_trajectory(cdr + bytes(4))


def test_random_bytes_never_raise_anything_else() -> None:
    rng = np.random.default_rng(0)
    whole = encode_trajectory(STAMP, 'world', *future(2, 2))
    for _ in range(2000):
        damaged = bytearray(whole[: rng.integers(len(whole) + 1)])
        for place in rng.integers(max(len(damaged), 1), size=3):
            if damaged:
                damaged[place] = rng.integers(256)
        with contextlib.suppress(MessageError):
            decode_trajectory(bytes(damaged))


STATUSES = [
    Status(OK, 'simulator: tracking', 'well', {'rate [Hz]': '10', 'empty': ''}),
    Status(WARN, 'ü', '', {}),
    Status(ERROR, '', 'three words here', {'a': 'b'}),
]


def test_rosbags_reads_diagnostics() -> None:
    typesys = pytest.importorskip('rosbags.typesys', reason='rosbags is not installed')
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    kind = 'diagnostic_msgs/msg/DiagnosticArray'
    message = store.deserialize_cdr(encode_diagnostics(STAMP, STATUSES), kind)
    assert divmod(STAMP, 10**9) == (message.header.stamp.sec, message.header.stamp.nanosec)
    found = [
        Status(s.level, s.name, s.message, {v.key: v.value for v in s.values})
        for s in message.status
    ]
    assert found == STATUSES
    assert store.deserialize_cdr(encode_diagnostics(0, []), kind).status == []


# --- beside rclpy ---


def reread(cdr: bytes, kind: type) -> Any:
    """Return the message that rclpy reads, which must be as long when it writes it."""
    from rclpy.serialization import deserialize_message, serialize_message

    message = deserialize_message(cdr, kind)
    # bytes differ where rclpy leaves padding uninitialised
    assert len(serialize_message(message)) == len(cdr)
    return message


@pytest.mark.parametrize('frame_id', FRAMES)
@pytest.mark.parametrize(('points', 'count'), SIZES[:-1])
def test_rclpy_reads_trajectories(frame_id: str, points: int, count: int) -> None:
    pytest.importorskip('rclpy', reason='ROS is not installed')
    from geometry_msgs.msg import Transform, Twist, Vector3
    from rclpy.serialization import serialize_message
    from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

    names, times, poses, twists = future(points, count)
    expected = MultiDOFJointTrajectory(joint_names=names)
    expected.header.frame_id = frame_id
    expected.header.stamp.sec, expected.header.stamp.nanosec = divmod(STAMP, 10**9)
    for index, time in enumerate(times):
        point = MultiDOFJointTrajectoryPoint()
        for pose, twist in zip(poses[index].tolist(), twists[index].tolist(), strict=True):
            transform = Transform(translation=Vector3(**dict(zip('xyz', pose[:3], strict=True))))
            for axis, value in zip('xyzw', pose[3:], strict=True):
                setattr(transform.rotation, axis, value)
            point.transforms.append(transform)
            linear, angular = (
                Vector3(**dict(zip('xyz', part, strict=True))) for part in (twist[:3], twist[3:])
            )
            point.velocities.append(Twist(linear=linear, angular=angular))
        point.time_from_start.sec, point.time_from_start.nanosec = divmod(time, 10**9)
        expected.points.append(point)
    cdr = encode_trajectory(STAMP, frame_id, names, times, poses, twists)
    assert reread(cdr, MultiDOFJointTrajectory) == expected
    found = decode_trajectory(serialize_message(expected))
    np.testing.assert_array_equal(found.poses, poses)
    np.testing.assert_array_equal(found.twists, twists)


@pytest.mark.parametrize('frame_id', FRAMES)
@pytest.mark.parametrize('count', [1, 2, 5])
def test_rclpy_reads_markers(frame_id: str, count: int) -> None:
    pytest.importorskip('rclpy', reason='ROS is not installed')
    from visualization_msgs.msg import Marker, MarkerArray

    places = np.random.default_rng(count).normal(size=(4, count, 3))
    radii = np.where(np.arange(count) % 2, 0.5, 0.02)
    color = (0.25, 0.5, 0.75, 1.0)
    markers = sphere_markers('tracked', places[0], radii, color)
    markers += path_markers('path', range(7, 7 + count), places, 0.125, color)
    message = reread(encode_markers(STAMP, frame_id, 1_500_000_000, markers), MarkerArray)
    sizes = sorted(set(radii.tolist()))
    assert [m.ns for m in message.markers] == ['tracked'] * len(sizes) + ['path'] * count
    for marker in message.markers:
        assert marker.header.frame_id == frame_id
        assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == divmod(STAMP, 10**9)
        assert (marker.lifetime.sec, marker.lifetime.nanosec) == (1, 500_000_000)
        assert marker.action == Marker.ADD and marker.pose.orientation.w == 1.0
        assert (marker.color.r, marker.color.g, marker.color.b, marker.color.a) == color
        assert not marker.colors and not marker.text and not marker.mesh_resource
    for index, size in enumerate(sizes):
        marker = message.markers[index]
        assert marker.type == Marker.SPHERE_LIST and marker.id == index
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == (2 * size,) * 3
        points = [(p.x, p.y, p.z) for p in marker.points]
        np.testing.assert_array_equal(points, places[0][radii == size])
    for index in range(count):
        marker = message.markers[len(sizes) + index]
        assert marker.type == Marker.LINE_STRIP and marker.id == 7 + index
        assert marker.scale.x == 0.125
        np.testing.assert_array_equal([(p.x, p.y, p.z) for p in marker.points], places[:, index])


def test_rclpy_reads_diagnostics() -> None:
    pytest.importorskip('rclpy', reason='ROS is not installed')
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

    message = reread(encode_diagnostics(STAMP, STATUSES), DiagnosticArray)
    assert [s.name for s in message.status] == [s.name for s in STATUSES]
    assert [s.message for s in message.status] == [s.message for s in STATUSES]
    assert {s.hardware_id for s in message.status} == {'none'}
    levels = [DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR]
    assert [s.level for s in message.status] == levels
    values = [{v.key: v.value for v in s.values} for s in message.status]
    assert values == [s.values for s in STATUSES]


@pytest.mark.parametrize('frame_id', FRAMES)
def test_rclpy_reads_poses_and_twists_with_covariance(frame_id: str) -> None:
    pytest.importorskip('rclpy', reason='ROS is not installed')
    from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped

    root = np.random.default_rng(2).normal(size=(3, 3))
    place, covariance = np.array([1.0, -2.0, 0.25]), root @ root.T
    pose = reread(
        encode_pose_with_covariance(STAMP, frame_id, place, covariance), PoseWithCovarianceStamped
    )
    twist = reread(
        encode_twist_with_covariance(STAMP, frame_id, place, covariance),
        TwistWithCovarianceStamped,
    )
    for message in (pose, twist):
        assert message.header.frame_id == frame_id
        assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(STAMP, 10**9)
    where, speed = pose.pose.pose.position, twist.twist.twist.linear
    assert (where.x, where.y, where.z) == (speed.x, speed.y, speed.z) == tuple(place)
    assert pose.pose.pose.orientation.w == 1.0
    for found, rest in ((pose.pose.covariance, np.pi**2 / 3), (twist.twist.covariance, -1.0)):
        matrix = np.reshape(found, (6, 6))
        np.testing.assert_array_equal(matrix[:3, :3], covariance)
        np.testing.assert_array_equal(matrix[3:, 3:], rest * np.eye(3))
        assert not matrix[:3, 3:].any()


def test_ellipsoids_have_the_axes_of_their_covariance() -> None:
    """R diag(scale / 2 size)^2 R^T of the marker's pose is the covariance again."""
    rng = np.random.default_rng(4)
    roots = rng.normal(size=(20, 3, 3)) * [1.0, 0.1, 0.01]
    covariances = roots @ np.swapaxes(roots, 1, 2)
    places = rng.normal(size=(20, 3))
    markers = ellipsoid_markers('spread', places, covariances, 2.0, (0.2, 0.4, 0.8, 0.25))
    assert [m.id for m in markers] == list(range(20))
    for marker, place, covariance in zip(markers, places, covariances, strict=True):
        assert marker.pose[:3] == tuple(place) and isinstance(marker.scale, tuple)
        axes = np.stack([rotate(np.array(marker.pose[3:]), axis) for axis in np.eye(3)], axis=1)
        found = axes @ np.diag((np.array(marker.scale) / 4.0) ** 2) @ axes.T
        np.testing.assert_allclose(found, covariance, atol=1e-9)


def rotate(q: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return vector + 2 * np.cross(q[:3], np.cross(q[:3], vector) + q[3] * vector)
