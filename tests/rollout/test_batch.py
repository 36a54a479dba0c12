# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many rollouts at once: each is bit for bit the one that runs alone."""

from dataclasses import fields
import threading
import warnings

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene, State, Trajectory
from rigid_gns_core.commands import cli
from rigid_gns_core.commands.rollout import position_spread
from rigid_gns_core.data.records import read_record
from rigid_gns_core.running.threads import in_threads

# what the shipped weights were trained on
MATERIAL = {'restitution': 0.7746, 'friction': 0.5, 'rolling_friction': 0.03}
SCENE = Scene(surfaces=Plane.box(12.0, 12.0), **MATERIAL)
SMALL = Scene(surfaces=(Plane(),), radius=0.02, gravity=(-9.81, 0.0, 0.0), **MATERIAL)


@pytest.fixture(scope='module', params=['laws', 'gns'])
def simulator(request):
    return load_simulator(request.param)


def start(seed, count=9, scale=1.0):
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3), axis=-1).reshape(-1, 3)[:count]
    quaternions = rng.normal(size=(count, 4))
    return State(
        positions=scale * (grid * 2.5 - [2.5, 2.5, -1.5] + rng.uniform(-0.2, 0.2, (count, 3))),
        quaternions=quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        velocities=scale * rng.normal(size=(count, 3)) * 5,
        angular_velocities=rng.normal(size=(count, 3)),
    )


def alone(simulator, scene, state, steps):
    return simulator.rollout(scene, **vars(state), steps=steps)


def assert_same_bytes(found, expected):
    for field in fields(expected):
        one, other = (np.asarray(getattr(t, field.name)) for t in (found, expected))
        assert one.tobytes() == other.tobytes(), field.name


@pytest.mark.parametrize('workers', [1, 2, 5, None])
def test_each_trajectory_is_that_of_a_rollout_alone(simulator, workers):
    starts = [start(seed) for seed in range(6)]
    batch = simulator.rollout_batch(SCENE, starts, steps=25, workers=workers)
    assert len(batch) == 6
    for state, trajectory in zip(starts, batch, strict=True):
        assert_same_bytes(trajectory, alone(simulator, SCENE, state, 25))


def test_scenes_of_their_own_with_other_counts_and_units(simulator):
    scenes = [SCENE, SMALL, SCENE]
    starts = [start(0, 4), start(1, 7, scale=0.02), start(2, 0)]
    batch = simulator.rollout_batch(scenes, starts, steps=12, workers=3)
    assert [trajectory.count for trajectory in batch] == [4, 7, 0]
    assert batch[1].dt == pytest.approx(0.1 * np.sqrt(0.02))
    for scene, state, trajectory in zip(scenes, starts, batch, strict=True):
        assert_same_bytes(trajectory, alone(simulator, scene, state, 12))


def test_an_array_of_centres_is_spheres_at_rest(simulator):
    positions = np.stack([start(seed).positions for seed in range(3)])
    batch = simulator.rollout_batch(SCENE, positions, steps=5)
    for trajectory, one in zip(batch, positions, strict=True):
        assert_same_bytes(trajectory, simulator.rollout(SCENE, one, steps=5))


def test_threads_of_the_thesis_network_change_nothing():
    # a number of threads that one worker sets back while another multiplies would
    simulator = load_simulator('gns', threads=2)
    starts = [start(seed) for seed in range(4)]
    for state, trajectory in zip(
        starts, simulator.rollout_batch(SCENE, starts, steps=10, workers=3), strict=True
    ):
        assert_same_bytes(trajectory, alone(simulator, SCENE, state, 10))


def test_a_rollout_that_diverges_does_not_change_the_others():
    simulator = load_simulator('gns')
    starts = [start(seed) for seed in range(3)]
    far = State(positions=[[0.0, 0, 5], [9.0, 0, 5]], velocities=[[1e13, 0, 0], [0, 0, 0]])
    sound = [alone(simulator, SCENE, state, 20) for state in starts]
    with pytest.warns(
        UserWarning, match=r'start 1: the rollout diverged.*\(step \d+ of 20\)'
    ) as w:
        batch = simulator.rollout_batch(SCENE, [starts[0], far, *starts[1:]], steps=20, workers=2)
    assert w[0].filename == __file__  # it points at who asked for the batch
    lost = batch.pop(1)
    assert lost.diverged_at is not None
    assert np.isnan(lost.positions[-1]).all()
    assert np.isfinite(lost.positions[lost.diverged_at - 1]).all()
    for trajectory, expected in zip(batch, sound, strict=True):
        assert_same_bytes(trajectory, expected)


def test_nothing_to_predict(simulator):
    assert simulator.rollout_batch(SCENE, []) == []
    assert simulator.rollout_batch([], np.zeros((0, 4, 3))) == []
    (trajectory,) = simulator.rollout_batch(SCENE, [start(0)], steps=0)
    np.testing.assert_array_equal(trajectory.positions, start(0).positions[None])


@pytest.mark.parametrize(
    ('scenes', 'starts', 'message'),
    [
        (SCENE, [[[0.0, 0, 5]], [[0.0, 0, np.nan]]], 'start 1: positions of sphere 0 is not fin'),
        (SCENE, np.zeros((2, 4)), r'start 0: positions has shape \(4,\), expected \(4, 3\)'),
        ([SCENE], [start(0), start(1)], 'there are 1 scenes for 2 starts; give one scene for all'),
        (SCENE, start(0), 'starts is one State, expected several'),
        (Scene(mass=(1.0, 1.0)), [start(0, 2), start(1, 3)], 'start 1: mass is given for 2 sph'),
    ],
)
def test_wrong_starts_are_named(simulator, scenes, starts, message):
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # default materials
        with pytest.raises(ValueError, match=message):
            simulator.rollout_batch(scenes, starts, steps=1)


@pytest.mark.parametrize(('name', 'value'), [('workers', 0), ('steps', -1)])
def test_numbers_out_of_range(simulator, name, value):
    with pytest.raises(ValueError, match=f'{name} is {value}'):
        simulator.rollout_batch(SCENE, [start(0)], **{name: value})


def test_items_run_beside_each_other():
    meet = threading.Barrier(3)
    # each waits for the other two: one after another would break the barrier
    assert in_threads(lambda item: (meet.wait(30), 2 * item)[1], [1, 2, 3], 3) == [2, 4, 6]


def test_waiting_items_do_not_begin_after_an_error():
    begun = []

    def work(item):
        begun.append(item)
        raise KeyError(item)

    with pytest.raises(KeyError, match='0'):
        in_threads(work, range(100), 2)
    assert len(begun) < 100


def test_samples_of_a_start_near_it(tmp_path, capsys):
    few, many = tmp_path / 'few', tmp_path / 'many'
    for out, samples in ((few, 2), (many, 4)):
        words = ['--steps', '3', '--spread', '0.002', '--threads', '2', '--out', str(out)]
        assert cli.main(['rollout', '--samples', str(samples), *words]) == 0
    printed = capsys.readouterr().out
    assert 'spread of 4 samples [m]' in printed and '4 samples' in printed
    alone = tmp_path / 'alone.h5'
    assert cli.main(['rollout', '--steps', '3', '--out', str(alone)]) == 0
    records = [read_record(many / f'{k:04d}.h5') for k in range(4)]
    assert [record.index for record in records] == [0, 1, 2, 3]
    exact = read_record(alone).trajectory.positions
    np.testing.assert_array_equal(records[0].trajectory.positions, exact)
    # a sample does not depend on how many there are
    second = read_record(few / '0001.h5').trajectory.positions
    np.testing.assert_array_equal(records[1].trajectory.positions, second)
    moved = np.stack([record.trajectory.positions[0] - exact[0] for record in records[1:]])
    # 1386 draws: their standard deviation is known to 2 %, so 10 % is five of those
    assert moved.std() == pytest.approx(0.002, rel=0.1)


def test_the_spread_is_the_distance_from_the_mean_place():
    def at(x):
        still = np.zeros((1, 2, 3))
        place = np.array([[[x, 0.0, 0.0], [0.0, 2 * x, 5.0]]])
        turn = np.tile([0.0, 0, 0, 1], (1, 2, 1))
        return Trajectory(
            positions=place, quaternions=turn, velocities=still, angular_velocities=still, dt=0.1
        )

    np.testing.assert_allclose(position_spread([at(-3.0), at(3.0)]), [[3.0, 6.0]])


def test_a_spread_out_of_range_is_named(tmp_path, capsys):
    words = ['--samples', '2', '--spread', '-1', '--out', str(tmp_path / 'x')]
    assert cli.main(['rollout', *words]) == 2
    assert '--spread is -1 m' in capsys.readouterr().err


def test_samples_are_rollouts_to_the_bit(simulator):
    """Also with gravity along x, and where all fly clear of everything."""
    for scene, height in ((SCENE, 0.0), (SMALL, 0.0), (SCENE, 50.0)):
        scale = float(np.max(scene.radius))
        starts = [start(seed, count=3, scale=scale) for seed in range(4)]
        stack = State.unchecked(
            *(np.stack([getattr(one, f.name) for one in starts]) for f in fields(State))
        )
        stack.positions[...] -= height * scale * np.asarray(scene.gravity) / 9.81
        found = simulator.rollout_samples(scene, stack, 20)
        for k in range(4):
            own = State(**{name: values[k] for name, values in vars(stack).items()})
            expected = alone(simulator, scene, own, 20)
            for name in vars(stack):
                assert getattr(found, name)[k].tobytes() == getattr(expected, name).tobytes()


def test_a_sample_that_diverges_is_nan_from_there_on(simulator):
    # states that are checked take numbers of up to 1e100
    speed = 1.7e308 if simulator.name == 'laws' else 9e99
    stack = State.unchecked(
        np.array([[[0.0, 0.0, 2.0]], [[0.0, 0.0, 1e99]]]),
        np.tile([0.0, 0.0, 0.0, 1.0], (2, 1, 1)),
        np.array([[[0.0, 0.0, 0.0]], [[0.0, 0.0, speed]]]),
        np.zeros((2, 1, 3)),
    )
    with np.errstate(all='ignore'):
        found = simulator.rollout_samples(SCENE, stack, 20)
    assert np.isfinite(found.positions[0]).all() and np.isnan(found.positions[1, -1]).all()
