# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Predictions of the simulator node: what they are, and when."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')


from rigid_gns_core.scenes.state import rotate_quaternions, rotation_between
from rigid_gns_ros.node.simulator import SimulatorNode

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Callable[..., np.ndarray]
Simulated = Callable[..., Any]


def test_predictions_are_the_rollout_with_exact_stamps(
    simulated: Simulated, falling: Falling, expected: Rollout
) -> None:
    setup, start = simulated(), falling(0.0)
    setup.start(start)
    frames = setup.run(5)
    assert [frame.stamp_ns for frame in frames] == [T0 + k * DT for k in range(1, 6)]
    assert {frame.frame_id for frame in frames} == {'world'}
    # the same model on the same start: bit for bit but for the order of additions
    np.testing.assert_allclose([f.poses for f in frames], expected(start, 5)[1:], atol=1e-6)


def test_a_prediction_is_computed_ahead_and_held_until_its_time(
    simulated: Simulated, falling: Falling
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.clock.set(T0 + DT - 1_000_000)
    for _ in range(20):
        setup.bench.executor.spin_once(timeout_sec=0.01)
    assert not setup.tracked.predicted
    setup.clock.set(T0 + DT)
    setup.tracked.wait(1)


def test_velocities_come_from_the_window(
    simulated: Simulated, falling: Falling, expected: Rollout
) -> None:
    setup = simulated(velocity_window=4)
    for index in range(3):
        setup.tracked.send(falling(0.05 * index, velocity=2.0), T0 - (3 - index) * 50_000_000)
    last = falling(0.15, velocity=2.0)
    setup.start(last)
    velocities = np.tile([2.0, 0.0, -9.81 * 0.15], (3, 1))
    # the fit is exact to rounding of positions of 100 m; float32 networks amplify nothing here
    np.testing.assert_allclose(setup.run(1)[0].poses, expected(last, 1, velocities)[1], atol=1e-5)


def test_another_rate_interpolates_and_is_logged(
    simulated: Simulated, falling: Falling, log: Callable[[], str], expected: Rollout
) -> None:
    setup, start = simulated(rate=25.0), falling(0.0)
    assert '25 Hz, interpolated between model steps' in log()
    setup.start(start)
    for index in range(1, 6):
        setup.clock.set(T0 + index * 40_000_000)
        setup.tracked.wait(index)
    frames = setup.tracked.predicted
    assert [frame.stamp_ns - T0 for frame in frames] == [k * 40_000_000 for k in range(1, 6)]
    states = expected(start, 2)
    for frame, (step, weight) in zip(
        frames, [(0, 0.4), (0, 0.8), (1, 0.2), (1, 0.6), (1, 1.0)], strict=True
    ):
        before, after = states[step], states[step + 1]
        place = (1 - weight) * before[:, :3] + weight * after[:, :3]
        turn = weight * rotation_between(before[:, 3:], after[:, 3:])
        np.testing.assert_allclose(frame.poses[:, :3], place, atol=1e-6)
        np.testing.assert_allclose(
            frame.poses[:, 3:], rotate_quaternions(before[:, 3:], turn), atol=1e-6
        )


def test_small_spheres_have_a_faster_native_rate(
    simulated: Simulated, falling: Falling, tmp_path: Path, log: Callable[[], str]
) -> None:
    scene = tmp_path / 'table.yaml'
    scene.write_text('scene: {radius: 0.02, restitution: 0.7746, rolling_friction: 0.03}\n')
    setup = simulated(scene=str(scene))
    period = 0.1 * np.sqrt(0.02)  # [s], dynamic similarity
    assert f'native rate {1 / period:.6g} Hz' in log()
    setup.start(falling(0.0) * [0.02, 0.02, 0.02, 1, 1, 1, 1])
    for index in range(1, 8):
        setup.clock.set(T0 + round(index * period * 1e9))
        setup.tracked.wait(index)
    stamps = [frame.stamp_ns - T0 for frame in setup.tracked.predicted]
    assert stamps == [round(index * period * 1e9) for index in range(1, 8)]


def test_what_is_late_is_published_but_never_in_a_burst(
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.clock.set(T0 + 8 * DT + DT // 2)
    # 1 is published late, 2 to 7 would follow it at once, 8 is half a period late
    stamps = [frame.stamp_ns for frame in setup.tracked.wait(2)]
    assert stamps == [T0 + DT, T0 + 8 * DT]
    setup.tracked.wait_computed(9)
    setup.clock.set(T0 + 9 * DT)
    assert setup.tracked.wait(3)[2].stamp_ns == T0 + 9 * DT
    text = log()
    assert text.count('late, more than the period') == 1  # throttled
    assert 'cannot keep up' not in text
    setup.node.close()
    assert '3 published, 1 late, 6 skipped' in log()


def test_real_time(bench: Any, falling: Falling) -> None:
    bench.add(SimulatorNode, velocity_window=1)
    tracked, start = bench.tracked(), bench.now()
    tracked.send(falling(0.0), start)
    frames = tracked.wait(3)
    counts = [(frame.stamp_ns - start) / DT for frame in frames]
    assert counts == sorted(set(counts)) and all(count == int(count) for count in counts)
    assert all(frame.stamp_ns <= bench.now() for frame in frames)


@pytest.mark.parametrize('stamp', [0, 50_000_000_000])
def test_a_tracker_on_another_clock_is_followed_with_a_warning(
    simulated: Simulated, falling: Falling, log: Callable[[], str], stamp: int
) -> None:
    setup = simulated()
    setup.start(falling(0.0), stamp)
    setup.clock.set(T0 + DT)
    assert setup.tracked.wait(1)[0].stamp_ns == stamp + DT
    assert "off the node's clock" in log()


def test_without_a_clock_nothing_starts(
    bench: Any, falling: Falling, log: Callable[[], str]
) -> None:
    bench.add(SimulatorNode, use_sim_time=True, velocity_window=1)
    tracked = bench.tracked()
    tracked.send(falling(0.0), T0)
    bench.until(lambda: 'no /clock has come yet' in log(), 'the rejection')


def test_a_clock_that_goes_back_starts_again(
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(2)
    earlier = T0 - 10**11
    setup.clock.set(earlier)
    assert 'the clock went backwards' in log()
    setup.start(falling(0.0, count=4), earlier)
    setup.clock.set(earlier + DT)
    frame = setup.tracked.wait(3)[2]
    assert frame.stamp_ns == earlier + DT and len(frame.poses) == 4


@pytest.mark.parametrize('days', [400, -400])
def test_a_system_clock_that_is_set_starts_again(
    bench: Any,
    falling: Falling,
    log: Callable[[], str],
    monkeypatch: pytest.MonkeyPatch,
    days: int,
) -> None:
    """Only simulated clocks tell of jumps; this one parts from the clock that nobody sets."""
    node = bench.add(SimulatorNode, velocity_window=1)
    tracked, simulation = bench.tracked(), node.simulation
    tracked.send(falling(0.0), bench.now())
    tracked.wait_computed(1)
    apart, real = days * 86_400 * 10**9, time.monotonic_ns
    monkeypatch.setattr(time, 'monotonic_ns', lambda: real() - apart)
    now = bench.now()
    tracked.send(falling(0.0, count=4), now)
    bench.until(lambda: simulation.window.stamp_ns == now, 'the frame')
    way = f'forward by {86_400.0 * days:.0f}' if days > 0 else 'backwards'
    assert log().count(f'the clock went {way}') == 1
    assert simulation.predictor.last_start.reason == 'restart'
    tracked.wait(1)
    assert simulation.predictor.counts['skipped'] == 0


def test_a_clock_that_jumps_ahead_starts_again(
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated()
    setup.start(falling(0.0))
    setup.run(1)
    later = T0 + 100 * DT
    setup.clock.set(later)
    assert log().count('the clock went forward by 9.900 s') == 1
    setup.start(falling(0.0, count=4), later)
    setup.clock.set(later + DT)
    frame = setup.tracked.wait(2)[1]
    assert frame.stamp_ns == later + DT and len(frame.poses) == 4
