# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A racket whose pose comes on a topic, over DDS: what it does to a ball, and what is said."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
import sys
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, Transform, TransformStamped, Twist, TwistStamped
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.trajectories import decode_trajectory
from rigid_gns_core.recordings.scoring.reproduce import reproduce
from rigid_gns_ros.node.simulator import SimulatorNode
from scipy.spatial.transform import Rotation
from std_msgs.msg import String
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint
from visualization_msgs.msg import MarkerArray
import yaml

T0 = 1_000_123_456_789  # [ns], as in conftest.py
FRAME = round(1e9 / 240)  # of both trackers [ns]
BALL, BALL_SPEED = np.array([1.0, 0.0, 1.0]), -3.0  # [m], [m/s] along x
RACKET, RACKET_SPEED = -0.8, 2.0  # plate's place along x at T0 [m], its speed
RADIUS, FRAMES = 0.02, 12
AFTER = 2 * RACKET_SPEED - BALL_SPEED  # elastic and smooth: 2 V - v
MEET = (BALL[0] - RADIUS - RACKET) / (RACKET_SPEED - BALL_SPEED)  # [s] after T0

# in the frame of the racket it faces along z, 5 cm in front of where it is tracked
SCENE = {
    'surfaces': [
        {'point': [0.0, 0.0, 0.0], 'normal': [0.0, 0.0, 1.0]},
        {
            'point': [0.0, 0.0, 0.05],
            'normal': [0.0, 0.0, 1.0],
            'direction': [1.0, 0.0, 0.0],
            'length_x': 2.0,
            'length_y': 2.0,
        },
    ],
    'radius': RADIUS,
    'friction': 0.0,
    'restitution': 1.0,
}
ALONG_X = Rotation.from_rotvec([0.0, np.pi / 2, 0.0]).as_quat()  # z of the racket is x


def stamped(message: Any, stamp_ns: int, frame_id: str = 'world') -> Any:
    message.header.frame_id = frame_id
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    return message


def pose(time: float) -> PoseStamped:
    """Of the racket, which is tracked 5 cm behind its plate."""
    message = PoseStamped()
    where, turn = message.pose.position, message.pose.orientation
    where.x, where.z = RACKET - 0.05 + RACKET_SPEED * time, 1.0
    turn.x, turn.y, turn.z, turn.w = ALONG_X.tolist()
    return message


def twist(speed: float) -> TwistStamped:
    message = TwistStamped()
    message.twist.linear.x = speed
    return message


def plan() -> MultiDOFJointTrajectory:
    """From T0 on for a second, without velocities."""
    message = MultiDOFJointTrajectory(joint_names=['racket'])
    for time in (0.0, 1.0):
        known, transform = pose(time).pose, Transform()
        transform.translation.x, transform.translation.z = known.position.x, 1.0
        transform.rotation = known.orientation
        point = MultiDOFJointTrajectoryPoint(transforms=[transform])
        point.time_from_start.sec = int(time)
        message.points.append(point)
    return message


class Stroke:
    """A ball that flies at a racket, both seen at 240 Hz."""

    def __init__(
        self, simulated: Callable[..., Any], folder: Path, body: str, **parameters: Any
    ) -> None:
        path = folder / 'scene.yaml'
        path.write_text(yaml.safe_dump({'scene': SCENE}), encoding='utf-8')
        self.setup = simulated(
            scene=str(path),
            moving_surfaces=f'racket: {{surfaces: [1], {body}}}',
            **{'start': 'every', 'horizon': 0.6, 'velocity_window': 6, **parameters},
        )
        bench = self.setup.bench
        self.futures: list[bytes] = []
        self.crossings: list[Any] = []
        topics = self.setup.node.simulation.topics
        for kind, own, heard, raw in (
            (MultiDOFJointTrajectory, topics.trajectory, self.futures, True),
            (String, topics.crossings, self.crossings, False),
        ):
            bench.tester.create_subscription(
                kind, own.topic_name, heard.append, QoSProfile(depth=50), raw=raw
            )
            bench.until(own.get_subscription_count, own.topic_name)
        self._publishers: dict[str, Any] = {}

    @property
    def track(self) -> Any:
        return self.setup.node.simulation.surfaces.tracks['racket']

    def send(self, topic: str, message: Any, *, reliable: bool = False) -> None:
        bench = self.setup.bench
        if topic not in self._publishers:
            own = bench.tester.create_publisher(
                type(message), topic, QoSProfile(depth=5) if reliable else qos_profile_sensor_data
            )
            bench.until(own.get_subscription_count, f'a subscriber of {topic}')
            self._publishers[topic] = own
        self._publishers[topic].publish(message)

    def racket(self, stamp_ns: int) -> None:
        self.send('racket/pose', stamped(pose((stamp_ns - T0) * 1e-9), stamp_ns))
        self.setup.bench.until(lambda: self.track.age(stamp_ns) == 0.0, 'the pose')

    def ball(self, stamp_ns: int) -> None:
        time = (stamp_ns - T0) * 1e-9
        place = BALL + [BALL_SPEED * time, 0.0, 0.5 * time - 0.5 * 9.81 * time**2]
        self.setup.clock.set(stamp_ns)
        self.setup.frame(np.array([[*place, 0.0, 0.0, 0.0, 1.0]]), stamp_ns)

    def run(self, racket: Callable[[int], object]) -> None:
        for frame in range(FRAMES):
            racket(T0 + frame * FRAME)
            self.ball(T0 + frame * FRAME)

    def last_future(self) -> Any:
        last = T0 + (FRAMES - 1) * FRAME

        def found() -> list[Any]:
            decoded = [decode_trajectory(cdr) for cdr in self.futures]
            return [one for one in decoded if one.stamp_ns == last]

        self.setup.bench.until(found, 'the last future')
        return found()[-1]


def check_stroke(future: Any) -> None:
    """The ball is struck when and as the law of an elastic wall that moves says."""
    times = (future.stamp_ns - T0) * 1e-9 + np.array(future.times_ns) * 1e-9
    x, speed = future.poses[:, 0, 0], future.twists[:, 0, 0]
    before, after = times < MEET - 1e-3, times > MEET + 1e-3
    assert before.sum() > 5 and after.sum() > 5
    np.testing.assert_allclose(speed[before], BALL_SPEED, atol=1e-6)
    np.testing.assert_allclose(speed[after], AFTER, atol=1e-5)
    where = BALL[0] + BALL_SPEED * MEET + AFTER * (times[after] - MEET)
    np.testing.assert_allclose(x[after], where, atol=1e-5)


def test_a_racket_followed_by_its_poses_strikes_a_ball_and_the_bag_reproduces(
    simulated: Callable[..., Any], tmp_path: Path
) -> None:
    stroke = Stroke(
        simulated, tmp_path, 'pose: racket/pose', record=str(tmp_path / 'bag'),
        crossing_planes='net: {point: [0.5, 0, 0], normal: [1, 0, 0]}',
    )  # fmt: skip
    stroke.run(stroke.racket)
    check_stroke(stroke.last_future())
    last = T0 + (FRAMES - 1) * FRAME
    stroke.setup.bench.until(
        lambda: any(json.loads(m.data)['stamp_ns'] == last for m in stroke.crossings), 'crossings'
    )
    (own,) = json.loads(stroke.crossings[-1].data)['planes']['net']
    assert own['velocity'][0] == pytest.approx(BALL_SPEED, abs=1e-6)  # on its way there
    # predictions of each start for a while
    stroke.setup.clock.set(last + 50_000_000)
    stroke.setup.tracked.wait(2)
    stroke.setup.node.close()
    bag = read_bag(tmp_path / 'bag')
    assert not bag.warnings
    poses = bag.topics['/racket/pose']
    assert (len(poses), poses.type_name) == (FRAMES, 'geometry_msgs/msg/PoseStamped')
    start = json.loads(bag.topics['/simulator/start'].messages[-1][8:-1])
    assert start['surfaces']['1']['velocity'][0] == pytest.approx(RACKET_SPEED, abs=1e-6)
    result = reproduce(bag, find_topics(bag))
    assert result.predictions >= 2 and result.starts >= 2
    assert (result.same, result.different, result.unknown) == (result.predictions, 0, 0), result


def test_markers_show_the_plate_where_it_is(simulated: Callable[..., Any], tmp_path: Path) -> None:
    stroke = Stroke(simulated, tmp_path, 'pose: racket/pose')
    bench, drawn = stroke.setup.bench, []
    bench.tester.create_subscription(MarkerArray, '/predicted_markers', drawn.append, 100)
    bench.until(stroke.setup.node.simulation.topics.markers.get_subscription_count, 'a listener')
    stroke.run(stroke.racket)
    last = T0 + (FRAMES - 1) * FRAME

    def plates() -> list[Any]:
        shown = [m for array in drawn for m in array.markers if m.ns == 'carried']
        return [m for m in shown if m.header.stamp.nanosec == last % 10**9]

    bench.until(plates, 'the plate at the last frame')
    corners = np.array([[p.x, p.y, p.z] for p in plates()[-1].points])
    x = RACKET + RACKET_SPEED * (FRAMES - 1) * FRAME * 1e-9
    np.testing.assert_allclose(corners[:, 0], x, atol=1e-9)
    np.testing.assert_allclose(np.abs(corners[:, 1:] - [0.0, 1.0]), 1.0, atol=1e-9)
    assert len(drawn[-1].markers) and plates()[-1].header.frame_id == 'world'


def test_twists_that_are_sent_hold(simulated: Callable[..., Any], tmp_path: Path) -> None:
    """One pose alone has no slope."""
    stroke = Stroke(simulated, tmp_path, 'pose: racket/pose, twist: racket/twist')

    def racket(stamp_ns: int) -> None:
        if stamp_ns == T0:
            stroke.racket(stamp_ns)
            stroke.send('racket/twist', stamped(twist(RACKET_SPEED), stamp_ns))
            stroke.setup.bench.until(lambda: stroke.track._twist is not None, 'the twist')

    stroke.run(racket)
    check_stroke(stroke.last_future())


def test_a_plan_tells_the_motion(simulated: Callable[..., Any], tmp_path: Path) -> None:
    stroke = Stroke(simulated, tmp_path, 'plan: racket/plan')

    def racket(stamp_ns: int) -> None:
        if stamp_ns == T0:
            stroke.send('racket/plan', stamped(plan(), T0), reliable=True)
            stroke.setup.bench.until(lambda: stroke.track.plan is not None, 'the plan')

    stroke.run(racket)
    check_stroke(stroke.last_future())


PUSH = 8.0  # of a racket that accelerates [m/s^2]


def accelerating(frame_id: str = 'world') -> MultiDOFJointTrajectory:
    """From T0 on for a second in steps of 0.1 s, with velocities."""
    message = stamped(MultiDOFJointTrajectory(joint_names=['racket']), T0, frame_id)
    for k in range(11):
        time, known = 0.1 * k, pose(0.0).pose
        transform, speed = Transform(), Twist()
        transform.translation.x = RACKET - 0.05 + PUSH / 2 * time**2
        transform.translation.z, transform.rotation = 1.0, known.orientation
        speed.linear.x = PUSH * time
        point = MultiDOFJointTrajectoryPoint(transforms=[transform], velocities=[speed])
        seconds, left = divmod(k, 10)
        point.time_from_start.sec, point.time_from_start.nanosec = seconds, left * 100_000_000
        message.points.append(point)
    return message


def test_a_plan_that_accelerates_strikes_with_its_speed_then_and_the_bag_reproduces(
    simulated: Callable[..., Any], tmp_path: Path
) -> None:
    stroke = Stroke(
        simulated, tmp_path, 'plan: racket/plan', record=str(tmp_path / 'bag'), samples=8,
        crossing_planes='net: {point: [0.5, 0, 0], normal: [1, 0, 0]}',
    )  # fmt: skip

    def racket(stamp_ns: int) -> None:
        if stamp_ns == T0:
            stroke.send('racket/plan', accelerating(), reliable=True)
            stroke.setup.bench.until(lambda: stroke.track.plan is not None, 'the plan')

    stroke.run(racket)
    future = stroke.last_future()
    meet = max(np.roots([PUSH / 2, -BALL_SPEED, RACKET + RADIUS - BALL[0]]))
    after = 2 * PUSH * meet - BALL_SPEED
    times = (future.stamp_ns - T0) * 1e-9 + np.array(future.times_ns) * 1e-9
    late = times > meet + 1e-3
    assert late.sum() > 5
    # stamps are whole nanoseconds, and the ball's speed is estimated from frames
    np.testing.assert_allclose(future.twists[late, 0, 0], after, rtol=1e-4)
    np.testing.assert_allclose(
        future.poses[late, 0, 0],
        BALL[0] + BALL_SPEED * meet + after * (times[late] - meet),
        atol=1e-4,
    )
    last = T0 + (FRAMES - 1) * FRAME
    stroke.setup.clock.set(last + 50_000_000)
    stroke.setup.tracked.wait(2)
    stroke.setup.node.close()
    bag = read_bag(tmp_path / 'bag')
    start = json.loads(bag.topics['/simulator/start'].messages[-1][8:-1])
    assert len(start['surfaces']['1']['plan']['times']) == 11
    result = reproduce(bag, find_topics(bag))
    assert result.predictions >= 2 and result.starts >= 2
    assert (result.same, result.different, result.unknown) == (result.predictions, 0, 0), result


def test_a_racket_is_a_frame_of_tf(
    simulated: Callable[..., Any], tmp_path: Path, message_package: Callable[[str], Any]
) -> None:
    """A wrist that stands, and a racket in its frame that moves."""
    tf = message_package('tf2_msgs').TFMessage
    stroke = Stroke(simulated, tmp_path, 'frame: racket_link', record=str(tmp_path / 'bag'))
    tester = stroke.setup.bench.tester
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    static, moving = tester.create_publisher(tf, '/tf_static', latched), None

    def link(parent: str, child: str, x: float, z: float, stamp_ns: int) -> Any:
        found = TransformStamped(child_frame_id=child)
        found.transform.translation.x, found.transform.translation.z = x, z
        return stamped(found, stamp_ns, parent)

    static.publish(tf(transforms=[link('world', 'wrist', -2.0, 1.0, 0)]))
    moving = tester.create_publisher(tf, '/tf', 100)
    stroke.setup.bench.until(moving.get_subscription_count, 'the node on /tf')

    def racket(stamp_ns: int) -> None:
        known = pose((stamp_ns - T0) * 1e-9).pose
        one = link('wrist', 'racket_link', known.position.x + 2.0, 0.0, stamp_ns)
        one.transform.rotation = known.orientation
        moving.publish(tf(transforms=[one]))
        stroke.setup.bench.until(
            lambda: stroke.track.age(stamp_ns) == 0.0 or stamp_ns == T0, 'the transform'
        )

    stroke.run(racket)
    check_stroke(stroke.last_future())
    stroke.setup.node.close()
    bag = read_bag(tmp_path / 'bag')
    result = reproduce(bag, find_topics(bag))
    assert result.predictions > 0
    assert (result.same, result.different, result.unknown) == (result.predictions, 0, 0), result


ARM_PLACE, ARM_TURN = np.array([-2.0, 0.3, 1.0]), Rotation.from_rotvec([0.4, -0.9, 1.3])


def seen_from_arm(place: Any, turn: Any) -> None:
    """Turn a position and a quaternion of a message into the frame of the arm."""
    at = ARM_TURN.inv().apply(np.array([place.x, place.y, place.z]) - ARM_PLACE)
    rotation = ARM_TURN.inv() * Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
    place.x, place.y, place.z = at.tolist()
    turn.x, turn.y, turn.z, turn.w = rotation.as_quat().tolist()


def along_arm(vector: Any) -> None:
    """Turn a vector of a message along the axes of the arm."""
    found = ARM_TURN.inv().apply([vector.x, vector.y, vector.z])
    vector.x, vector.y, vector.z = found.tolist()


@pytest.mark.parametrize('role', ['pose', 'twist', 'plan'])
def test_a_racket_in_the_frame_of_an_arm_is_transformed(
    simulated: Callable[..., Any], tmp_path: Path, message_package: Callable[[str], Any], role: str
) -> None:
    """The transform comes after the first message that needs it."""
    tf = message_package('tf2_msgs').TFMessage
    body = {
        'pose': 'pose: racket/pose',
        'twist': 'pose: racket/pose, twist: racket/twist',
        'plan': 'plan: racket/plan',
    }[role]
    stroke = Stroke(simulated, tmp_path, body, transform_timeout=10.0)
    bench = stroke.setup.bench
    static = bench.tester.create_publisher(
        tf, '/tf_static', QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    )
    arm = stamped(TransformStamped(child_frame_id='arm'), 0)
    at, turn = arm.transform.translation, arm.transform.rotation
    at.x, at.y, at.z = ARM_PLACE.tolist()
    turn.x, turn.y, turn.z, turn.w = ARM_TURN.as_quat().tolist()

    def racket(stamp_ns: int) -> None:
        first = stamp_ns == T0
        if role == 'plan':
            if not first:
                return
            message: Any = stamped(plan(), T0, 'arm')
            for point in message.points:
                seen_from_arm(point.transforms[0].translation, point.transforms[0].rotation)
            stroke.send('racket/plan', message, reliable=True)
        elif first or role == 'pose':
            message = stamped(pose((stamp_ns - T0) * 1e-9), stamp_ns, 'arm')
            seen_from_arm(message.pose.position, message.pose.orientation)
            stroke.send('racket/pose', message)
        if first and role == 'twist':
            speed = stamped(twist(RACKET_SPEED), stamp_ns, 'arm')
            along_arm(speed.twist.linear)
            stroke.send('racket/twist', speed)
        if first:
            bench.until(lambda: stroke.setup.node.simulation._intake.transforms._waiting, 'it')
            assert not stroke.track.known
            static.publish(tf(transforms=[arm]))
        bench.until(
            lambda: (
                stroke.track.plan is not None
                if role == 'plan'
                else stroke.track.age(stamp_ns) == 0.0 or role == 'twist'
            ),
            'the message',
        )
        if role == 'twist':
            bench.until(lambda: stroke.track.known and stroke.track._twist is not None, 'both')

    stroke.run(racket)
    check_stroke(stroke.last_future())


def test_a_frame_without_a_transform_is_said_with_the_remedy(
    simulated: Callable[..., Any],
    tmp_path: Path,
    message_package: Callable[[str], Any],
    log: Callable[[], str],
) -> None:
    message_package('tf2_msgs')
    stroke = Stroke(simulated, tmp_path, 'pose: racket/pose', transform_timeout=0.01)
    bodies = stroke.setup.node.simulation._bodies
    stroke.send('racket/pose', stamped(pose(0.0), T0, 'arm'))
    stroke.setup.bench.until(lambda: bodies._rejected['racket'] == 1, 'the refusal')
    text = log()
    assert (
        "pose of racket rejected: its frame is 'arm', expected 'world' (parameter frame_id)"
        in text
    )
    assert 'publish one, as by `ros2 run tf2_ros static_transform_publisher' in text
    assert '--frame-id world --child-frame-id arm`' in text
    assert not stroke.track.known
    stroke.send('racket/pose', stamped(pose(0.0), T0, ''))
    stroke.setup.bench.until(lambda: bodies._rejected['racket'] == 2, 'the frame without a name')


def test_without_tf_a_frame_cannot_be_followed(
    simulated: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ('tf2_msgs', 'tf2_msgs.msg'):  # as where it is not installed
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(UserError, match="frame 'racket_link' of tf, which needs the ROS package"):
        Stroke(simulated, tmp_path, 'frame: racket_link')


def test_nothing_is_predicted_before_the_racket_is_known(
    simulated: Callable[..., Any], tmp_path: Path, log: Callable[[], str]
) -> None:
    stroke = Stroke(simulated, tmp_path, 'pose: racket/pose')
    for frame in range(8):
        stroke.ball(T0 + frame * FRAME)
    assert 'nothing has come for racket on racket/pose yet' in log()
    assert stroke.setup.node.simulation.predictor.forecast is None and not stroke.futures
    stroke.racket(T0 + 8 * FRAME)
    stroke.ball(T0 + 8 * FRAME)
    assert stroke.setup.node.simulation.predictor.forecast is not None


def test_a_racket_that_stops_coming_is_at_rest_and_said(
    simulated: Callable[..., Any], tmp_path: Path, log: Callable[[], str]
) -> None:
    stroke = Stroke(simulated, tmp_path, 'pose: racket/pose, timeout: 0.02')
    said: list[Any] = []
    bench = stroke.setup.bench
    bench.tester.create_subscription(DiagnosticArray, '/diagnostics', said.append, 10)
    stroke.run(lambda stamp: stroke.racket(stamp) if stamp < T0 + 4 * FRAME else None)
    future = stroke.last_future()
    after = future.twists[-1, 0, 0]
    assert after == pytest.approx(-BALL_SPEED, abs=1e-5)  # of an elastic wall at rest
    text = log()
    assert 'racket is taken as at rest where it was: its newest pose on racket/pose is 0.0' in text
    assert 'older than the tracked frame (expected within 0.02 s)' in text

    def surfaces() -> list[Any]:
        found = [status for array in said for status in array.status]
        return [one for one in found if one.name.endswith('surfaces') and one.level == b'\x01']

    bench.until(surfaces, 'diagnostics')
    assert 'racket is taken as at rest where it was' in surfaces()[-1].message


def test_messages_that_cannot_be_used_are_said(
    simulated: Callable[..., Any], tmp_path: Path, log: Callable[[], str]
) -> None:
    stroke = Stroke(
        simulated, tmp_path, 'pose: racket/pose, twist: racket/twist, plan: racket/plan'
    )
    seen = ''

    def said(text: str) -> bool:
        nonlocal seen
        seen += log()
        return text in seen

    bad = pose(0.0)
    bad.pose.orientation.w += 1.0
    lost, turned = twist(np.nan), plan()
    turned.joint_names = ['left']
    turned.points = turned.points[:1]
    for topic, message, text in (
        (
            'racket/pose',
            stamped(pose(0.0), T0, 'lab'),
            "pose of racket rejected: its frame is 'lab', expected 'world'",
        ),
        ('racket/twist', stamped(lost, T0), 'twist of racket rejected: a velocity is not finite'),
        ('racket/plan', stamped(turned, T0), 'plan of racket rejected: it has 1 points'),
    ):  # fmt: skip
        stroke.send(topic, message)
        stroke.setup.bench.until(lambda text=text: said(text), text)
    assert not stroke.track.known
    bodies = stroke.setup.node.simulation._bodies
    stroke.send('racket/pose', stamped(bad, T0))  # said by the count, as the line before is new
    stroke.setup.bench.until(lambda: bodies._rejected['racket'] == 4, 'the quaternion')
    assert not stroke.track.known


def test_a_surface_that_is_not_there_ends_the_node(bench: Any, tmp_path: Path) -> None:
    with pytest.raises(UserError, match='racket has surface 9, but the scene has 5'):
        bench.add(SimulatorNode, moving_surfaces='racket: {surfaces: [9], pose: racket/pose}')
    with pytest.raises(UserError, match='none of pose, frame and plan is given'):
        bench.add(SimulatorNode, moving_surfaces='racket: {surfaces: [1]}')


def test_the_start_that_does_not_follow_is_said(
    simulated: Callable[..., Any], tmp_path: Path, log: Callable[[], str]
) -> None:
    Stroke(simulated, tmp_path, 'pose: racket/pose', start='first')
    assert 'predictions keep their motion at the first frames; set start:=every' in log()
