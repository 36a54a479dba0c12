# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node learns air and contact laws from its own tracks, over DDS, and its bag reproduces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from launched_balls import GIVEN, launched, TRUE
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.data.tracks import Track
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.trajectories import decode_trajectory, FutureFrame
from rigid_gns_core.recordings.scoring.reproduce import reproduce
from rigid_gns_core.relearning import background
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_ros.node.simulator import SimulatorNode
from std_srvs.srv import Trigger
from trajectory_msgs.msg import MultiDOFJointTrajectory
import yaml

T0 = 1_000_123_456_789  # [ns], as in conftest.py
FRAMES, EVERY = 42, 2  # frames of a throw: 90 Hz, 0.46 s
APART = 2_000_000_000  # from throw to throw [ns]
SEEN, AHEAD = 0.2, 0.2  # forecasts of frames from there on are judged so long ahead [s]


class Throws:
    """Throws of a launcher, one after the other, and how far off what the node says of them is."""

    def __init__(self, setup: Any, tracks: list[Track]) -> None:
        self.setup, self.tracks, self.done = setup, tracks, 0
        self.heard: list[bytes] = []
        topic = setup.node.simulation.topics.trajectory
        setup.bench.tester.create_subscription(
            MultiDOFJointTrajectory, topic.topic_name, self.heard.append, QoSProfile(depth=100),
            raw=True,
        )  # fmt: skip
        setup.bench.until(topic.get_subscription_count, topic.topic_name)

    def throw(self) -> float:
        """Send the next throw; the median error of its forecasts [m]."""
        track, begin = self.tracks[self.done], T0 + self.done * APART
        times = track.times[: FRAMES * EVERY : EVERY]
        places = track.positions[: FRAMES * EVERY : EVERY, 0]
        self.done += 1
        errors = []
        for time, place in zip(times, places, strict=True):
            stamp = begin + round(time * 1e9)
            self.setup.clock.set(stamp)
            self.setup.frame(np.array([[*place, 0.0, 0.0, 0.0, 1.0]]), stamp)
            if SEEN <= time <= times[-1] - AHEAD:
                future = self.future_of(stamp)
                at = time + np.array(future.times_ns) * 1e-9
                there = [np.interp(time + AHEAD, at, future.poses[:, 0, c]) for c in range(3)]
                truth = [np.interp(time + AHEAD, times, places[:, c]) for c in range(3)]
                errors.append(np.linalg.norm(np.subtract(there, truth)))
        return float(np.median(errors))

    def future_of(self, stamp_ns: int) -> FutureFrame:
        def found() -> list[FutureFrame]:
            futures = [decode_trajectory(cdr) for cdr in self.heard[-3:]]
            return [one for one in futures if one.stamp_ns == stamp_ns]

        self.setup.bench.until(found, 'the future of a frame')
        return found()[0]


def scene_file(folder: Path) -> str:
    path = folder / 'given.yaml'
    path.write_text(yaml.safe_dump({'scene': GIVEN.to_mapping()}), encoding='utf-8')
    return str(path)


def test_the_node_learns_from_its_throws_and_the_bag_reproduces(
    simulated: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    log: Callable[[], str],
) -> None:
    """A ball in air with spin, in a scene without air and with another restitution."""
    monkeypatch.setattr(background, 'NICE', 0)  # a busy machine would never come to it
    setup = simulated(
        scene=scene_file(tmp_path), start='every', velocity_window=6, horizon=0.25, learn=True,
        learned_scene=str(tmp_path / 'learned.yaml'), record=str(tmp_path / 'bag'),
    )  # fmt: skip
    learning, bench = setup.node.simulation.learning, setup.bench
    said: list[Any] = []
    bench.tester.create_subscription(DiagnosticArray, '/diagnostics', said.append, 10)
    early = bench.call(Trigger, '/simulator/save_scene')
    assert not early.success and 'nothing better than the given scene' in early.message
    throws = Throws(setup, launched(20, seed=5))
    before = [throws.throw() for _ in range(11)]
    assert learning._background.busy
    bench.until(lambda: learning._background._answer is not None, 'the first fit')
    after = [throws.throw() for _ in range(9)]
    text = log()
    assert 'a learned scene is taken: median error of the newest 3 tracks from ' in text
    assert learning.newest is not None and learning.newest.tracks == 7
    # air and bounces are most of the error, and the noise of 0.7 mm is not
    assert np.median(after) < 0.4 * np.median(before), (before, after)
    told = learning.newest.parameters['air.drag_coefficient']
    assert abs(told['value'] - TRUE['air.drag_coefficient']) < 4 * told['error']

    def learned() -> list[Any]:
        found = [status for array in said for status in array.status]
        return [one for one in found if one.name.endswith('learning')]

    bench.until(lambda: learned() and 'better: ' in str(learned()[-1].values), 'diagnostics')
    values = {one.key: one.value for one in learned()[-1].values}
    assert values['scenes taken'] == '1' and 'air.drag_coefficient' in values['scene']
    saved = bench.call(Trigger, '/simulator/save_scene')
    assert saved.success, saved.message
    assert load_scene(str(tmp_path / 'learned.yaml')) == learning.newest.scene
    setup.node.close()
    bag = read_bag(tmp_path / 'bag')
    assert not bag.warnings
    (event,) = bag.topics['/simulator/learned'].messages
    assert json.loads(event[8:-1])['scene']['air'] is not None
    reasons = [json.loads(m[8:-1])['reason'] for m in bag.topics['/simulator/start'].messages]
    assert reasons.count('learned') == 1
    result = reproduce(bag, find_topics(bag))
    assert result.predictions > 100
    assert (result.same, result.different, result.unknown) == (result.predictions, 0, 0), result


def test_what_cannot_be_learned_is_said(bench: Any, tmp_path: Path) -> None:
    lift = replace(GIVEN, surfaces=Plane(velocity=(0.0, 0.0, 1.0)))
    path = tmp_path / 'lift.yaml'
    path.write_text(yaml.safe_dump({'scene': lift.to_mapping()}), encoding='utf-8')
    with pytest.raises(UserError, match='learn is set, but a surface of the scene moves'):
        bench.add(SimulatorNode, scene=str(path), learn=True)
    bench.add(SimulatorNode, scene=scene_file(tmp_path))
    refused = bench.call(Trigger, '/simulator/save_scene')
    assert not refused.success and refused.message == 'the parameter learn is not set'
