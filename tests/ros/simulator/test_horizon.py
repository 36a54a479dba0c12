# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories on predicted_trajectory, and their markers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
import threading
import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import QoSProfile
from rigid_gns_core.forecasts import horizon
from rigid_gns_core.forecasts.forecaster import Forecaster
from rigid_gns_core.forecasts.horizon import compute, Future, Horizon, Job
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_core.messages.trajectories import decode_trajectory, FutureFrame
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.rollout.rollout import steps_of
from rigid_gns_core.rollout.stepper import Stepper
from rigid_gns_core.scenes.scene_file import load_scene
from rigid_gns_core.scenes.state import State
from std_srvs.srv import SetBool
from trajectory_msgs.msg import MultiDOFJointTrajectory
from visualization_msgs.msg import Marker, MarkerArray
import yaml

T0, DT = 1_000_123_456_789, 100_000_000  # [ns], as in conftest.py
Falling = Rollout = Simulated = Callable[..., Any]


def futures(setup: Any) -> list[bytes]:
    """What is heard on predicted_trajectory from now on."""
    heard: list[bytes] = []
    setup.bench.tester.create_subscription(
        MultiDOFJointTrajectory,
        '/predicted_trajectory',
        heard.append,
        QoSProfile(depth=10),
        raw=True,
    )
    publisher = setup.node.simulation.topics.trajectory
    setup.bench.until(publisher.get_subscription_count, 'discovery')
    return heard


def heard_future(setup: Any, heard: list[bytes], count: int) -> FutureFrame:
    setup.bench.until(lambda: len(heard) >= count, f'{count} futures')
    return decode_trajectory(heard[count - 1])


def test_every_tracked_frame_gives_its_whole_future_at_once(
    simulated: Simulated, falling: Falling
) -> None:
    setup = simulated(horizon=2.05, velocity_window=2)
    heard = futures(setup)
    setup.tracked.send(falling(-0.1), T0 - DT)
    for index in range(2):  # the clock stands still: nothing is due
        setup.frame(falling(0.1 * index), T0 + index * DT)
        found = heard_future(setup, heard, index + 1)
        assert found.stamp_ns == T0 + index * DT and found.frame_id == 'world'
        assert found.names == ('sphere_0', 'sphere_1', 'sphere_2')
        assert found.times_ns == tuple(k * DT for k in range(22))  # 2.05 s is reached by 21 steps
        start = found.twists[0]
        expected = load_simulator().rollout(
            load_scene('box_154'),
            found.poses[0, :, :3],
            start[:, :3],
            start[:, 3:],
            steps=21,
            quaternions=found.poses[0, :, 3:],
        )
        # a future begins with its start, which with scene and model gives it bit by bit
        np.testing.assert_array_equal(found.poses[:, :, :3], expected.positions)
        np.testing.assert_array_equal(found.poses[:, :, 3:], expected.quaternions)
        np.testing.assert_array_equal(found.twists[:, :, :3], expected.velocities)
        np.testing.assert_array_equal(found.twists[:, :, 3:], expected.angular_velocities)
        np.testing.assert_allclose(found.poses[0], falling(0.1 * index), atol=1e-9)
    assert not setup.tracked.predicted


def test_the_horizon_is_dynamic_and_stops_with_a_pause(
    simulated: Simulated, falling: Falling
) -> None:
    setup = simulated()
    heard = futures(setup)

    def change(seconds: float) -> Any:
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=seconds)
        parameters = [Parameter(name='horizon', value=value)]
        name = '/simulator/set_parameters'
        return setup.bench.call(SetParameters, name, parameters=parameters).results[0]

    setup.frame(falling(0.0), T0)
    assert not change(-1.0).successful and not change(61.0).successful
    assert change(0.3).successful
    setup.frame(falling(0.01), T0 + DT // 10)
    assert len(heard_future(setup, heard, 1).times_ns) == 4
    assert setup.bench.call(SetBool, '/simulator/pause', data=True).success
    setup.frame(falling(0.02), T0 + DT // 5)
    assert setup.bench.call(SetBool, '/simulator/pause', data=False).success
    assert change(0.1).successful
    setup.frame(falling(0.03), T0 + 3 * DT // 10)
    found = heard_future(setup, heard, 2)
    assert found.stamp_ns == T0 + 3 * DT // 10 and len(found.times_ns) == 2
    assert change(0.0).successful
    setup.frame(falling(0.04), T0 + 4 * DT // 10)
    setup.clock.set(T0 + DT)
    setup.tracked.wait(1)
    assert len(heard) == 2


def test_markers_show_tracked_predicted_and_future(simulated: Simulated, falling: Falling) -> None:
    setup = simulated(horizon=0.5)
    drawn: list[MarkerArray] = []
    setup.bench.tester.create_subscription(MarkerArray, '/predicted_markers', drawn.append, 100)
    publisher = setup.node.simulation.topics.markers
    setup.bench.until(publisher.get_subscription_count, 'discovery')
    setup.start(falling(0.0))
    setup.run(1)

    def of(namespace: str) -> list[Marker]:
        return [m for array in drawn for m in array.markers if m.ns == namespace]

    for namespace in ('tracked', 'predicted', 'path'):
        setup.bench.until(lambda namespace=namespace: of(namespace), namespace)
    (tracked,), (predicted,) = of('tracked'), of('predicted')
    assert tracked.type == predicted.type == Marker.SPHERE_LIST
    assert tracked.scale.x == 2.0 and len(tracked.points) == len(predicted.points) == 3
    assert [m.id for m in of('path')] == [0, 1, 2]
    assert {len(m.points) for m in of('path')} == {6}
    assert {m.lifetime.sec for array in drawn for m in array.markers} == {1}


def test_markers_of_a_sphere_that_the_scene_does_not_know(
    simulated: Simulated, tmp_path: Path, log: Callable[[], str]
) -> None:
    """A sphere that was lost comes back under another id: to look at it must not end the node."""
    scene = tmp_path / 'two.yaml'
    ground = {'point': [0.0, 0.0, 0.0], 'normal': [0.0, 0.0, 1.0]}
    content = {'surfaces': [ground], 'radius': [1.0, 0.8]}
    scene.write_text(yaml.safe_dump({'scene': content}), encoding='utf-8')
    setup = simulated(scene=str(scene), match_spheres=True)
    drawn: list[MarkerArray] = []
    setup.bench.tester.create_subscription(MarkerArray, '/predicted_markers', drawn.append, 100)
    publisher = setup.node.simulation.topics.markers
    setup.bench.until(publisher.get_subscription_count, 'discovery')
    centres = np.array([[0.0, 0.0, 1.0], [5.0, 0.0, 0.8], [0.0, 9.0, 0.8]])
    poses = np.concatenate([centres, np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))], axis=1)
    for index in range(8):
        setup.clock.set(T0 + index * DT)
        setup.frame(poses[:2], T0 + index * DT)
    setup.tracked.send(poses[[0, 2]], T0 + 8 * DT)
    setup.bench.until(lambda: 'sphere 2 has no properties' in log(), 'the warning')
    setup.frame(poses[:2], T0 + 9 * DT)

    def largest() -> bool:
        return any(
            m.scale.x == 2.0 and len(m.points) == 2
            for array in drawn
            for m in array.markers
            if m.ns == 'tracked' and m.header.stamp.nanosec == (T0 + 8 * DT) % 10**9
        )

    setup.bench.until(largest, 'the unknown sphere, drawn as large as the largest')


def test_a_future_that_fails_does_not_end_the_predictions(
    simulated: Simulated, falling: Falling, log: Callable[[], str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def exhaust(*_: Any) -> None:
        raise MemoryError('no room')

    monkeypatch.setattr(horizon, 'compute', exhaust)
    setup = simulated(horizon=0.5)
    futures(setup)
    setup.start(falling(0.0))
    setup.bench.until(lambda: 'no future: MemoryError: no room' in log(), 'the warning')
    assert len(setup.run(2)) == 2


def test_nobody_hears_no_future_is_computed(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed: list[Any] = []
    compute = horizon.compute

    def counted(*arguments: Any) -> Any:
        computed.append(arguments)
        return compute(*arguments)

    monkeypatch.setattr(horizon, 'compute', counted)
    setup = simulated(horizon=0.2)
    setup.start(falling(0.0))
    status = setup.node.simulation.diagnostics.report(
        paused=False, horizon=0.2, heard=setup.node.simulation.futures.heard, bag=None, size=0
    )[-1]
    assert not computed and 'nobody hears' in status.message
    heard = futures(setup)
    setup.frame(falling(0.1), T0 + 100_000_000)
    assert heard_future(setup, heard, 1).stamp_ns == T0 + 100_000_000 and computed


def test_a_future_too_large_for_a_message_is_refused(
    simulated: Simulated, falling: Falling, log: Callable[[], str]
) -> None:
    setup = simulated(horizon=60.0, max_spheres=2000)
    heard = futures(setup)
    setup.start(falling(0.0, count=2000))  # 601 times 2000 times 104 bytes
    setup.bench.until(lambda: 'would be a message of 125 MB' in log(), 'the warning')
    assert 'lower horizon' in log() and not heard
    status = setup.node.simulation.diagnostics.report(
        paused=False, horizon=60.0, heard=True, bag=None, size=0
    )[-1]
    assert 'the bound is 100 MB' in status.message


def test_predictions_go_on_while_a_future_is_computed(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long it takes."""
    released, compute = threading.Event(), horizon.compute

    def held(*arguments: Any) -> Any:
        assert released.wait(60)
        return compute(*arguments)

    monkeypatch.setattr(horizon, 'compute', held)
    setup = simulated(horizon=0.2)
    heard = futures(setup)
    setup.start(falling(0.0))
    for index in range(1, 4):  # each frame replaces the one that waits
        setup.clock.set(T0 + index * DT)
        setup.tracked.wait(index)
        setup.frame(falling(0.1 * index), T0 + index * DT)
    assert not heard
    released.set()
    assert heard_future(setup, heard, 1).stamp_ns == T0
    assert heard_future(setup, heard, 2).stamp_ns == T0 + 3 * DT
    assert len(setup.node.simulation.diagnostics._superseded) == 2


def test_of_frames_that_wait_together_the_newest_gets_its_future(
    simulated: Simulated, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = simulated(horizon=0.2)
    heard = futures(setup)
    setup.start(falling(0.0))
    assert heard_future(setup, heard, 1).stamp_ns == T0
    simulation = setup.node.simulation
    waiting = [(encoded(falling, k), {}) for k in (1, 2, 3)]
    own = simulation.topics._inputs[0]
    monkeypatch.setattr(own, '_take', lambda: waiting.pop(0) if waiting else None)
    simulation.topics.drain()
    assert heard_future(setup, heard, 2).stamp_ns == T0 + 3 * DT
    assert len(simulation.diagnostics._superseded) == 2


def test_what_is_due_is_computed_before_futures(simulated: Simulated, falling: Falling) -> None:
    setup = simulated(horizon=0.2)
    heard = futures(setup)
    setup.start(falling(0.0))
    assert heard_future(setup, heard, 1).stamp_ns == T0
    simulation = setup.node.simulation
    with simulation.futures.held():
        for k in (1, 2):
            simulation.on_tracked(encoded(falling, k))
        assert not simulation.futures._horizon.busy
    assert heard_future(setup, heard, 2).stamp_ns == T0 + 2 * DT


def encoded(falling: Falling, number: int) -> bytes:
    return PoseArrayCodec('world', 3).encode(falling(0.1 * number), T0 + number * DT)


# --- without a node ---


@pytest.fixture(scope='module')
def model() -> Forecaster:
    return Forecaster('', load_scene('box_154'))


def job(model: Forecaster, poses: np.ndarray, stamp_ns: int, steps: int) -> Job:
    state = State(positions=poses[:, :3])
    return Job(model.forecast(state, 0).rollout, stamp_ns, steps, 'world', (0, 1, 2))


class Bench:
    """A horizon, and what it says of itself."""

    def __init__(self) -> None:
        self.ready = threading.Event()
        self.horizon = Horizon(self.ready.set)

    def next(self) -> Future | None:
        assert self.ready.wait(60)
        self.ready.clear()
        return self.horizon.take()


@pytest.fixture
def bench_of() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.horizon.close()


def test_a_future_in_blocks_is_the_rollout(model: Forecaster, falling: Falling) -> None:
    whole = job(model, falling(0.0), 7, 40).rollout.run(40).trajectory
    future = compute(job(model, falling(0.0), 7, 40), lambda: False)
    assert future is not None and not future.error and future.took > 0
    np.testing.assert_array_equal(future.positions, whole.positions)
    assert decode_trajectory(future.cdr).stamp_ns == 7


def test_only_the_newest_frame_waits(bench_of: Bench, model: Forecaster, falling: Falling) -> None:
    """A frame that comes while a future is computed waits; one that comes then replaces it."""
    horizon = bench_of.horizon
    assert not horizon.busy and horizon.take() is None
    assert horizon.request(lambda: job(model, falling(0.0), 0, 2)) and horizon.busy
    assert horizon.request(lambda: job(model, falling(0.1), 1, 2))
    assert not horizon.request(lambda: job(model, falling(0.2), 2, 2))  # in place of 1
    stamps = [future.job.stamp_ns for _ in range(2) if (future := bench_of.next())]
    assert stamps == [0, 2] and not horizon.busy


def test_what_is_dropped_is_never_begun(
    bench_of: Bench, model: Forecaster, falling: Falling
) -> None:
    begun: list[int] = []

    def make(stamp_ns: int) -> Job:
        begun.append(stamp_ns)
        return job(model, falling(0.0), stamp_ns, 2)

    horizon = bench_of.horizon
    for stamp_ns in range(3):
        horizon.request(lambda stamp_ns=stamp_ns: make(stamp_ns))
    assert begun == [0]
    assert bench_of.next() and begun == [0, 2] and bench_of.next()
    horizon.request(lambda: None)  # there is no future
    assert horizon.take() is None and not horizon.busy


def test_a_job_like_a_short_one_is_computed_at_once(
    bench_of: Bench, model: Forecaster, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    def request(job: Job, *, left: float = np.inf) -> None:
        bench_of.horizon.request(lambda: job, left=left)

    monkeypatch.setattr(horizon, 'SHARE', np.inf)  # of any time
    request(job(model, falling(0.0), 0, 3))  # who knows how long
    by_thread = bench_of.next()
    request(job(model, falling(0.0), 0, 3))
    at_once = bench_of.horizon.take()
    assert by_thread and at_once and at_once.cdr == by_thread.cdr
    assert not bench_of.horizon.busy and not bench_of.ready.is_set()
    request(job(model, falling(0.0), 1, 4))  # longer
    assert bench_of.next()
    request(job(model, falling(0.0), 2, 4), left=0.0)
    assert bench_of.next()
    broken = job(model, falling(0.0), 5, 4)
    broken.rollout.stepper = Broken(broken.rollout.stepper, RuntimeError('not thought of'))
    request(broken)
    with pytest.raises(RuntimeError, match='not thought of'):
        bench_of.horizon.take()
    monkeypatch.setattr(horizon, 'SHARE', 0.0)  # it leaves no time
    request(job(model, falling(0.0), 3, 4))
    assert bench_of.next()


def test_the_time_to_make_a_job_is_none_that_is_left(
    bench_of: Bench, model: Forecaster, falling: Falling, monkeypatch: pytest.MonkeyPatch
) -> None:
    def make(seconds: float) -> Job:
        time.sleep(seconds)  # it may take longer, but never less
        return job(model, falling(0.0), 0, 3)

    monkeypatch.setattr(horizon, 'SHARE', np.inf)  # of any time
    bench_of.horizon.request(lambda: make(0.0))
    assert bench_of.next()
    bench_of.horizon.request(lambda: make(0.05), left=0.05)
    assert bench_of.next()  # by its thread


def test_what_is_cancelled_never_comes(
    bench_of: Bench, model: Forecaster, falling: Falling
) -> None:
    horizon = bench_of.horizon
    horizon.request(lambda: job(model, falling(0.0), 0, 2000))
    horizon.request(lambda: job(model, falling(0.0), 1, 2))
    horizon.cancel()
    assert not horizon.busy and bench_of.next() is None
    assert compute(job(model, falling(0.0), 0, 2), lambda: True) is None
    horizon.request(lambda: job(model, falling(0.0), 2, 2))  # what comes next is not cancelled
    future = bench_of.next()
    assert future and future.job.stamp_ns == 2


def test_a_future_that_diverges_ends_early(model: Forecaster, falling: Falling) -> None:
    broken = job(model, falling(0.0), 5, 10)
    broken.rollout.stepper = Broken(broken.rollout.stepper, FloatingPointError('not finite'))
    future = compute(broken, lambda: False)
    assert future and future.error == 'not finite'
    assert len(decode_trajectory(future.cdr).times_ns) == 3


def test_what_else_fails_is_not_silent(
    bench_of: Bench, model: Forecaster, falling: Falling
) -> None:
    broken = job(model, falling(0.0), 5, 10)
    broken.rollout.stepper = Broken(broken.rollout.stepper, RuntimeError('not thought of'))
    bench_of.horizon.request(lambda: broken)
    with pytest.raises(RuntimeError, match='not thought of'):
        bench_of.next()


class Broken(Stepper):
    """Breaks in its third step."""

    def __init__(self, whole: Stepper, error: Exception) -> None:
        self._step, self._left, self._error = whole.step, 2, error

    def step(self) -> State:
        self._left -= 1
        if self._left < 0:
            raise self._error
        return self._step()


@pytest.mark.parametrize(
    ('horizon', 'dt', 'steps'), [(1.0, 0.1, 10), (0.3, 0.1, 3), (0.31, 0.1, 4), (0.001, 0.1, 1)]
)
def test_steps_reach_the_horizon(horizon: float, dt: float, steps: int) -> None:
    assert steps_of(horizon, dt) == steps
