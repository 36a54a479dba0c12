# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator node with `start: every`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.messages.poses import PoseArrayCodec
from std_srvs.srv import SetBool, Trigger

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Callable[..., np.ndarray]
Simulated = Callable[..., Any]


def test_every_starts_again_from_each_frame(
    simulated: Simulated, falling: Falling, expected: Rollout
) -> None:
    setup = simulated(start='every')
    starts = [falling(0.0), falling(1.0, velocity=3.0), falling(2.0, velocity=-4.0)]
    for index, poses in enumerate(starts):
        setup.frame(poses, T0 + index * DT)
        setup.clock.set(T0 + (index + 1) * DT)
        frame = setup.tracked.wait(index + 1)[index]
        assert frame.stamp_ns == T0 + (index + 1) * DT
        np.testing.assert_allclose(frame.poses, expected(poses, 1)[1], atol=1e-6)


@pytest.mark.parametrize('hertz', [4, 14, 33, 200])
def test_every_holds_the_rate_whatever_the_trackers(simulated: Simulated, hertz: int) -> None:
    setup = simulated(start='every', rate=10.0)
    frames = [round(k * 1e9 / hertz) for k in range(hertz + hertz // 2)]
    stamps = setup.follow(frames, DT)
    assert len(stamps) >= 13
    assert stamps == [T0 + k * DT for k in range(1, len(stamps) + 1)]
    # computed half a period before it is due, from the newest frame: one to two model steps each
    assert len(setup.tracked.step_bytes) <= (2 if hertz > 10 else 4) * (len(stamps) + 1)


def test_every_samples_the_newest_forecast_at_its_stamps(
    simulated: Simulated, expected: Rollout
) -> None:
    setup = simulated(start='every')
    setup.follow([0, 130_000_000], DT)
    poses, states = setup.tracked.predicted[1].poses, expected(setup.bench.falling(0.13), 1)
    place = 0.3 * states[0, :, :3] + 0.7 * states[1, :, :3]
    np.testing.assert_allclose(poses[:, :3], place, atol=1e-6)


def test_every_follows_the_clock_of_the_tracker(simulated: Simulated) -> None:
    setup = simulated(start='every')
    # 2 ms a frame slower than the node's clock: each stamp is one period after its frame
    frames = [k * 102_000_000 for k in range(6)]
    stamps = setup.follow(frames, DT)
    assert stamps[:5] == [T0 + frame + DT for frame in frames[:5]]


def test_every_recovers_from_overload(
    simulated: Simulated, falling: Falling, log: Callable[[], str], expected: Rollout
) -> None:
    setup = simulated(start='every')
    setup.start(falling(0.0))
    waiting = [PoseArrayCodec('world', 3).encode(falling(0.9), T0 + 9 * DT)]
    setup.node.simulation.topics.drain = lambda: [
        setup.node.simulation.on_tracked(waiting.pop()) for _ in waiting
    ]
    setup.clock.set(T0 + 9 * DT + DT // 2)  # as if computing had taken so long
    assert setup.tracked.wait(1)[0].stamp_ns == T0 + DT
    setup.clock.set(T0 + 10 * DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == T0 + 10 * DT
    np.testing.assert_allclose(frame.poses, expected(falling(0.9), 1)[1], atol=1e-6)
    assert 'a prediction is 0.850 s late' in log()
    setup.node.close()
    assert '2 published, 1 late, 8 skipped' in log()


def test_every_without_new_frames_goes_on_period_by_period(
    simulated: Simulated, falling: Falling, expected: Rollout
) -> None:
    setup, start = simulated(start='every'), falling(0.0)
    setup.start(start)
    setup.clock.set(T0 + 9 * DT + DT // 2)
    # 1 is late, 2 to 8 would follow it at once, 9 is half a period late
    frames = setup.tracked.wait(2)
    assert [frame.stamp_ns for frame in frames] == [T0 + DT, T0 + 9 * DT]
    np.testing.assert_allclose(frames[1].poses, expected(start, 9)[9], atol=1e-6)


def test_every_resumes_from_new_frames(
    simulated: Simulated, falling: Falling, expected: Rollout
) -> None:
    setup = simulated(start='every')
    setup.start(falling(0.0))
    setup.run(1)
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    for index in range(2, 30):
        setup.clock.set(T0 + index * DT)
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).success
    setup.start(falling(2.9), T0 + 29 * DT)
    setup.clock.set(T0 + 30 * DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == T0 + 30 * DT
    np.testing.assert_allclose(frame.poses, expected(falling(2.9), 1)[1], atol=1e-6)


def test_steps_of_every_start_from_the_newest_frame(
    simulated: Simulated, falling: Falling, expected: Rollout, log: Callable[[], str]
) -> None:
    setup = simulated(start='every')
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    setup.start(falling(0.0))
    assert setup.bench.call(Trigger, '/simulator/step').success
    setup.clock.set(T0 + 8 * DT)
    setup.frame(falling(0.8), T0 + 8 * DT)
    assert setup.bench.call(Trigger, '/simulator/step').success
    frames = setup.tracked.wait(2)
    assert [frame.stamp_ns for frame in frames] == [T0 + DT, T0 + 9 * DT]
    np.testing.assert_allclose(frames[1].poses, expected(falling(0.8), 1)[1], atol=1e-6)
    for index in range(2, 12):  # what is passed over by hand is not left out for want of time
        setup.clock.set(T0 + 8 * index * DT)
        setup.frame(falling(0.8), T0 + 8 * index * DT)
        assert setup.bench.call(Trigger, '/simulator/step').success
    assert setup.node.simulation.predictor.counts['skipped'] == 0
    assert 'cannot keep up' not in log()
