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
# poses (p, q) of FOUR in a box of 8 m, in float32 by two libraries (NumPy and torch, one
# thread), and how far these may be off: ten times as far as they were apart
POSES = {
    1: (
        1e-6,
        [
            [0.001334, -0.0000069, 2.4701825, 0.0007117, -0.0003012, 0.0001886, 0.9999997],
            [0.5006204, 0.3025269, 4.7473374, 0.0474312, 0.0033834, 0.0011355, 0.9988681],
            [-1.8998056, 0.1535763, 0.9849188, -0.0253083, 0.1480517, -0.0003985, 0.9886557],
            [2.0944281, -2.0957079, 4.1760601, -0.0032359, -0.0040607, 0.1020138, 0.9947694],
        ],
    ),
    10: (
        2e-5,
        [
            [1.7579519, -0.5531211, 1.082812, 0.1361983, 0.4717668, -0.0851058, 0.8669735],
            [1.4296441, 0.802725, 2.5358017, -0.1901866, 0.1526787, 0.0628789, 0.9677626],
            [-1.7189905, 0.5929816, 0.9971956, -0.1442036, 0.3551041, -0.1126637, 0.9167406],
            [2.9466878, -2.918334, 2.2929644, -0.1589376, -0.0997885, 0.832363, 0.5214911],
        ],
    ),
    20: (
        7e-5,
        [
            [2.9731041, -0.9451125, 0.9978543, 0.2408401, 0.8730319, -0.1275773, 0.4043951],
            [2.0772519, 2.6698227, 1.5675686, -0.8994753, 0.1671657, 0.1447947, 0.3768744],
            [-1.7480917, 0.6972701, 1.0014142, -0.1877788, 0.3389066, -0.1321223, 0.9123733],
            [2.2871068, -2.8686399, 1.0391167, -0.6421984, -0.0112089, 0.6937089, 0.3259195],
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
