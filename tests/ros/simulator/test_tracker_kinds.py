# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trackers that name their balls: a topic or frame of tf each, or arrays of objects, over DDS."""

from __future__ import annotations

from collections.abc import Callable
import re
import sys
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PointStamped, PoseStamped, TransformStamped
from rclpy.qos import qos_profile_sensor_data
from rigid_gns_core.errors import UserError

T0, DT = 1_000_123_456_789, 100_000_000  # [ns]; the first as in conftest.py
BALLS = ('ball_a', 'ball_b', 'ball_c')
FRAMES = 6
Message = Callable[[str], Any]


def stamped(message: Any, stamp_ns: int) -> Any:
    message.header.frame_id = 'world'
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    return message


def put(place: Any, values: np.ndarray) -> None:
    place.x, place.y, place.z = values.tolist()


def check(setup: Any, poses: np.ndarray) -> None:
    window = setup.node.simulation.window
    assert window.counts['accepted'] == FRAMES
    np.testing.assert_allclose(window.start()[1].positions, poses[:, :3], rtol=0, atol=1e-6)


def track(setup: Any, falling: Callable[..., np.ndarray], send: Callable[..., None]) -> None:
    """Send `FRAMES` frames, each when the one before is accepted; one lacks a ball."""
    window = setup.node.simulation.window
    for index in range(FRAMES):
        stamp = T0 + index * DT // 5
        setup.clock.set(stamp)
        send(falling(0.02 * index)[:, :3], stamp, index)
        if index != 3:  # then a ball is missing, and only the next frame ends this one
            setup.bench.until(lambda stamp=stamp: window.stamp_ns == stamp, f'frame {index}')
    check(setup, falling(0.02 * (FRAMES - 1)))
    assert window.counts['lost spheres'] == 1


@pytest.mark.parametrize('kind', [PoseStamped, PointStamped])
def test_a_topic_for_each_ball(
    simulated: Callable[..., Any], falling: Callable[..., Any], kind: Any
) -> None:
    setup = simulated(tracker=kind.__name__, balls=', '.join(BALLS), velocity_window=4)
    publishers = [
        setup.bench.tester.create_publisher(kind, name, qos_profile_sensor_data) for name in BALLS
    ]
    for publisher in publishers:
        setup.bench.until(publisher.get_subscription_count, 'the node')

    def send(places: np.ndarray, stamp: int, index: int) -> None:
        for ball, (publisher, place) in enumerate(zip(publishers, places, strict=True)):
            if (index, ball) == (3, 1):
                continue
            message = stamped(kind(), stamp + 1000 * ball)  # a microsecond apart
            put(message.pose.position if kind is PoseStamped else message.point, place)
            publisher.publish(message)

    track(setup, falling, send)


def test_a_frame_of_tf_for_each_ball(
    simulated: Callable[..., Any], falling: Callable[..., Any], message_package: Message
) -> None:
    kind = message_package('tf2_msgs').TFMessage
    # a slash before the name of a frame is that of ROS 1, as on /tf
    setup = simulated(tracker='tf', balls=','.join(('/ball_a', *BALLS[1:])), velocity_window=4)
    publisher = setup.bench.tester.create_publisher(kind, '/tf', 100)
    setup.bench.until(publisher.get_subscription_count, 'the node')

    def send(places: np.ndarray, stamp: int, index: int) -> None:
        found = [stamped(TransformStamped(child_frame_id='racket'), stamp)]
        for ball, place in enumerate(places):
            if (index, ball) != (3, 1):
                found.append(stamped(TransformStamped(child_frame_id=BALLS[ball]), stamp))
                put(found[-1].transform.translation, place)
        publisher.publish(kind(transforms=found))

    track(setup, falling, send)


def detections(package: Any, objects: list[tuple[str, np.ndarray]]) -> Any:
    message = package.Detection3DArray()
    for number, (name, place) in enumerate(objects):
        own = package.Detection3D(id=name)
        for score, offset in ((0.3, 1.0), (0.7, 0.0)):
            result = package.ObjectHypothesisWithPose()
            result.hypothesis.class_id, result.hypothesis.score = 'ball', score
            put(result.pose.pose.position, place + offset)
            own.results.append(result)
        if number % 2:  # this one by its box
            put(own.bbox.center.position, place)
            put(own.bbox.size, np.full(3, 0.1))
        message.detections.append(own)
    return message


def markers(package: Any, objects: list[tuple[str, np.ndarray]]) -> Any:
    found = [package.Marker(marker_index=k, marker_name=n) for k, (n, _) in enumerate(objects)]
    for marker, (_, place) in zip(found, objects, strict=True):
        put(marker.translation, place)
    return package.Markers(frame_number=7, markers=found)


def rigid_bodies(package: Any, objects: list[tuple[str, np.ndarray]]) -> Any:
    found = [package.RigidBody(rigid_body_name=name) for name, _ in objects]
    for body, (_, place) in zip(found, objects, strict=True):
        body.markers = markers(package, objects).markers
        put(body.pose.position, place)
    return package.RigidBodies(frame_number=7, rigidbodies=found)


def named_poses(package: Any, objects: list[tuple[str, np.ndarray]]) -> Any:
    found = [package.NamedPose(name=name) for name, _ in objects]
    for one, (_, place) in zip(found, objects, strict=True):
        put(one.pose.position, place)
    return package.NamedPoseArray(poses=found)


ARRAYS = {
    'vision_msgs/Detection3DArray': detections,
    'mocap4r2_msgs/Markers': markers,
    'mocap4r2_msgs/RigidBodies': rigid_bodies,
    'motion_capture_tracking_interfaces/NamedPoseArray': named_poses,
}


@pytest.mark.parametrize('named', [True, False])
@pytest.mark.parametrize('tracker', ARRAYS)
def test_arrays_of_objects(
    simulated: Callable[..., Any],
    falling: Callable[..., Any],
    message_package: Message,
    tracker: str,
    named: bool,
) -> None:
    package_name, kind = tracker.split('/')
    package = message_package(package_name)
    balls = ','.join(BALLS) if named else ''
    setup = simulated(tracker=tracker, balls=balls, velocity_window=4)
    publisher = setup.bench.tester.create_publisher(
        getattr(package, kind), 'tracked_objects', qos_profile_sensor_data
    )
    setup.bench.until(publisher.get_subscription_count, 'the node')

    def send(places: np.ndarray, stamp: int, index: int) -> None:
        places = places.copy()
        objects = list(zip(BALLS, places, strict=True))
        if index == 3:
            places[1] = np.nan
        if named:  # in any order, with others, and one may not be there
            objects = [('racket', np.ones(3)), *objects[::-1]]
            objects = [one for one in objects if np.isfinite(one[1]).all()]
        publisher.publish(stamped(ARRAYS[tracker](package, objects), stamp))

    track(setup, falling, send)


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        ({'tracker': 'PoseStamped'}, 'but balls is empty; name the topics'),
        ({'balls': 'a'}, "balls is 'a', but tracker is ''; choose one of PoseStamped"),
        ({'tracker': 'tf', 'balls': 'a,a'}, "balls is 'a,a', in which a name is twice"),
        ({'tracker': 'tf', 'balls': 'a,,b'}, 'a name is empty'),
        ({'tracker': 'PoseStamped', 'balls': 'ball 1'}, "Invalid topic name: .*'ball 1'"),
        (
            {'tracker': 'PoseStamped', 'balls': 'predicted_poses'},
            'topic /predicted_poses would be of PoseStamped, but this node has it with PoseArray',
        ),
        ({'tracker': 'Vicon'}, "tracker is 'Vicon', allowed: , PoseStamped"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(
    simulated: Callable[..., Any], parameters: dict[str, str], said: str
) -> None:
    with pytest.raises(UserError) as error:
        simulated(**parameters)
    assert re.search(said, str(error.value))


@pytest.mark.parametrize('tracker', ['tf', 'vision_msgs/Detection3DArray'])
def test_a_package_that_is_not_installed_is_named(
    simulated: Callable[..., Any], tracker: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = 'tf2_msgs' if tracker == 'tf' else tracker.split('/')[0]
    monkeypatch.setitem(sys.modules, f'{package}.msg', None)  # an import fails, as without it
    with pytest.raises(UserError, match=f'parameter tracker is {tracker!r}.*{package}'):
        simulated(tracker=tracker, balls='a, b')
