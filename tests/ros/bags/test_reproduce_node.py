# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the real node predicted, computed again from its bag."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from recorded_bags import evaluate_bag

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.topics import find_topics
from rigid_gns_core.recordings.scoring.reproduce import reproduce
from rigid_gns_ros.node.simulator import SimulatorNode
from std_srvs.srv import Trigger

T0 = 1_000_123_456_789  # [ns]
DT = 100_000_000  # [ns]
FRAMES = 14


def tracked_poses(number: int) -> np.ndarray:
    """Five spheres that fall and bounce, with the noise of a tracker, shape (5, 7)."""
    poses = np.zeros((5, 7))
    height = 3.0 + np.arange(5.0)
    fall = 4.905 * (0.1 * number) ** 2
    poses[:, 0] = 4.0 * np.arange(5)
    poses[:, 2], poses[:, 6] = 1.0 + np.abs(height - fall), 1.0
    poses[:, :3] += np.random.default_rng(number).normal(scale=1e-3, size=(5, 3))
    return poses


@pytest.mark.parametrize('start', ['first', 'every', 'diverged'])
@pytest.mark.parametrize('matched', [False, True])
def test_a_recording_of_the_node_is_reproduced(
    bench: Any, tmp_path: Any, start: str, matched: bool
) -> None:
    folder = tmp_path / 'bag'
    node = bench.add(
        SimulatorNode,
        use_sim_time=True,
        start=start,
        velocity_window=3,
        match_spheres=matched,
        record=str(folder),
        record_max_duration=0.5,
        horizon=0.3,
        rate=20.0,  # interpolated
    )
    clock = bench.clock(node)
    tracked = bench.tracked()
    rng = np.random.default_rng(0)
    for number in range(FRAMES):
        stamp = T0 + number * DT
        poses = tracked_poses(number)
        if matched:  # in any order, and one is missing now and then
            poses = poses[rng.permutation(5)[: 4 if number in (5, 11) else 5]]
        clock.set(stamp)
        tracked.send(poses, stamp)
        bench.until(lambda stamp=stamp: node.simulation.window.stamp_ns == stamp, 'the frame')
        if number == 7:
            assert bench.call(Trigger, '/simulator/reset').success
    node.close()
    bag = read_bag(folder)
    assert not bag.warnings
    assert len(list(folder.glob('bag_*.mcap'))) >= 3
    assert len(bag.topics['/simulator/scene']) == 1
    result = reproduce(bag, find_topics(bag))
    assert result.predictions > 4
    assert result.starts > (3 if start == 'every' else 1)
    assert (result.same, result.different, result.unknown) == (result.predictions, 0, 0), result
    # spheres are 4 m apart: one taken for another would show
    report = evaluate_bag(folder)
    assert report['errors']['position_error'] < 1.0
    assert report['errors']['chamfer'] == pytest.approx(2 * report['errors']['mse'], rel=0.1)
    assert report['future_errors']['0.3']['starts'] >= 1


@pytest.mark.parametrize('back', [-7200, 7200])
@pytest.mark.parametrize('matched', [False, True])
def test_predictions_after_a_restart_of_the_tracker_are_reproduced(
    bench: Any, tmp_path: Any, log: Any, back: int, matched: bool
) -> None:
    """The frames refused until that was clear are in the bag: the next start is from them."""
    folder = tmp_path / 'bag'
    node = bench.add(
        SimulatorNode,
        use_sim_time=True,
        velocity_window=4,
        match_spheres=matched,
        record=str(folder),
    )
    clock = bench.clock(node)
    tracked = bench.tracked()
    counts = node.simulation.window.counts

    def heard() -> int:
        return counts['accepted'] + counts['late'] + counts['ahead']

    sent = []
    for number in range(16):
        clock.set(T0 + number * DT)
        stamp = T0 + number * DT + (back * 10**9 if number >= 7 else 0)
        sent.append(tracked.send(tracked_poses(number), stamp))
        bench.until(lambda count=number + 1: heard() == count, 'the frame')
    assert 'the tracker has restarted' in log()
    node.close()
    bag = read_bag(folder)
    assert bag.topics['/tracked_poses'].messages == sent
    times = bag.topics['/tracked_poses'].times
    assert times.tolist() == [T0 + number * DT for number in range(16)]
    result = reproduce(bag, find_topics(bag))
    assert result.starts >= 2
    assert (result.same, result.different, result.unknown) == (result.predictions, 0, 0), result
