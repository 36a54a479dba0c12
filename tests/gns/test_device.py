# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The thesis' GNS on a device: the same as on the host, and no step waits for the device."""

from dataclasses import replace
import warnings

import numpy as np
import pytest
from rigid_gns_core import load_simulator, Plane, Scene, State
from rigid_gns_core.gns import device_stepper
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.device_graph import DeviceScenes, links_of, padded
from rigid_gns_core.gns.device_stepper import DeviceStepper, diverged
from rigid_gns_core.gns.graph import build_graph, Reach
from rigid_gns_core.gns.network import GNS
from rigid_gns_core.gns.stepper import GNSStepper
import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten

MATERIAL = {'restitution': 0.7746, 'friction': 0.5, 'rolling_friction': 0.03}
PLATE = Plane((0.0, 0.0, 3.0), (0.3, 0.0, 0.954), length_x=4.0, length_y=3.0)
SCENES = [
    Scene(surfaces=(*Plane.box(14.0, 14.0), PLATE), **MATERIAL),
    Scene(surfaces=(Plane(),), **MATERIAL),
    Scene(surfaces=(), **MATERIAL),
]
COUNTS = (30, 7, 1)
CONNECTIVITIES = ('epsilon', 'vmax', 'vi', 'swept')
CONFIG = GNSConfig(message_passing_steps=2, width=16)
CPU = torch.device('cpu')


def crowd(count, seed, speed=8.0):
    rng = np.random.default_rng(seed)
    quaternions = rng.normal(size=(count, 4))
    return State(
        positions=rng.uniform(-6, 6, (count, 3)) + [0, 0, 7],
        quaternions=quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True),
        velocities=rng.normal(size=(count, 3)) * speed,
        angular_velocities=rng.normal(size=(count, 3)),
    )


STARTS = [crowd(count, seed) for seed, count in enumerate(COUNTS)]


def network(config=CONFIG, seed=0):
    torch.manual_seed(seed)
    return GNS(config).eval()


def tensors(name, width):
    return torch.from_numpy(padded([getattr(s, name) for s in STARTS], 30, (width,), 0.0))


@pytest.mark.parametrize('ground_edge', [True, False])
@pytest.mark.parametrize('connectivity', CONNECTIVITIES)
def test_edges_are_those_of_the_graph_on_the_host(connectivity, ground_edge):
    reach = Reach(connectivity, epsilon=0.7, ground_edge=ground_edge)
    scenes = DeviceScenes.of(SCENES, COUNTS, CPU)
    links = links_of(scenes, tensors('positions', 3), tensors('velocities', 3), 0.1, reach, 29)
    most = 0
    for k, (scene, state) in enumerate(zip(SCENES, STARTS, strict=True)):
        graph = build_graph(state.positions, state.velocities, scene, 0.1, reach)
        receiver, slot = torch.nonzero(links.linked[k], as_tuple=True)
        sender = links.neighbour[k][receiver, slot]
        found = set(zip(receiver.tolist(), sender.tolist(), strict=True))
        assert found == set(zip(graph.receivers.tolist(), graph.senders.tolist(), strict=True))
        receiver, surface = torch.nonzero(links.surface_linked[k], as_tuple=True)
        assert receiver.tolist() == graph.surface_receivers.tolist()
        assert surface.tolist() == graph.surface_senders.tolist()
        points = links.surface_points[k][receiver, surface].numpy()
        # the same float64 arithmetic in another order, of numbers of order 10
        np.testing.assert_allclose(points, graph.surface_points, atol=1e-13)
        most = max(most, np.bincount(graph.receivers).max(initial=0))
    assert int(links.most) == most
    assert most > 0


def test_a_sphere_that_crosses_a_plane_with_an_end_in_one_step():
    table = Scene(surfaces=(Plane((0, 0, 0), (0, 0, 1), (1, 0, 0), 10.0, 10.0),))
    positions = torch.tensor([[[0.0, 0, 3.0], [30.0, 0, 3.0]]], dtype=torch.float64)
    velocities = torch.tensor([[[0.0, 0, -60.0], [0.0, 0, -60.0]]], dtype=torch.float64)
    scenes = DeviceScenes.of([table], [2], CPU)
    reach = Reach('swept', ground_edge=False)
    links = links_of(scenes, positions, velocities, 0.1, reach, 1)
    assert links.surface_linked[0, :, 0].tolist() == [True, False]


def test_gravity_brings_a_sphere_at_rest_to_a_plane():
    # 0.06 m above it, beyond the margin of 0.05, but g dt^2 / 2 = 0.049 m nearer after the step
    positions = torch.tensor([[[0.0, 0, 1.06], [9.0, 0, 1.2]]], dtype=torch.float64)
    scenes = DeviceScenes.of([Scene()], [2], CPU)
    reach = Reach('swept', ground_edge=False)
    links = links_of(scenes, positions, torch.zeros_like(positions), 0.1, reach, 1)
    assert links.surface_linked[0, :, 0].tolist() == [True, False]


SWITCHES = [
    *[{'connectivity': name} for name in CONNECTIVITIES],
    {'third_law': False},
    {'mask_pose': False},
    {'sphere_properties': True},
    {'target': 'acceleration'},
    {'history': 0},
    {'ground_edge': False},
]


@pytest.mark.parametrize('switch', SWITCHES, ids=str)
def test_steps_are_those_of_the_reference(switch):
    net = network(replace(CONFIG, **switch))
    net.node_normaliser.scale.fill_(5.0)
    net.target_normaliser.scale.fill_(3.0)
    found = DeviceStepper(net, SCENES, STARTS, 0.1, CPU).block(4)
    for k, (scene, state) in enumerate(zip(SCENES, STARTS, strict=True)):
        reference = GNSStepper(net.predict, net.config, scene, state, 0.1)
        for row in found[:, k, : len(state)]:
            expected = reference.step()
            # float32 sums of about ten messages of order one, in another order; four steps
            for part, name in ((row[:, :3], 'positions'), (row[:, 3:7], 'quaternions'),
                               (row[:, 7:10], 'velocities'),
                               (row[:, 10:], 'angular_velocities')):  # fmt: skip
                np.testing.assert_allclose(part, getattr(expected, name), rtol=1e-5, atol=3e-5)


class Watch(TorchDispatchMode):
    """Fails at operators that make the host wait for a device, and at tensors elsewhere."""

    WAITING = (
        '_local_scalar_dense', 'item', 'nonzero', 'is_nonzero', 'masked_select', 'equal',
        '_unique', '_unique2', 'unique_dim', 'unique_consecutive', 'repeat_interleave',
    )  # fmt: skip

    def __init__(self, device):
        super().__init__()
        self.device, self.seen = device, 0

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        name = func.overloadpacket.__name__
        assert name not in self.WAITING, name
        if name in ('index', 'index_put', 'index_put_'):
            assert not any(i is not None and i.dtype == torch.bool for i in args[1]), name
        result = func(*args, **(kwargs or {}))
        for value in tree_flatten((args, kwargs, result))[0]:
            if isinstance(value, torch.Tensor):
                assert value.device.type == self.device, (name, value.device)
        self.seen += 1
        return result


@pytest.mark.parametrize('device', ['cpu', 'meta'])
@pytest.mark.parametrize('switch', SWITCHES, ids=str)
def test_a_step_never_waits_for_the_device(switch, device):
    # tensors of 'meta' have no values: whatever asked for one would fail, and so would a scalar
    # that is copied from the host
    stepper = DeviceStepper(network(replace(CONFIG, **switch)), SCENES, STARTS, 0.1, device)
    with Watch(device) as watch, torch.no_grad():
        motion, most = stepper.next_motion(stepper.motion)
    assert watch.seen > 100
    assert motion.positions.shape == (3, 30, 3) and most.shape == ()


@pytest.mark.parametrize(
    'wait', [lambda x: x.max().item(), lambda x: x[x > 0], lambda x: x.to('meta')]
)
def test_the_watch_sees_what_waits(wait):
    with pytest.raises(AssertionError), Watch('cpu'):
        wait(torch.ones(3))


def test_room_for_neighbours_grows_where_a_step_needs_it():
    net = network(replace(CONFIG, connectivity='epsilon', epsilon=6.0))
    stepper = DeviceStepper(net, SCENES[:1], STARTS[:1], 0.1, CPU)
    assert stepper.room == 16
    found = stepper.block(2)
    assert stepper.room > 16
    reference = GNSStepper(net.predict, net.config, SCENES[0], STARTS[0], 0.1)
    expected = [reference.step() for _ in range(2)][-1]
    np.testing.assert_allclose(found[-1, 0, :, :3], expected.positions, atol=3e-5)


@pytest.fixture(scope='module')
def on_device():
    return load_simulator('gns', backend='torch', device='cpu')


@pytest.fixture(scope='module')
def start():
    x, y, z = np.meshgrid([-4.0, -1.5, 1.5, 4.0], [-4.0, -1.5, 1.5, 4.0], [2.0, 4.5])
    return State(positions=np.stack([x, y, z], axis=-1).reshape(-1, 3))


def test_rollouts_are_those_of_the_engine(on_device, start):
    for scene, scale in ((SCENES[0], 1.0), (Scene(gravity=(-9.81, 0, 0), radius=0.02), 0.02)):
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # its materials
            found, expected = (
                simulator.rollout(scene, scale * start.positions, steps=10)
                for simulator in (on_device, load_simulator('gns'))
            )
        assert found.dt == expected.dt
        # one step differs by 1e-7 radii; what is near to a collision grows
        np.testing.assert_allclose(found.positions, expected.positions, rtol=0, atol=1e-4 * scale)
        np.testing.assert_allclose(found.quaternions, expected.quaternions, rtol=0, atol=1e-4)
        np.testing.assert_array_equal(found.positions[0], scale * start.positions)


def test_blocks_and_single_steps_are_the_same_rollout(on_device, start, monkeypatch):
    whole = on_device.rollout(SCENES[0], start.positions, steps=7)
    again = on_device.rollout(SCENES[0], start.positions, steps=7)
    assert whole.positions.tobytes() == again.positions.tobytes()
    monkeypatch.setattr(device_stepper, 'BLOCK', 3)
    in_blocks = on_device.rollout(SCENES[0], start.positions, steps=7)
    np.testing.assert_array_equal(in_blocks.positions, whole.positions)
    rollout = on_device.start(SCENES[0], start.positions)
    for step in range(1, 8):
        np.testing.assert_array_equal(rollout.step().positions, whole.positions[step])


def test_batches_are_the_rollouts_alone(on_device):
    scenes = [*SCENES, SCENES[1]]
    starts = [*STARTS, State(positions=np.zeros((0, 3)))]
    batch = on_device.rollout_batch(scenes, starts, steps=4)
    for scene, state, trajectory in zip(scenes, starts, batch, strict=True):
        alone = on_device.rollout(scene, **vars(state), steps=4)
        assert trajectory.positions.shape == (5, len(state), 3)
        # products of matrices of other sizes round differently; speeds of up to 25
        np.testing.assert_allclose(trajectory.positions, alone.positions, rtol=0, atol=1e-3)


def test_memory_bounds_a_batch(on_device, monkeypatch):
    whole = on_device.rollout_batch(SCENES, STARTS, steps=2)
    monkeypatch.setattr('rigid_gns_core.prediction.on_device._PAIRS', 1)
    one_by_one = on_device.rollout_batch(SCENES, STARTS, steps=2)
    for one, other in zip(whole, one_by_one, strict=True):
        np.testing.assert_allclose(one.positions, other.positions, rtol=0, atol=1e-3)


def test_one_that_diverges_leaves_the_others_alone(on_device):
    lost = State(positions=[[0.0, 0, 5], [9.0, 0, 5]], velocities=[[1e13, 0, 0], [0, 0, 0]])
    with pytest.warns(UserWarning, match=r'start 0: the rollout diverged.*\(step \d+ of 70\)'):
        first, second = on_device.rollout_batch(SCENES[1], [lost, STARTS[1]], steps=70)
    assert first.diverged_at is not None
    assert np.isnan(first.positions[first.diverged_at :]).all()
    assert second.diverged_at is None
    with pytest.raises(FloatingPointError, match='diverged'):
        on_device.start(SCENES[1], **vars(lost)).step()


def test_no_steps_and_no_spheres(on_device):
    assert on_device.rollout(SCENES[0], np.zeros((0, 3)), steps=3).positions.shape == (4, 0, 3)
    assert on_device.rollout(SCENES[0], [[0.0, 0, 5]], steps=0).positions.shape == (1, 1, 3)
    assert on_device.rollout_batch(SCENES[0], []) == []
    assert not diverged(np.zeros((2, 0, 13))).any()


@pytest.mark.parametrize(
    ('name', 'options', 'message'),
    [
        ('gns', {'device': 'cuda'}, "backend 'engine' runs on the CPU; give backend='torch' too"),
        ('gns', {'device': 'gpu', 'backend': 'torch'}, "device is 'gpu', allowed: 'cpu', 'cuda'"),
        ('gns', {'device': 'mps', 'backend': 'torch'}, "device is 'mps', allowed: 'cpu', 'cuda'"),
        ('gns', {'device': 'cuda', 'backend': 'torch'}, 'finds 0 CUDA devices here; leave device'),
        ('laws', {'device': 'cuda'}, "unknown key 'device', allowed: guard, sleep"),
    ],
)
def test_a_device_that_cannot_be_had_is_named(name, options, message, monkeypatch):
    monkeypatch.setattr(torch.cuda, 'is_available', lambda: False)
    with pytest.raises(ValueError, match=message):
        load_simulator(name, **options)


@pytest.mark.skipif(not torch.cuda.is_available(), reason='needs a CUDA device')
def test_on_a_gpu(start):
    gpu = load_simulator('gns', backend='torch', device='cuda')
    found = gpu.rollout(SCENES[0], start.positions, steps=5)
    expected = load_simulator('gns').rollout(SCENES[0], start.positions, steps=5)
    np.testing.assert_allclose(found.positions, expected.positions, rtol=0, atol=1e-4)
