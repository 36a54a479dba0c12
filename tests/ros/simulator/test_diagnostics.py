# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""/diagnostics of the simulator node."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.messages.diagnostics import ERROR, OK, Status, WARN
from rigid_gns_ros.node.recent import Recent
from std_srvs.srv import SetBool

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Simulated = Callable[..., Any]


def report(setup: Any) -> dict[str, Status]:
    """Return what the node would publish now, by the last word of the name."""
    simulation = setup.node.simulation
    statuses = simulation.diagnostics.report(
        paused=simulation.paused,
        horizon=simulation.futures.seconds,
        heard=simulation.futures.heard,
        bag=simulation.topics.bag,
        size=simulation.topics.recorded_bytes,
    )
    return {status.name.removeprefix('simulator: '): status for status in statuses}


def test_they_come_by_themselves_with_values(simulated: Simulated, falling: Falling) -> None:
    setup = simulated(horizon=0.2)
    heard: list[DiagnosticArray] = []
    setup.bench.tester.create_subscription(DiagnosticArray, '/diagnostics', heard.append, 10)
    setup.start(falling(0.0))
    count = len(setup.run(2))
    heard.clear()
    setup.bench.until(lambda: len(heard) >= 2, 'two reports')  # simulated time stands still
    (stamp, statuses) = heard[-1].header.stamp, heard[-1].status
    assert stamp.sec * 10**9 + stamp.nanosec == setup.node.get_clock().now().nanoseconds
    assert [status.name for status in statuses] == [
        'simulator: tracking',
        'simulator: prediction',
        'simulator: recording',
        'simulator: horizon',
    ]
    assert {status.hardware_id for status in statuses} == {'none'}
    values = {item.key: item.value for item in statuses[1].values}
    assert values['model'] == 'laws' and values['published'] == str(count)
    assert float(values['period [s]']) == 0.1
    assert values['last start: reason'] == 'first' and values['starts'] == '1'
    for name in ('lateness p50 [ms]', 'lateness p99 [ms]', 'lateness worst [ms]'):
        assert float(values[name]) == 0.0  # the clock stood at each stamp
    worst, p99, p50 = (float(values[f'step time {name} [ms]']) for name in ('worst', 'p99', 'p50'))
    assert worst >= p99 >= p50 > 0
    assert statuses[2].level == DiagnosticStatus.OK


def test_levels_of_tracking(simulated: Simulated, falling: Falling) -> None:
    setup = simulated()
    setup.tracked.send(falling(0.0), T0, 'map')
    setup.bench.until(lambda: setup.node.simulation.diagnostics.rejected, 'the rejection')
    tracking = report(setup)['tracking']
    assert tracking.level == ERROR and 'were rejected' in tracking.message
    assert "expected 'world'" in tracking.values['last rejection']
    assert report(setup)['prediction'].level == WARN  # nothing to start from
    setup.start(falling(0.0))
    tracking = report(setup)['tracking']
    assert tracking.level == WARN and '1 tracked messages rejected' in tracking.message
    assert (tracking.values['accepted'], tracking.values['rejected']) == ('1', '1')


def test_levels_of_prediction(simulated: Simulated, falling: Falling, expected: Rollout) -> None:
    setup = simulated(resync_error=1.0)
    setup.start(falling(0.0))
    setup.run(1)
    assert report(setup)['prediction'].level == OK
    moved = expected(falling(0.0), 1)[1] + [0, 1.5, 0, 0, 0, 0, 0]
    setup.frame(moved, T0 + DT)
    prediction = report(setup)['prediction']
    assert prediction.level == WARN and 'resync_error' in prediction.message
    assert float(prediction.values['error worst [m]']) == pytest.approx(1.5, rel=1e-3)
    assert float(prediction.values['error worst [radii]']) == pytest.approx(1.5, rel=1e-3)
    setup.clock.set(T0 + 8 * DT + DT // 2)
    setup.tracked.wait_computed(9)
    prediction = report(setup)['prediction']
    assert prediction.level == WARN and 'were late by a period' in prediction.message
    assert prediction.values['late'] == '1' and prediction.values['skipped'] == '5'
    assert float(prediction.values['lateness worst [ms]']) == pytest.approx(650.0)
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    assert report(setup)['prediction'].message == 'paused'


def test_when_all_is_late_it_is_an_error(simulated: Simulated, falling: Falling) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    diagnostics = setup.node.simulation.diagnostics
    for _ in range(4):
        diagnostics.due(0.11)
    assert report(setup)['prediction'].level == WARN  # of so few one cannot say
    diagnostics.due(0.11)
    prediction = report(setup)['prediction']
    assert prediction.level == ERROR and 'all predictions' in prediction.message
    diagnostics.due(0.0)
    assert report(setup)['prediction'].level == WARN


def test_half_a_period_is_late_enough_for_a_warning(
    simulated: Simulated, falling: Falling
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.node.simulation.diagnostics.due(0.04)
    assert report(setup)['prediction'].level == OK
    setup.node.simulation.diagnostics.due(0.09)
    prediction = report(setup)['prediction']
    assert prediction.level == WARN and 'late by half a period' in prediction.message


def test_levels_of_recording(simulated: Simulated, falling: Falling, tmp_path: Path) -> None:
    setup = simulated(record=str(tmp_path / 'bag'))
    setup.start(falling(0.0))
    recording = report(setup)['recording']
    assert recording.level == OK and int(recording.values['bytes']) > 1000
    setup.node.simulation.report()
    bag = setup.node.simulation.topics.bag
    bag._lost = 3  # as where the disk is too slow
    assert report(setup)['recording'].level == WARN
    bag._error = 'no space left'  # as the recording thread sets it
    recording = report(setup)['recording']
    assert recording.level == ERROR and recording.values['lost'] == '3'
    bag._error = None
    setup.node.close()
    topic = read_bag(tmp_path / 'bag').topics['/diagnostics']
    message = deserialize_message(bytes(topic.messages[0]), DiagnosticArray)
    assert [status.name.split(': ')[1] for status in message.status] == [
        'tracking',
        'prediction',
        'recording',
    ]


def test_levels_of_the_horizon(simulated: Simulated, falling: Falling) -> None:
    setup = simulated(horizon=0.1)
    setup.start(falling(0.0))
    assert report(setup)['horizon'].level == OK
    setup.node.simulation.diagnostics.future_superseded()
    horizon = report(setup)['horizon']
    assert horizon.level == WARN and '1 frames of the last 10 s got no future' in horizon.message
    setup.node.simulation.diagnostics.future_computed(0.1, 'not finite')
    assert 'ends early: not finite' in report(setup)['horizon'].message


def test_statistics_are_of_the_last_seconds() -> None:
    now = [100.0]
    recent = Recent(lambda: now[0])
    assert len(recent) == 0 and recent.rate == 0.0 and str(recent.quantiles(0.5)) == '[nan]'
    for value in range(20):
        now[0] += 1.0
        recent.add(float(value))
    assert len(recent) == 11 and recent.quantiles(0.0, 1.0) == [9.0, 19.0]
    assert recent.rate == pytest.approx(1.1)
    now[0] += 30.0
    assert len(recent) == 0 and recent.since_last == 30.0
