# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`use_sim_time` changes while the simulator predicts: it begins anew by the other clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rclpy.parameter import Parameter
from rigid_gns_ros.node.simulator import SimulatorNode

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py


def switch(node: Any, *, simulated: bool) -> None:
    (result,) = node.set_parameters([Parameter('use_sim_time', value=simulated)])
    assert result.successful


def test_from_simulated_time_to_the_system_clock(
    simulated: Callable[..., Any], falling: Callable[..., Any], log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(2)
    switch(setup.node, simulated=False)
    setup.bench.until(lambda: 'the clock went forward by' in log(), 'the jump')
    assert setup.node.simulation.predictor.forecast is None
    begun = setup.bench.now()
    setup.tracked.send(falling(0.2), begun)
    setup.tracked.wait(3)
    assert [one.stamp_ns for one in setup.tracked.predicted][2:3] == [begun + DT]


def test_from_the_system_clock_to_a_simulation_that_begins(
    bench: Any, falling: Callable[..., Any]
) -> None:
    node = bench.add(SimulatorNode, velocity_window=1)
    tracked = bench.tracked()
    tracked.send(falling(0.0), bench.now())
    tracked.wait(1)
    switch(node, simulated=True)
    clock = bench.clock(node)
    clock.set(5 * DT)  # no jump from 0, where simulated time begins
    before = len(tracked.step_bytes)
    tracked.send(falling(0.1), 5 * DT)
    tracked.wait_computed(before + 1)
    assert node.simulation.predictor.last_start.stamp_ns == 5 * DT
    told = len(tracked.predicted_bytes)
    clock.set(6 * DT)
    assert tracked.wait(told + 1)[-1].stamp_ns == 6 * DT
