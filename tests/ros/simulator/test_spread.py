# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How sure a future is, and crossings of planes, over DDS."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PoseWithCovarianceStamped, TwistWithCovarianceStamped
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import QoSProfile
from rigid_gns_core.messages.trajectories import decode_trajectory
from std_msgs.msg import String
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import Marker, MarkerArray
import yaml

T0 = 1_000_123_456_789  # [ns], as in conftest.py
FRAME = round(1e9 / 240)  # of the tracker [ns]
NOISE = 1e-3  # [m]
WALL = 'wall: {point: [0.9, 0, 0], normal: [-1, 0, 0]}'
Simulated = Callable[..., Any]

SCENE = {
    'surfaces': [
        {
            'point': [0.0, 0.0, 0.0],
            'normal': [0.0, 0.0, 1.0],
            'direction': [1.0, 0.0, 0.0],
            'length_x': 2.0,
            'length_y': 2.0,
        }
    ],
    'radius': 0.02,
    'friction': 0.0,
    'restitution': 0.9487,  # of a ball and a table: 0.9
}


class Heard:
    """What is heard of the spread from now on."""

    def __init__(self, setup: Any) -> None:
        topics, tester = setup.node.simulation.topics, setup.bench.tester
        self.crossing: list[Any] = []
        self.velocity: list[Any] = []
        self.crossings: list[Any] = []
        self.branches: list[Any] = []
        self.deviations: list[bytes] = []
        self.trajectory: list[bytes] = []
        self.markers: list[Any] = []
        for kind, publisher, heard, raw in (
            (PoseWithCovarianceStamped, topics.crossing, self.crossing, False),
            (TwistWithCovarianceStamped, topics.crossing_velocity, self.velocity, False),
            (String, topics.crossings, self.crossings, False),
            (String, topics.branches, self.branches, False),
            (MultiDOFJointTrajectory, topics.deviations, self.deviations, True),
            (MultiDOFJointTrajectory, topics.trajectory, self.trajectory, True),
            (MarkerArray, topics.markers, self.markers, False),
        ):
            tester.create_subscription(
                kind, publisher.topic_name, heard.append, QoSProfile(depth=50), raw=raw
            )
            setup.bench.until(publisher.get_subscription_count, publisher.topic_name)


def written(folder: Path) -> str:
    path = folder / 'scene.yaml'
    path.write_text(yaml.safe_dump({'scene': SCENE}), encoding='utf-8')
    return str(path)


def throw(setup: Any, start: list[float], velocity: list[float], frames: int = 24) -> None:
    """Frames of a ball in flight without air, seen at 240 Hz with noise."""
    rng = np.random.default_rng(1)
    for frame in range(frames):
        time = frame * FRAME * 1e-9
        place = np.array(start) + time * np.array(velocity) - [0.0, 0.0, 0.5 * 9.81 * time**2]
        place += rng.normal(0.0, NOISE, 3)
        setup.clock.set(T0 + frame * FRAME)
        setup.frame(np.array([[*place, 0.0, 0.0, 0.0, 1.0]]), T0 + frame * FRAME)


def test_a_thrown_ball_crosses_a_plane_when_and_where_it_is_told(
    simulated: Simulated, tmp_path: Path
) -> None:
    """A ball meets x = 0.9 m at 0.5 s: after a bounce, 0.4 s after the last frame."""
    setup = simulated(
        scene=written(tmp_path),
        horizon=0.8,
        samples=64,
        crossing_planes=WALL,
        velocity_window=24,
        tracking_noise=NOISE,
    )
    heard = Heard(setup)
    throw(setup, [-0.6, 0.1, 0.25], [3.0, -0.2, 0.5])
    last = T0 + 23 * FRAME
    setup.bench.until(
        lambda: any(json.loads(m.data)['stamp_ns'] == last for m in heard.crossings), 'the last'
    )
    told = json.loads(heard.crossings[-1].data)
    (own,) = told['planes']['wall']
    assert own['sphere'] == 0 and own['probability'] == 1.0
    crossing = T0 + 500_000_000
    # velocities of a window of 24 frames of 1 mm have 7 mm/s of noise: 3 mm, a millisecond
    assert abs(own['stamp_ns'] - crossing) < 4e6
    assert abs(own['stamp_ns'] - crossing) < 5e9 * own['time_deviation'] < 20e6
    assert own['position'][0] == pytest.approx(0.9, abs=1e-6)
    assert own['position'][1] == pytest.approx(0.0, abs=0.015)
    assert 1e-3 < own['position_deviation'][1] < 0.01
    assert own['velocity'] == pytest.approx([3.0, -0.2, own['velocity'][2]], abs=0.05)
    assert own['branches'][0]['touched'] == ['surface 0']
    setup.bench.until(lambda: heard.crossing and heard.velocity, 'the messages')
    pose, twist = heard.crossing[-1], heard.velocity[-1]
    for message in (pose, twist):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert stamp == own['stamp_ns'] and message.header.frame_id == 'world'
    assert pose.pose.pose.position.y == own['position'][1]
    assert np.sqrt(pose.pose.covariance[7]) == pytest.approx(own['position_deviation'][1])
    assert twist.twist.twist.linear.z == own['velocity'][2]
    values = setup.node.simulation.diagnostics.report(
        paused=False, horizon=0.8, heard=True, bag=None, size=0
    )
    assert 'sphere 0 crosses wall in 0.4' in values[-1].values['crossings']


def test_deviations_belong_to_the_points_of_the_future(
    simulated: Simulated, tmp_path: Path
) -> None:
    """They grow with time, and those of x are those of the start: sqrt(P + 2 t C + t^2 V)."""
    setup = simulated(
        scene=written(tmp_path), horizon=0.5, samples=200, velocity_window=12,
        tracking_noise=NOISE,
    )  # fmt: skip
    heard = Heard(setup)
    throw(setup, [-0.6, 0.1, 0.4], [3.0, -0.2, 0.5], 12)
    setup.bench.until(lambda: heard.deviations and heard.trajectory, 'the future')
    found, future = (
        decode_trajectory(heard.deviations[-1]),
        decode_trajectory(heard.trajectory[-1]),
    )
    assert found.stamp_ns == future.stamp_ns and found.times_ns == future.times_ns
    assert found.names == future.names == ('sphere_0',)
    stamp, estimate = setup.node.simulation.window.estimate()
    assert stamp == found.stamp_ns
    p, c, v = (estimate.covariance[0, a, b] for a, b in ((0, 0), (0, 3), (3, 3)))
    times = np.array(found.times_ns) * 1e-9
    truth = np.sqrt(p + 2 * times * c + times**2 * v)
    # 200 samples: 5 % of a deviation
    np.testing.assert_allclose(found.poses[:, 0, 0], truth, rtol=0.2)
    np.testing.assert_array_equal(found.poses[:, 0, 3:], np.tile([0, 0, 0, 1], (len(times), 1)))
    assert (np.abs(found.twists[..., 3:]) <= 1.0 + 1e-9).all()
    np.testing.assert_allclose(found.twists[0, 0, :3], np.sqrt(v), rtol=0.2)

    def ellipsoids() -> list[Any]:
        return [m for array in heard.markers for m in array.markers if m.ns == 'spread']

    setup.bench.until(ellipsoids, 'ellipsoids')
    assert {m.type for m in ellipsoids()} == {Marker.SPHERE}
    sizes = [max(m.scale.x, m.scale.y, m.scale.z) for m in ellipsoids()]
    assert sizes[-1] > sizes[0] > 0


def test_a_ball_that_may_miss_the_table_has_branches(simulated: Simulated, tmp_path: Path) -> None:
    """It comes down on the end at x = 1 m; with two frames, velocities have 0.3 m/s of noise."""
    setup = simulated(
        scene=written(tmp_path), horizon=0.5, samples=64, velocity_window=3, tracking_noise=5e-3,
    )  # fmt: skip
    heard = Heard(setup)
    fall = np.sqrt(2 * 0.28 / 9.81)
    throw(setup, [1.0 - 2.0 * fall, 0.0, 0.3], [2.0, 0.0, 0.0], 3)
    setup.bench.until(lambda: heard.branches, 'branches')
    (own,) = json.loads(heard.branches[-1].data)['spheres']
    shares = {tuple(one['touched']): one['probability'] for one in own['branches']}
    assert sum(shares.values()) > 0.9
    assert shares[()] > 0.1 and shares['surface 0',] > 0.1
    setup.bench.until(
        lambda: any(m.ns == 'branch' for array in heard.markers for m in array.markers), 'paths'
    )


def test_planes_and_samples_change_while_the_node_runs(
    simulated: Simulated, tmp_path: Path, log: Callable[[], str]
) -> None:
    setup = simulated(scene=written(tmp_path), crossing_planes=WALL, velocity_window=3)
    assert 'crossing_planes are given, but horizon is 0' in log()

    def change(name: str, **value: Any) -> Any:
        parameters = [Parameter(name=name, value=ParameterValue(**value))]
        return setup.bench.call(
            SetParameters, '/simulator/set_parameters', parameters=parameters
        ).results[0]

    text = ParameterType.PARAMETER_STRING
    refused = change('crossing_planes', type=text, string_value='racket: 3')
    assert not refused.successful and 'crossing_planes.racket is 3' in refused.reason
    other = 'net: {point: [0, 0, 0], normal: [-1, 0, 0]}'
    assert change('crossing_planes', type=text, string_value=other).successful
    assert change('horizon', type=ParameterType.PARAMETER_DOUBLE, double_value=0.5).successful
    heard = Heard(setup)
    throw(setup, [-0.6, 0.1, 0.25], [3.0, -0.2, 0.5], 4)
    setup.bench.until(lambda: heard.crossings, 'crossings')
    # without samples it is that of the state alone, and there are no deviations
    (own,) = json.loads(heard.crossings[-1].data)['planes']['net']
    assert own['probability'] == 1.0 and own['time_deviation'] == 0.0
    assert not heard.deviations and not heard.branches


def test_samples_that_would_not_fit_into_memory_are_refused(
    simulated: Simulated, falling: Callable[..., Any], log: Callable[[], str]
) -> None:
    setup = simulated(horizon=60.0, samples=10_000, velocity_window=1)
    heard = Heard(setup)
    setup.start(falling(0.0))
    setup.bench.until(lambda: 'lower samples or horizon' in log(), 'the warning')
    # 10 001 states of 3 spheres, 104 bytes each, at 601 times
    assert '10000 samples of 600 steps of 3 spheres would take 1.88 GB' in log()
    assert not heard.deviations
