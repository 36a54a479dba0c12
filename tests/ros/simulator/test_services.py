# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Services and parameters of the simulator node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rigid_gns_ros.node.simulator import SimulatorNode
from std_srvs.srv import SetBool, Trigger

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Callable[..., np.ndarray]
Simulated = Callable[..., Any]


def test_reset_takes_another_start(simulated: Simulated, falling: Falling) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(1)
    assert setup.bench.call(Trigger, '/simulator/reset').success
    later = setup.node.get_clock().now().nanoseconds
    setup.start(falling(0.0, count=4), later)
    setup.clock.set(later + DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == later + DT and len(frame.poses) == 4


def test_pause_and_step(simulated: Simulated, falling: Falling, expected: Rollout) -> None:
    setup, start = simulated(), falling(0.0)
    step = '/simulator/step'
    refused = setup.bench.call(Trigger, step)
    assert not refused.success and 'not paused' in refused.message
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).message == 'paused'
    refused = setup.bench.call(Trigger, step)
    assert not refused.success and 'not started' in refused.message
    setup.start(start)
    for index in range(1, 4):
        answer = setup.bench.call(Trigger, step)
        assert answer.success and answer.message.startswith(f'published prediction {index} ')
        assert setup.tracked.wait(index)[-1].stamp_ns == T0 + index * DT
    for index in range(1, 21):  # however long the pause, time goes on where it stood
        setup.clock.set(T0 + 5 * index * DT)
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).message == 'running'
    assert len(setup.tracked.predicted) == 3
    setup.clock.set(T0 + 101 * DT)
    frames = setup.tracked.wait(4)
    assert frames[3].stamp_ns == T0 + 4 * DT
    np.testing.assert_allclose([f.poses for f in frames], expected(start, 4)[1:], atol=1e-6)
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).message == 'no change'


def test_a_failed_step_returns_the_reason(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = simulated()
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    setup.start(falling(0.0))
    predictor = setup.node.simulation.predictor
    predictor.take()

    def fail(stamp_ns: int) -> None:
        raise FloatingPointError('rollout diverged')

    monkeypatch.setattr(predictor.forecast, 'advance_to', fail)
    answer = setup.bench.call(Trigger, '/simulator/step')
    assert not answer.success and 'failed: rollout diverged' in answer.message


def test_parameters_at_run_time(simulated: Simulated, falling: Falling, expected: Rollout) -> None:
    setup = simulated()

    def change(name: str, **value: Any) -> Any:
        parameter = Parameter(name=name, value=ParameterValue(**value))
        return setup.bench.call(
            SetParameters, '/simulator/set_parameters', parameters=[parameter]
        ).results[0]

    def text(value: str) -> dict[str, Any]:
        return {'type': ParameterType.PARAMETER_STRING, 'string_value': value}

    assert change('start', **text('every')).successful
    refused = change('start', **text('sometimes'))
    assert not refused.successful and 'allowed: first, every, diverged' in refused.reason
    rate = {'type': ParameterType.PARAMETER_DOUBLE, 'double_value': 5.0}
    assert not change('rate', **rate).successful
    setup.start(falling(0.0))
    setup.clock.set(T0 + DT)
    setup.tracked.wait(1)
    second = falling(0.0, velocity=0.0, count=3) + [0, 0, 7, 0, 0, 0, 0]
    setup.frame(second, T0 + DT)
    setup.clock.set(T0 + 2 * DT)
    frame = setup.tracked.wait(2)[1]
    np.testing.assert_allclose(frame.poses, expected(second, 1)[1], atol=1e-6)


def test_parameters_describe_themselves(simulated: Simulated) -> None:
    setup = simulated()
    names = ['rate', 'start', 'max_spheres']
    rate, start, most = setup.bench.call(
        DescribeParameters, '/simulator/describe_parameters', names=names
    ).descriptors
    assert rate.read_only and rate.floating_point_range[0].to_value == 1000.0
    assert '[Hz]' in rate.description
    assert not start.read_only and start.additional_constraints == 'one of: first, every, diverged'
    assert most.integer_range[0].from_value == 1


@pytest.mark.parametrize(
    ('parameters', 'message'),
    [
        ({'model': 'nonesuch'}, "no model 'nonesuch'"),
        ({'scene': 'nonesuch'}, "'nonesuch'"),
        ({'rate': -1.0}, 'parameter rate.*allowed: 0 to 1000 Hz'),
        ({'rate': 0.01}, 'rate is 0.01, allowed: 0, or 0.1 to 1000 Hz'),
        ({'rate': 10}, 'parameter rate has the wrong type.*float, as 10.0'),
        ({'velocity_window': 0}, 'parameter velocity_window.*allowed: 1 to 100'),
        ({'start': 'later'}, "start is 'later', allowed: first, every, diverged"),
        ({'max_spheres': 0}, 'parameter max_spheres'),
        ({'record_max_size': 1e-7}, 'record_max_size is 1e-07, allowed: 0, or 0.001 to'),
        ({'record_max_duration': 1e-9}, 'record_max_duration is 1e-09, allowed: 0, or 0.1 to'),
    ],
)
def test_bad_parameters_are_named(bench: Any, parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        # a name of its own: DDS may take nodes of the test before for alive that were just ending
        bench.add(SimulatorNode, ('predicted_poses:=refused',), **parameters)
    publishers = bench.tester.get_publishers_info_by_topic
    bench.until(lambda: not publishers('/refused'), 'the end of all publishers')
