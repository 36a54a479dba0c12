# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""When a forecast restarts, what ~/start says of it, and that this reproduces it."""

from __future__ import annotations

from collections.abc import Callable
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import Bag, read_bag
from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.window_setup import window_of
from rigid_gns_core.messages.poses import decode_pose_array, decode_string, PoseArrayCodec
from rigid_gns_core.scenes.scene_file import load_scene
from std_srvs.srv import SetBool, Trigger

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Simulated = Callable[..., Any]


@pytest.fixture
def recorded(simulated: Simulated, tmp_path: Path) -> Callable[..., tuple[Any, Any]]:
    """Return a recording simulator, and a function that closes it and reads its bag."""

    def make(**parameters: Any) -> tuple[Any, Callable[[], Bag]]:
        setup = simulated(record=str(tmp_path / 'bag'), **parameters)

        def close() -> Bag:
            setup.node.close()
            return read_bag(tmp_path / 'bag')

        return setup, close

    return make


def starts(bag: Bag) -> list[dict[str, Any]]:
    topic = bag.topics['/simulator/start']
    return [json.loads(decode_string(message)) for message in topic.messages]


def off(poses: np.ndarray, distance: float, sphere: int = 1) -> np.ndarray:
    """Poses with one sphere moved along y [m]."""
    poses = poses.copy()
    poses[sphere, 1] += distance
    return poses


@pytest.mark.parametrize(
    ('parameters', 'distance', 'again'),
    [
        ({}, 0.49, False),
        ({}, 0.51, True),
        ({'resync_error': 2.0}, 1.9, False),
        ({'resync_error': 2.0}, 2.1, True),
        ({'resync_over': 'mean'}, 1.4, False),
        ({'resync_over': 'mean'}, 1.6, True),
    ],
)
def test_diverged_restarts_beyond_the_bound(
    recorded: Callable[..., tuple[Any, Any]],
    falling: Falling,
    expected: Rollout,
    parameters: dict[str, Any],
    distance: float,
    again: bool,
) -> None:
    setup, close = recorded(start='diverged', **parameters)
    first = falling(0.0)
    setup.start(first)
    setup.run(1)
    # what is predicted for the second frame falls like it, from rest: 0.049 m against 0 m
    moved = off(expected(first, 1)[1], distance)
    setup.frame(moved, T0 + DT)
    error = setup.node.simulation.predictor.last_error
    assert (error is None) == again
    if error is not None:
        assert error.worst == pytest.approx(distance) and error.mean == pytest.approx(distance / 3)
    frame = setup.run(2)[1]
    assert frame.stamp_ns == T0 + 2 * DT  # the stamps go on
    model = expected(moved, 1)[1] if again else expected(first, 2)[2]
    np.testing.assert_allclose(frame.poses, model, atol=1e-6)
    assert [start['reason'] for start in starts(close())] == ['first', 'diverged'][: 1 + again]


def test_first_reports_the_error_and_runs_on(
    recorded: Callable[..., tuple[Any, Any]], falling: Falling, expected: Rollout
) -> None:
    setup, close = recorded(start='first')
    setup.start(falling(0.0))
    setup.run(1)
    setup.frame(off(expected(falling(0.0), 1)[1], 3.0), T0 + DT)
    assert setup.node.simulation.predictor.last_error.worst == pytest.approx(3.0)
    setup.run(2)
    assert [start['reason'] for start in starts(close())] == ['first']


def test_first_fits_frames_only_on_demand(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fit takes milliseconds, in which a prediction would have to wait."""
    setup = simulated(start='first')
    setup.start(falling(0.0))
    setup.run(1)
    window, fitted = setup.node.simulation.window, []
    start = window.start

    def counted(surfaces):
        fitted.append(window.stamp_ns)
        return start(surfaces)

    monkeypatch.setattr(window, 'start', counted)
    setup.node.simulation.on_tracked(PoseArrayCodec('world', 3).encode(falling(0.1), T0 + DT))
    assert window.stamp_ns == T0 + DT and not fitted
    assert setup.node.simulation.predictor.last_error.worst == pytest.approx(0.1)
    assert fitted == [T0 + DT]


def test_diverged_catches_up_with_a_tracker_that_is_ahead(
    simulated: Simulated, falling: Falling, expected: Rollout
) -> None:
    """Where computing fell behind, no prediction reaches the newest frame: diverged too."""
    setup = simulated(start='diverged')
    setup.start(falling(0.0))
    late = falling(0.9)
    setup.frame(late, T0 + 9 * DT)  # before the clock that the node sees reaches it
    setup.clock.set(T0 + 10 * DT)
    setup.bench.until(
        lambda: any(f.stamp_ns == T0 + 10 * DT for f in setup.tracked.predicted), 'the present'
    )
    frame = setup.tracked.predicted[-1]
    np.testing.assert_allclose(frame.poses, expected(late, 1)[1], atol=1e-6)


def test_diverged_does_not_restart_while_paused(simulated: Simulated, falling: Falling) -> None:
    setup = simulated(start='diverged')
    setup.start(falling(0.0))
    setup.run(1)
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    for index in range(2, 6):
        setup.clock.set(T0 + index * DT)
        setup.frame(off(falling(0.1 * index), 5.0), T0 + index * DT)
    assert setup.node.simulation.predictor.last_start.reason == 'first'
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).success
    setup.frame(falling(0.6), T0 + 6 * DT)
    setup.bench.until(
        lambda: setup.node.simulation.predictor.last_start.reason == 'restart', 'the start'
    )


def test_each_start_has_its_reason(
    recorded: Callable[..., tuple[Any, Any]], falling: Falling
) -> None:
    setup, close = recorded(velocity_window=2)
    setup.tracked.send(falling(0.0), T0 - DT)
    setup.start(falling(0.1))
    assert setup.bench.call(Trigger, '/simulator/reset').success
    setup.tracked.send(falling(0.2), T0 + DT)
    setup.start(falling(0.3), T0 + 2 * DT)
    for index in range(5):  # the tracker restarts
        setup.tracked.send(falling(0.1 * index), T0 - 10**11 + index * DT)
    setup.bench.until(
        lambda: setup.node.simulation.predictor.last_start.reason == 'restart', 'the restart'
    )
    found = starts(close())
    assert [start['reason'] for start in found] == ['first', 'reset', 'restart']
    assert [start['window_ns'][-1] - start['stamp_ns'] for start in found] == [0, 0, 0]
    assert found[0]['window_ns'] == [T0 - DT, T0]
    assert found[1]['window_ns'] == [T0 + DT, T0 + 2 * DT]
    assert {tuple(start['ids']) for start in found} == {(0, 1, 2)}


@pytest.mark.parametrize('start', ['first', 'every', 'diverged'])
def test_recorded_frames_and_starts_give_the_predictions_bit_by_bit(
    recorded: Callable[..., tuple[Any, Any]], start: str
) -> None:
    setup, close = recorded(start=start, velocity_window=3, rate=12.0)
    rng = np.random.default_rng(5)
    frames = [round(k * 1e9 / 31) for k in range(24)]
    poses = [setup.bench.falling(stamp * 1e-9) for stamp in frames]
    for index, stamp in enumerate(frames):
        noise = rng.normal(0.0, 1e-3, (3, 3))
        jump = 1.0 if index >= 16 else 0.0
        poses[index][:, :3] += noise + [0.0, jump, 0.0]
        setup.clock.set(T0 + stamp)
        setup.frame(poses[index], T0 + stamp)
    setup.bench.until(lambda: len(setup.tracked.predicted) >= 4, 'predictions')
    setup.node.simulation.forget('reset')
    bag = close()
    tracked = {
        frame.stamp_ns: frame
        for frame in map(decode_pose_array, bag.topics['/tracked_poses'].messages)
    }
    model = Forecaster('', load_scene('box_154'), rate=12.0)
    parameters = json.loads(decode_string(bag.topics['/simulator/scene'].messages[0]))[
        'parameters'
    ]
    found = starts(bag)
    again: set[bytes] = set()
    stamps = sorted(
        decode_pose_array(message).stamp_ns for message in bag.topics['/predicted_poses'].messages
    )
    for one in found:
        told = {**parameters, 'tracking_noise': one['noise']}
        window = window_of(model, told, check=lambda _: None, on_gap=lambda _: None)
        for stamp in one['window_ns']:
            window.add(tracked[stamp], stamp)
        forecast = model.forecast(window.start()[1], one['stamp_ns'])
        for stamp in stamps:
            if stamp > one['stamp_ns']:
                prediction = forecast.advance_to(stamp)
                again.add(PoseArrayCodec('world', 3).encode(prediction.poses, stamp))
    assert {bytes(message) for message in bag.topics['/predicted_poses'].messages} <= again
    reasons = {'first': {'first'}, 'every': {'first', 'every'}, 'diverged': {'first', 'diverged'}}
    assert {one['reason'] for one in found} == reasons[start]


# --- spheres that appear and vanish ---


def test_another_set_of_spheres_restarts(
    recorded: Callable[..., tuple[Any, Any]], falling: Falling
) -> None:
    setup, close = recorded(match_spheres=True, velocity_window=3)
    for index in range(-2, 1):
        setup.frame(falling(0.1 * index), T0 + index * DT)
    setup.tracked.wait_computed(1)
    for index in range(1, 5):  # a fourth sphere, and another order
        setup.clock.set(T0 + index * DT)
        setup.frame(falling(0.1 * index, count=4)[::-1] + [1.0, 0, 0, 0, 0, 0, 0], T0 + index * DT)
    simulation = setup.node.simulation
    setup.bench.until(lambda: simulation.predictor.last_start.reason == 'spheres', 'the new set')
    setup.clock.set(T0 + 5 * DT)
    setup.bench.until(
        lambda: setup.tracked.predicted and setup.tracked.predicted[-1].stamp_ns == T0 + 5 * DT,
        'a prediction',
    )
    frame = setup.tracked.predicted[-1]
    last = starts(close())[-1]
    assert last['reason'] == 'spheres' and len(last['ids']) == len(frame.poses)
    stamps = [frame.stamp_ns for frame in setup.tracked.predicted]
    assert stamps == [T0 + index * DT for index in range(1, 6)]  # which go on


def test_predictions_end_where_all_spheres_are_gone(
    simulated: Simulated, falling: Falling
) -> None:
    setup = simulated(match_spheres=True, velocity_window=3, coast_time=0.05)
    for index in range(-2, 1):
        setup.frame(falling(0.1 * index), T0 + index * DT)
    setup.tracked.wait_computed(1)
    simulation = setup.node.simulation
    for index in range(1, 6):
        if simulation.window.count is None:
            break
        setup.frame(falling(0.0)[:0], T0 + index * DT // 2)
    assert simulation.window.count is None and simulation.predictor.forecast is None
