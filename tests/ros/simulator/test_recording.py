# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ~/scene of the simulator node, and its recording."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from geometry_msgs.msg import PoseArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.poses import decode_pose_array
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_ros.node.simulator import SimulatorNode
from std_msgs.msg import String

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Callable[..., np.ndarray]
Simulated = Callable[..., Any]


def test_the_scene_is_latched(simulated: Simulated) -> None:
    setup, heard = simulated(), []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    setup.bench.tester.create_subscription(String, '/simulator/scene', heard.append, latched)
    setup.bench.until(lambda: heard, 'the scene')
    content = json.loads(heard[0].data)
    assert content['scene'] == load_scene('box_154').to_mapping()
    assert content['model'] == 'laws' and content['dt'] == content['period'] == 0.1
    assert content['model_card']['kind'] == 'laws' and content['model_card']['version']
    assert content['parameters']['velocity_window'] == 1
    assert content['topics'] == {
        'tracked': '/tracked_poses',
        'predicted': '/predicted_poses',
        'trajectory': '/predicted_trajectory',
        'deviations': '/predicted_deviations',
        'branches': '/simulator/branches',
        'crossings': '/simulator/crossings',
        'start': '/simulator/start',
        'learned': '/simulator/learned',
        'step_time': '/simulator/step_time',
        'diagnostics': '/diagnostics',
    }


def test_the_bag_holds_the_bytes(bench: Any, falling: Falling, tmp_path: Path) -> None:
    folder = tmp_path / 'bag'
    node = bench.add(
        SimulatorNode,
        remap=('__ns:=/lab', 'predicted_poses:=forecast'),
        velocity_window=1,
        record=str(folder),
        use_sim_time=True,
    )
    clock = bench.clock(node)
    received: list[bytes] = []
    bench.tester.create_subscription(PoseArray, '/lab/forecast', received.append, 10, raw=True)
    tracked = bench.tracked('/lab')
    bench.until(lambda: bench.tester.count_subscribers('/lab/forecast'), 'discovery')
    clock.set(T0)
    sent = [tracked.send(falling(0.0), T0)]
    tracked.wait_computed(1)
    tracked.send(falling(0.0), T0 + 1, 'map')
    for index in range(1, 4):
        clock.set(T0 + index * DT)
        sent.append(tracked.send(falling(0.1 * index), T0 + index * DT))
        bench.until(lambda expected=index: len(received) == expected, 'a prediction')
    tracked.wait_computed(4)
    node.close()
    bag = read_bag(folder)
    assert set(bag.topics) >= {
        '/lab/tracked_poses',
        '/lab/forecast',
        '/lab/simulator/scene',
        '/lab/simulator/start',
        '/lab/simulator/step_time',
        '/diagnostics',
    }
    assert [bytes(cdr) for cdr in bag.topics['/lab/forecast'].messages] == received
    assert [bytes(cdr) for cdr in bag.topics['/lab/tracked_poses'].messages] == sent
    steps = [bytes(cdr) for cdr in bag.topics['/lab/simulator/step_time'].messages]
    assert steps == tracked.step_bytes
    stamps = [decode_pose_array(cdr).stamp_ns for cdr in received]
    assert list(bag.topics['/lab/forecast'].times) == stamps  # the clock stood at each stamp
    assert (folder / 'metadata.yaml').is_file()


def test_a_bag_begins_with_the_clock(
    simulated: Simulated, falling: Falling, tmp_path: Path
) -> None:
    """What is said before a simulated clock runs has the time of what comes first."""
    folder = tmp_path / 'bag'
    setup = simulated(record=str(folder))
    setup.start(falling(0.0))
    setup.node.close()
    bag = read_bag(folder)
    assert len(bag.topics['/simulator/scene'].messages) == 1
    assert {time for topic in bag.topics.values() for time in topic.times} == {T0}


def test_a_bag_without_a_clock_has_the_scene(bench: Any, tmp_path: Path) -> None:
    folder = tmp_path / 'bag'
    node = bench.add(SimulatorNode, use_sim_time=True, record=str(folder))
    node.simulation.report()
    node.simulation.report()
    node.close()
    bag = read_bag(folder)
    assert len(bag.topics['/simulator/scene'].messages) == 1
    assert len(bag.topics['/diagnostics'].messages) == 1  # the last one stands for all


def test_a_bag_is_never_overwritten(bench: Any, tmp_path: Path) -> None:
    with pytest.raises(FileExistsError, match='parameter record is .*never overwritten'):
        bench.add(SimulatorNode, record=str(tmp_path))


def test_a_failed_bag_is_logged_at_the_end(
    simulated: Simulated, tmp_path: Path, log: Callable[[], str]
) -> None:
    setup = simulated(record=str(tmp_path / 'bag'))
    setup.node.simulation.topics.bag._error = 'no space left'  # as the recording thread sets it
    setup.node.close()
    assert 'INCOMPLETE: no space left' in log()


def test_a_prediction_that_a_shutdown_kept_from_going_out_does_not_count(
    simulated: Simulated,
    falling: Falling,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    log: Callable[[], str],
) -> None:
    setup = simulated(record=str(tmp_path / 'bag'))
    setup.start(falling(0.0))
    setup.run(2)

    def publish(_: bytes) -> None:
        raise RuntimeError('context is invalid')  # as a signal within the callback makes it

    monkeypatch.setattr(setup.node.simulation.topics.predicted, 'publish', publish)
    with pytest.raises(RuntimeError, match='context is invalid'):
        setup.run(3)
    setup.node.close()
    assert 'stopped: 2 published' in log()
    assert len(read_bag(tmp_path / 'bag').topics['/predicted_poses']) == 2


def test_the_bag_is_split_and_holds_the_overridden_qos(
    simulated: Simulated, falling: Falling, tmp_path: Path
) -> None:
    folder = tmp_path / 'bag'
    name = 'qos_overrides./predicted_trajectory.publisher.reliability'
    setup = simulated(record=str(folder), record_max_size=0.002, **{name: 'best_effort'})
    setup.start(falling(0.0))
    setup.node.close()
    assert len(list(folder.glob('*.mcap'))) > 1
    content = yaml.safe_load((folder / 'metadata.yaml').read_text(encoding='utf-8'))
    topics = {
        entry['topic_metadata']['name']: entry['topic_metadata']['offered_qos_profiles'][0]
        for entry in content['rosbag2_bagfile_information']['topics_with_message_count']
    }
    assert topics['/predicted_trajectory']['reliability'] == 'best_effort'
    assert topics['/predicted_poses']['reliability'] == 'reliable'
    assert topics['/simulator/start']['durability'] == 'transient_local'
    assert '/predicted_markers' not in topics


def test_the_bag_is_finished_before_a_future_that_takes_long(
    simulated: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Draws of a spread cannot be cancelled, and a launch file kills after some seconds."""
    simulation = simulated(record=str(tmp_path / 'bag'), horizon=1.0).node.simulation
    there: list[bool] = []
    finish = simulation.futures.close

    def close() -> None:
        there.append((tmp_path / 'bag' / 'metadata.yaml').exists())
        finish()

    monkeypatch.setattr(simulation.futures, 'close', close)
    simulation.close()
    assert there == [True]
