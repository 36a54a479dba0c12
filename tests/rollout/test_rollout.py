# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The public API of prediction, on the shipped models."""

import warnings

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene, State, UserError
from rigid_gns_core.scenes.state import rotation_between

# what the shipped weights were trained on
MATERIAL = {'restitution': 0.7746, 'friction': 0.5, 'rolling_friction': 0.03}
SCENE = Scene(surfaces=Plane.box(30.0, 30.0), radius=1.0, **MATERIAL)


@pytest.fixture(scope='module', params=['laws', 'gns'])
def simulator(request):
    return load_simulator(request.param)


@pytest.fixture(scope='module')
def gns():
    return load_simulator('gns')


def test_the_laws_are_the_default():
    assert load_simulator().name == 'laws'
    assert load_simulator('').name == 'laws'


def start(count=12, seed=0):
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3), axis=-1).reshape(-1, 3)[:count]
    return grid * 4.0 - [6, 6, -4] + rng.uniform(-0.5, 0.5, (count, 3))


def test_shapes_units_and_start(simulator):
    positions = start()
    velocities = np.ones_like(positions)
    trajectory = simulator.rollout(SCENE, positions, velocities, steps=7)
    assert trajectory.positions.shape == (8, 12, 3)
    assert trajectory.quaternions.shape == (8, 12, 4)
    assert trajectory.velocities.shape == trajectory.angular_velocities.shape == (8, 12, 3)
    assert trajectory.dt == pytest.approx(0.1)
    np.testing.assert_array_equal(trajectory.positions[0], positions)
    np.testing.assert_array_equal(trajectory.velocities[0], velocities)
    np.testing.assert_allclose(np.linalg.norm(trajectory.quaternions, axis=-1), 1.0, atol=1e-14)


def test_velocities_are_the_differences_of_the_poses(gns):
    trajectory = gns.rollout(SCENE, start(), steps=20)
    np.testing.assert_allclose(
        trajectory.velocities[1:], np.diff(trajectory.positions, axis=0) / 0.1, atol=1e-11
    )
    turned = rotation_between(trajectory.quaternions[:-1], trajectory.quaternions[1:]) / 0.1
    np.testing.assert_allclose(trajectory.angular_velocities[1:], turned, atol=1e-9)


def test_same_start_same_bytes(simulator):
    first, second = (simulator.rollout(SCENE, start(), steps=30) for _ in range(2))
    assert first.positions.tobytes() == second.positions.tobytes()
    assert first.quaternions.tobytes() == second.quaternions.tobytes()


def test_stepping_equals_rollout(simulator):
    whole = simulator.rollout(SCENE, start(), steps=10)
    stepwise = simulator.start(SCENE, start())
    for step in range(1, 11):
        state = stepwise.step()
        np.testing.assert_array_equal(state.positions, whole.positions[step])
    assert stepwise.steps == 10


@pytest.mark.parametrize(('seconds', 'lengths'), [(1e9, [1, 8, 12]), (0.0, [1] * 21)])
def test_blocks_grow_with_the_time_they_may_take(simulator, seconds, lengths):
    whole = simulator.rollout(SCENE, start(), steps=21)
    rollout = simulator.start(SCENE, start())
    blocks = [states for states, _ in rollout.blocks(21, seconds)]
    assert [len(block) for block in blocks] == lengths
    together = np.concatenate([block.positions for block in blocks])
    np.testing.assert_array_equal(together, whole.positions[1:])
    assert rollout.steps == 21


def test_blocks_end_where_it_diverges():
    simulator = load_simulator('gns')
    simulator.network.decoder.last.weight.data *= 1e6
    *sound, (last, error) = simulator.start(SCENE, start()).blocks(30, 1.0)
    assert 'diverged' in error and not any(why for _, why in sound)
    assert sum(len(states) for states, _ in sound) + len(last) < 30


def test_order_of_spheres_does_not_matter(simulator):
    order = np.random.default_rng(1).permutation(12)
    first = simulator.rollout(SCENE, start(), steps=10)
    second = simulator.rollout(SCENE, start()[order], steps=10)
    # float32 sums in another order; ten steps, before collisions amplify
    np.testing.assert_allclose(second.positions, first.positions[:, order], atol=1e-3)


def test_small_spheres_are_the_same_model_rescaled(simulator):
    small = Scene(surfaces=Plane.box(0.6, 0.6), radius=0.02, **MATERIAL)
    assert 1 / simulator.native_dt(small) == pytest.approx(70.71, abs=0.01)
    large = simulator.rollout(SCENE, start(), steps=15)
    tiny = simulator.rollout(small, start() * 0.02, steps=15)
    # the same float32 network on inputs that differ by float64 rounding of the scale
    np.testing.assert_allclose(tiny.positions / 0.02, large.positions, atol=1e-3)
    assert tiny.dt == pytest.approx(0.1 * np.sqrt(0.02))


def test_gravity_may_point_anywhere(simulator):
    sideways = Scene(surfaces=(Plane(normal=(1.0, 0, 0)),), gravity=(-9.81, 0.0, 0.0), **MATERIAL)
    upright = Scene(surfaces=(Plane(),), **MATERIAL)
    reference = simulator.rollout(upright, [[0.0, 0, 20]], steps=20).positions[:, 0, 2]
    turned = simulator.rollout(sideways, [[20.0, 0, 0]], steps=20).positions[:, 0, 0]
    # features differ by the float64 rounding of a rotation
    np.testing.assert_allclose(turned, reference, atol=1e-3)


def test_spheres_fall_and_stay_in_the_box(simulator):
    trajectory = simulator.rollout(SCENE, start(), steps=60)
    assert trajectory.diverged_at is None
    assert trajectory.positions[10, :, 2].mean() < trajectory.positions[0, :, 2].mean()
    assert np.abs(trajectory.positions[..., :2]).max() < 16.0
    assert trajectory.positions[..., 2].min() > -1.0


def test_zero_spheres_and_zero_steps(simulator):
    assert simulator.rollout(SCENE, np.zeros((0, 3)), steps=3).positions.shape == (4, 0, 3)
    assert simulator.rollout(SCENE, start(), steps=0).positions.shape == (1, 12, 3)


@pytest.mark.parametrize(
    ('arguments', 'message'),
    [
        ({'positions': np.zeros((2, 2))}, r'positions has shape \(2, 2\), expected \(2, 3\)'),
        ({'positions': [[0, 0, np.nan]]}, 'positions of sphere 0 is not finite'),
        ({'positions': [[0, 0, 5]], 'velocities': np.zeros((2, 3))}, 'velocities has shape'),
        ({'positions': [[0, 0, 5]], 'velocities': [[1e200, 0, 0]]}, r'holds 1e\+200, expected'),
        ({'positions': [[0, 0, 5]], 'quaternions': [[0, 0, 0, 0]]}, 'quaternion of sphere 0'),
        ({'positions': [[0, 0, 5]], 'steps': -1}, 'steps is -1'),
    ],
)
def test_bad_input_is_named(simulator, arguments, message):
    with pytest.raises(ValueError, match=message):
        simulator.rollout(SCENE, **arguments)


def test_spheres_of_several_sizes_are_refused(gns):
    scene = Scene(radius=(1.0, 2.0), **MATERIAL)
    with pytest.raises(ValueError, match='radius differs between spheres .1 to 2.'):
        gns.rollout(scene, [[0, 0, 5], [9, 0, 5]])
    with pytest.raises(ValueError, match='mass is given for 2 spheres, but there are 3'):
        gns.rollout(Scene(mass=(1.0, 1.0)), start(3))


def test_a_material_that_the_model_was_not_trained_on_brings_a_warning(gns):
    with pytest.warns(UserWarning, match='restitution of the scene is 0.3.*trained at'):
        gns.rollout(Scene(**{**MATERIAL, 'restitution': 0.3}), start(1), steps=1)
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        gns.rollout(SCENE, start(1), steps=1)


def test_no_gravity():
    still = Scene(surfaces=(), gravity=(0.0, 0.0, 0.0), **MATERIAL)
    with pytest.raises(ValueError, match='gravity is 0'):
        load_simulator('gns').rollout(still, start(2))
    flight = load_simulator('laws').rollout(still, [[0.0, 0, 0]], [[1.0, 2, 3]], steps=10)
    np.testing.assert_allclose(flight.positions[-1, 0], [1.0, 2, 3], rtol=1e-12)


def test_divergence_brings_a_warning_and_is_marked():
    simulator = load_simulator('gns')
    simulator.network.decoder.last.weight.data *= 1e6
    with pytest.warns(UserWarning, match='diverged'):
        trajectory = simulator.rollout(SCENE, start(), steps=30)
    assert trajectory.diverged_at is not None
    assert np.isnan(trajectory.positions[-1]).all()
    assert np.isfinite(trajectory.positions[trajectory.diverged_at - 1]).all()


@pytest.mark.parametrize('value', [None, 'two', '2', -1, 1.5, np.nan, np.inf, [2], 10**400])
@pytest.mark.parametrize('name', ['steps', 'samples', 'seed', 'workers', 'scene', 'estimate'])
def test_a_wrong_number_or_scene_is_told_with_its_name(name: str, value: object) -> None:
    simulator, scene = load_simulator(), Scene(surfaces=())
    start = State(positions=[[0.0, 0.0, 0.0]])
    given = {'scene': scene, 'estimate': start, 'lead_times': [0.1]}
    call = simulator.forecast
    if name in ('steps', 'workers'):
        call, given = simulator.rollout_batch, {'scenes': scene, 'starts': [start], 'steps': 1}
    if name == 'workers' and value is None:
        return  # one per core
    with pytest.raises(UserError, match=f'^{name} is .*, expected ') as caught:
        call(**{**given, name: value})
    assert '\n' not in str(caught.value)
