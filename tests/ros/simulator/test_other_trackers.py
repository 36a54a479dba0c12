# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trackers that send clouds, poses or points, over DDS."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PointStamped, PoseStamped
from rclpy.qos import qos_profile_sensor_data
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import decode_pose_array
from sensor_msgs.msg import PointCloud2, PointField

T0, DT = 1_000_123_456_789, 100_000_000  # [ns]; the first as in conftest.py


def stamped(message: Any, stamp_ns: int) -> Any:
    message.header.frame_id = 'world'
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    return message


def cloud(points: np.ndarray) -> PointCloud2:
    fields = [
        PointField(name=name, offset=8 * k, datatype=PointField.FLOAT64, count=1)
        for k, name in enumerate('xyz')
    ]
    return PointCloud2(
        height=1, width=len(points), fields=fields, point_step=24, row_step=24 * len(points),
        data=points.astype('<f8').tobytes(),
    )  # fmt: skip


def one_pose(points: np.ndarray) -> PoseStamped:
    """Of the first ball, with an orientation that says nothing."""
    message = PoseStamped()
    where, turn = message.pose.position, message.pose.orientation
    where.x, where.y, where.z = points[0].tolist()
    turn.w = 0.0
    return message


def one_point(points: np.ndarray) -> PointStamped:
    message = PointStamped()
    message.point.x, message.point.y, message.point.z = points[0].tolist()
    return message


@pytest.mark.parametrize(
    ('topic', 'made', 'count'),
    [('tracked_points', cloud, 3), ('tracked_pose', one_pose, 1), ('tracked_point', one_point, 1)],
)
def test_what_trackers_send_is_predicted_and_recorded_as_poses(
    simulated: Callable[..., Any],
    falling: Callable[..., Any],
    tmp_path: Path,
    topic: str,
    made: Callable[[np.ndarray], Any],
    count: int,
) -> None:
    setup = simulated(record=str(tmp_path / 'bag'), velocity_window=3)
    publisher = setup.bench.tester.create_publisher(
        type(made(np.zeros((1, 3)))), topic, qos_profile_sensor_data
    )
    setup.bench.until(publisher.get_subscription_count, 'the node')
    sent = []
    for index in range(3):
        stamp = T0 + (index - 2) * DT // 5
        sent.append(falling(0.02 * index)[:, :3])
        publisher.publish(stamped(made(sent[-1]), stamp))
        window = setup.node.simulation.window
        setup.bench.until(lambda stamp=stamp, own=window: own.stamp_ns == stamp, 'the frame')
    setup.clock.set(T0 + DT)
    (found,) = setup.tracked.wait(1)
    # the fall goes on from the last frame
    assert len(found.poses) == count
    np.testing.assert_allclose(found.poses[:, :3], falling(0.14)[:count, :3], atol=1e-6)
    setup.node.simulation.close()
    recorded = read_bag(tmp_path / 'bag').topics['/tracked_poses'].messages
    for cdr, points in zip(recorded, sent, strict=True):
        np.testing.assert_array_equal(decode_pose_array(cdr).poses[:, :3], points[:count])


def test_a_cloud_with_a_lost_ball_costs_that_ball_alone(
    simulated: Callable[..., Any], falling: Callable[..., Any], log: Callable[[], str]
) -> None:
    setup = simulated(velocity_window=4)
    publisher = setup.bench.tester.create_publisher(
        PointCloud2, 'tracked_points', qos_profile_sensor_data
    )
    setup.bench.until(publisher.get_subscription_count, 'the node')
    for index in range(6):
        points = falling(0.02 * index)[:, :3]
        if index == 4:
            points[1] = np.nan
        stamp = T0 + index * DT // 5
        setup.clock.set(stamp)
        publisher.publish(stamped(cloud(points), stamp))
        window = setup.node.simulation.window
        setup.bench.until(lambda stamp=stamp, own=window: own.stamp_ns == stamp, 'the frame')
    assert setup.node.simulation.window.counts['lost spheres'] == 1
    bad = cloud(falling(0.2)[:, :3])
    bad.fields = []
    publisher.publish(stamped(bad, T0 + 6 * DT // 5))
    setup.bench.until(lambda: 'no field x of float32 or float64' in log(), 'the warning')


def test_a_pose_array_without_rotations_loses_no_ball(
    simulated: Callable[..., Any], falling: Callable[..., Any]
) -> None:
    setup = simulated(velocity_window=4)
    window = setup.node.simulation.window
    for index in range(6):
        stamp, poses = T0 + index * DT // 5, falling(0.02 * index)
        poses[0, 3:], poses[1, 3:] = np.nan, 0.0
        if index == 4:
            poses[2, :3] = np.nan  # this one is lost, the others count
        setup.clock.set(stamp)
        setup.frame(poses, stamp)
        assert window.counts['lost spheres'] == (index >= 4)
    state = window.start()[1]
    np.testing.assert_allclose(state.positions, falling(0.1)[:, :3], atol=1e-6)
    assert window.counts['accepted'] == 6
