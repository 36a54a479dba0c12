# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of other trackers, as rclpy writes them."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np
import pytest
from rigid_gns_core.messages.cdr import MessageError
from rigid_gns_core.messages.other_trackers import (
    pose_array_of_cloud,
    pose_array_of_point,
    pose_array_of_pose,
)
from rigid_gns_core.messages.poses import decode_pose_array

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PointStamped, PoseStamped
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField

STAMP = 1_700_000_000_123_456_789
FRAMES = ['', 'w', 'wo', 'wor', 'worl', 'world']
POINTS = np.array([[0.5, -1.25, 2.0], [np.nan, 0.0, 1.0], [3.0, 4.0, 5.5]])


def stamped(message: Any, frame_id: str) -> Any:
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(STAMP, 10**9)
    return message


def cloud(frame_id: str, kind: str, *, big: bool = False, extra: int = 4) -> Any:
    """Points with an intensity before them and padding behind."""
    size = 4 if kind == 'f4' else 8
    order = '>' if big else '<'
    rows = np.zeros(
        len(POINTS), np.dtype([('i', order + 'f4'), ('p', order + kind, 3), ('rest', f'V{extra}')])
    )
    rows['p'] = POINTS
    datatype = PointField.FLOAT32 if size == 4 else PointField.FLOAT64
    fields = [PointField(name='intensity', offset=0, datatype=PointField.FLOAT32, count=1)]
    fields += [
        PointField(name=name, offset=4 + size * k, datatype=datatype, count=1)
        for k, name in enumerate('xyz')
    ]
    step = rows.dtype.itemsize
    return stamped(
        PointCloud2(
            height=1, width=len(POINTS), fields=fields, is_bigendian=big, point_step=step,
            row_step=step * len(POINTS), data=rows.tobytes(), is_dense=False,
        ),
        frame_id,
    )  # fmt: skip


def check(cdr: bytes, frame_id: str, positions: np.ndarray, quaternions: np.ndarray) -> None:
    frame = decode_pose_array(cdr)
    assert (frame.stamp_ns, frame.frame_id) == (STAMP, frame_id)
    np.testing.assert_array_equal(frame.poses[:, :3], positions)
    np.testing.assert_array_equal(
        frame.poses[:, 3:], np.broadcast_to(quaternions, (len(positions), 4))
    )


@pytest.mark.parametrize('frame_id', FRAMES)
@pytest.mark.parametrize('kind', ['f4', 'f8'])
@pytest.mark.parametrize('big', [False, True])
def test_points_of_clouds(frame_id: str, kind: str, big: bool) -> None:
    cdr = serialize_message(cloud(frame_id, kind, big=big))
    check(pose_array_of_cloud(cdr), frame_id, POINTS, np.array([0, 0, 0, 1.0]))


def test_a_cloud_without_points_is_a_frame_without_poses() -> None:
    message = stamped(PointCloud2(height=1, width=0), 'world')
    assert len(decode_pose_array(pose_array_of_cloud(serialize_message(message))).poses) == 0


@pytest.mark.parametrize('frame_id', FRAMES)
def test_poses_and_points_of_one_ball(frame_id: str) -> None:
    point = stamped(PointStamped(), frame_id)
    point.point.x, point.point.y, point.point.z = POINTS[0].tolist()
    unturned = np.array([0, 0, 0, 1.0])
    check(pose_array_of_point(serialize_message(point)), frame_id, POINTS[:1], unturned)
    pose = stamped(PoseStamped(), frame_id)
    place, turn = pose.pose.position, pose.pose.orientation
    place.x, place.y, place.z = POINTS[0].tolist()
    half, unknown = np.array([0.5, -0.5, 0.5, -0.5]), np.zeros(4)
    for given, expected in ((half, half), (unknown, unknown), (np.full(4, np.nan), unknown)):
        turn.x, turn.y, turn.z, turn.w = given.tolist()
        check(pose_array_of_pose(serialize_message(pose)), frame_id, POINTS[:1], expected)


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        ({'fields': []}, 'no field x of float32 or float64'),
        ({'width': 4}, '4 points of 20 bytes, but 60 bytes'),
        ({'point_step': 8, 'width': 7, 'row_step': 56, 'data': bytes(56)}, 'no field y'),
        ({'row_step': 30, 'height': 3, 'width': 1}, None),
        ({'row_step': 25}, 'rows without padding'),
        # so many points would not fit into memory
        (
            {'height': 2**31, 'width': 2**31, 'point_step': 0, 'row_step': 0, 'data': b''},
            'no field x of float32 or float64 within points of 0 bytes',
        ),
    ],
)
def test_clouds_that_cannot_be_read_are_named(change: dict[str, Any], message: str | None) -> None:
    given = cloud('world', 'f4')
    for name, value in change.items():
        setattr(given, name, value)
    cdr = serialize_message(given)
    if message is None:
        assert len(decode_pose_array(pose_array_of_cloud(cdr)).poses) == 3
        return
    with pytest.raises(MessageError, match=message):
        pose_array_of_cloud(cdr)


def test_damaged_bytes_never_raise_anything_else() -> None:
    rng = np.random.default_rng(0)
    for convert, whole in (
        (pose_array_of_cloud, serialize_message(cloud('world', 'f4'))),
        (pose_array_of_pose, serialize_message(stamped(PoseStamped(), 'world'))),
        (pose_array_of_point, serialize_message(stamped(PointStamped(), 'world'))),
    ):
        for length in range(len(whole) - 4):
            with pytest.raises(MessageError):
                convert(whole[:length])
        for _ in range(500):
            damaged = bytearray(whole)
            for place in rng.integers(len(damaged), size=3):
                damaged[place] = rng.integers(256)
            with contextlib.suppress(MessageError):
                convert(bytes(damaged))
