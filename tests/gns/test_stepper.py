# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rollouts of the thesis' GNS: the shipped weights, devices, threads, and what diverges."""

import warnings

import numpy as np
import pytest
from rigid_gns_core import Air, ContactLaw, load_simulator, Plane, Scene, State
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.network import GNS
from rigid_gns_core.gns.stepper import GNSStepper, torch_threads
import torch

MATERIAL = {'restitution': 0.7746, 'friction': 0.5, 'rolling_friction': 0.03}
SCENE = Scene(surfaces=Plane.box(14.0, 14.0), **MATERIAL)
FOUR = State(
    positions=[[0.0, 0.0, 2.5], [0.5, 0.3, 5.2], [-2.2, 0.1, 1.0], [2.0, -2.0, 4.0]],
    velocities=[[0.0, 0, 0], [0, 0, -4.0], [3.0, 0.5, 0], [1.0, -1.0, 2.0]],
    angular_velocities=[[0.0, 0, 0], [1.0, 0, 0], [-0.5, 3.0, 0], [0, 0, 2.0]],
)
# poses (p, q) of FOUR in a box of 8 m, by one thread, and how far these may be off: ten times as
# far as starts moved by 1e-7 m are, which is what float32 has of them
POSES = {
    1: (
        1e-6,
        [
            [0.0004607, -0.0002378, 2.4617539, 0.0006991, -0.0001071, 0.0002081, 0.9999997],
            [0.5009821, 0.302901, 4.7289184, 0.0454577, 0.0011123, 0.0001813, 0.9989656],
            [-1.9018606, 0.1512141, 0.9892251, -0.0254005, 0.1486924, 0.0001956, 0.9885572],
            [2.0933049, -2.095536, 4.1532071, -0.0009178, -0.0030183, 0.1014188, 0.9948388],
        ],
    ),
    10: (
        3e-5,
        [
            [1.2273871, -0.7459792, 1.04807, 0.182064, 0.2319965, -0.0352145, 0.9548771],
            [2.0271662, 1.4003758, 2.2111519, -0.4405799, 0.2524039, 0.0746742, 0.8582572],
            [-1.5766335, 0.6590077, 0.997703, -0.2129011, 0.3843742, -0.0978299, 0.8929496],
            [2.9306833, -2.9107335, 1.3740691, -0.0996664, -0.0634063, 0.8510493, 0.5116261],
        ],
    ),
    20: (
        2e-4,
        [
            [1.5466563, -1.3051398, 0.9889888, 0.4628649, 0.3974349, -0.0020272, 0.7923367],
            [2.5919895, 2.8144495, 1.3760963, -0.6393501, 0.7191004, 0.2349481, -0.1375697],
            [-1.5351058, 1.0281678, 1.0025488, -0.3694975, 0.3890513, -0.1601548, 0.8285295],
            [2.7452873, -2.9785953, 1.0880926, -0.2138072, -0.1470731, 0.8993438, 0.3519044],
        ],
    ),
}


@pytest.fixture(scope='module')
def gns():
    return load_simulator('gns')


@pytest.fixture(scope='module')
def start():
    x, y, z = np.meshgrid([-4.0, -1.5, 1.5, 4.0], [-4.0, -1.5, 1.5, 4.0], [2.0, 4.5])
    return State(positions=np.stack([x, y, z], axis=-1).reshape(-1, 3))


def test_the_shipped_weights_give_the_rollout_they_gave(gns):
    scene = Scene(surfaces=Plane.box(8.0, 8.0), **MATERIAL)
    found = gns.rollout(scene, **vars(FOUR), steps=20)
    for step, (off, poses) in POSES.items():
        pose = np.concatenate([found.positions[step], found.quaternions[step]], axis=1)
        np.testing.assert_allclose(pose, poses, rtol=0, atol=off)


def test_the_cpu_by_name_is_the_default(gns, start):
    by_name = load_simulator('gns', device='cpu')
    one, other = (s.rollout(SCENE, start.positions, steps=5) for s in (gns, by_name))
    assert one.positions.tobytes() == other.positions.tobytes()
    assert one.quaternions.tobytes() == other.quaternions.tobytes()


def test_other_units_are_the_same_motion(gns, start):
    """Gravity along x and spheres of 2 cm: dynamic similarity, to float32 of the features."""
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    small = Scene(surfaces=(Plane((0, 0, 0), (1, 0, 0)),), radius=0.02, gravity=(-9.81, 0, 0))
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # its materials
        found = gns.rollout(small, 0.02 * start.positions @ turn.T, steps=5)
        expected = gns.rollout(Scene(surfaces=(Plane(),)), start.positions, steps=5)
    assert found.dt == pytest.approx(expected.dt * np.sqrt(0.02))
    np.testing.assert_allclose(
        found.positions, 0.02 * expected.positions @ turn.T, rtol=0, atol=1e-4 * 0.02
    )


def test_the_history_starts_with_copies_of_the_first_motion():
    network = GNS(GNSConfig(message_passing_steps=1, width=8, history=3)).eval()
    stepper = GNSStepper(network, SCENE, FOUR, 0.1)
    for k in range(4):
        np.testing.assert_array_equal(
            stepper.motion.angular_velocities[k], FOUR.angular_velocities
        )
        # the difference over the step before of a sphere that flies: v - g dt / 2
        np.testing.assert_allclose(stepper.motion.velocities[k, 1], [0, 0, -4.0 + 0.4905])
    first = stepper.step()
    assert len(stepper.motion.velocities) == 4
    np.testing.assert_array_equal(stepper.motion.velocities[0], first.velocities)
    np.testing.assert_allclose(
        first.positions, FOUR.positions + 0.1 * first.velocities, rtol=0, atol=1e-14
    )


def test_a_state_that_is_changed_leaves_the_rollout_alone(gns, start):
    expected = gns.rollout(SCENE, start.positions, steps=2)
    rollout = gns.start(SCENE, start.positions)
    rollout.step().positions[:] = 0.0
    np.testing.assert_array_equal(rollout.step().positions, expected.positions[2])


def test_threads_are_set_for_the_step_only(start):
    simulator = load_simulator('gns', threads=2)
    seen = []
    with torch_threads(3):
        rollout = simulator.start(SCENE, start.positions)
        hook = simulator.network.register_forward_pre_hook(
            lambda *_: seen.append(torch.get_num_threads())
        )
        rollout.step()
        simulator.rollout_batch(SCENE, [start.positions] * 2, steps=1, workers=2)
        hook.remove()
        assert torch.get_num_threads() == 3
    assert seen == [2, 2, 2]


def test_every_tensor_is_on_the_device(gns, start):
    rollout = gns.start(SCENE, start.positions)
    with torch.device('meta'):  # what does not say where it belongs lands there, and fails
        rollout.step()


def test_a_rollout_that_diverges_says_so(gns):
    lost = State(positions=[[0.0, 0, 5], [9.0, 0, 5]], velocities=[[1e13, 0, 0], [0, 0, 0]])
    with pytest.raises(FloatingPointError, match='diverged'):
        gns.start(Scene(surfaces=(Plane(),), **MATERIAL), **vars(lost)).step()


def test_no_steps_and_no_spheres(gns):
    assert gns.rollout(SCENE, np.zeros((0, 3)), steps=3).positions.shape == (4, 0, 3)
    assert gns.rollout(SCENE, [[0.0, 0, 5]], steps=0).positions.shape == (1, 1, 3)


@pytest.mark.parametrize(
    ('device', 'message'),
    [
        ('gpu', "device is 'gpu', allowed: 'cpu', 'cuda'"),
        ('mps', "device is 'mps', allowed: 'cpu', 'cuda'"),
        ('cuda', 'finds 0 CUDA devices here; leave device'),
    ],
)
def test_an_absent_device_is_named(device, message, monkeypatch):
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: False)
    with pytest.raises(ValueError, match=message):
        load_simulator('gns', device=device)


@pytest.mark.skipif(not torch.cuda.is_available(), reason='needs a CUDA device')
def test_on_a_gpu(gns, start):
    gpu = load_simulator('gns', device='cuda')
    found = gpu.rollout(SCENE, start.positions, steps=5)
    expected = gns.rollout(SCENE, start.positions, steps=5)
    np.testing.assert_allclose(found.positions, expected.positions, rtol=0, atol=1e-4)


@pytest.mark.parametrize(
    ('given', 'what'),
    [
        ({'air': Air()}, 'air'),
        ({'surfaces': Plane(contact=ContactLaw())}, 'a contact law'),
        ({'inertia_factor': 2 / 3}, 'hollow spheres'),
    ],
)
def test_what_it_was_trained_without_is_told(gns, given: dict, what: str) -> None:
    with pytest.warns(UserWarning, match=f'the scene has {what}, but model .* trained without'):
        gns.check(Scene(**{'surfaces': Plane()} | given), 1)
