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

"""Training data on a device: edges, windows and losses as from arrays, tested on the CPU."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.device_graph import DeviceScenes
from rigid_gns_core.gns.graph import build_graph
from rigid_gns_core.gns.tensor_features import tensor_features, TensorGraph
from rigid_gns_core.gns.tensor_graph import connect, Spheres
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.similarity import ModelUnits
from rigid_gns_core.scenes.state import rotate_quaternions, Trajectory
from rigid_gns_core.training.gns.closed_loop import connector, stack_windows
from rigid_gns_core.training.gns.learner import GNSLearner, GNSTrainConfig
from rigid_gns_core.training.gns.resident import Resident
from rigid_gns_core.training.gns.windows import draw_windows, Noise, one_step_batch, Source
import torch

DT = 0.1
CPU = torch.device('cpu')
UNITS = ModelUnits(radius=1.0, gravity=9.81, dt=DT)
RAMP = Plane((1, 0, 4), (0, 0.6, 0.8), length_x=6.0, length_y=4.0)
SCENES = [
    Scene(surfaces=Plane.box(12.0, 12.0), radius=0.7),
    Scene(surfaces=(), radius=0.7),
    Scene(surfaces=(*Plane.box(9.0, 14.0, 5.0), RAMP), radius=0.7),
    Scene(surfaces=(Plane((0, 0, -2)), RAMP, Plane()), radius=0.7, gravity=(0.0, 0.0, -5.0)),
]
COUNTS = [60, 25, 40, 1]
MODEL = GNSConfig(message_passing_steps=1, width=8)


def random_spheres(seed, count, side=12.0):
    rng = np.random.default_rng(seed)
    # some behind walls and below the ground; speeds over three decades, so that reaches differ
    positions = rng.uniform(-side / 2, side / 2, (count, 3)) * 1.1 + [0, 0, side / 2]
    return positions, rng.normal(size=(count, 3)) * 10 ** rng.uniform(-1, 1.7, (count, 1))


def edges(links):
    """Rows of everything an edge has, in an order of their own."""
    pairs = torch.stack([links.senders, links.receivers], 1).double()
    surfaces = torch.cat(
        [links.surface_receivers[:, None], links.surface_normals, links.surface_points], 1
    )
    return [rows[np.lexsort(rows.T[::-1])] for rows in (pairs.numpy(), surfaces.double().numpy())]


@pytest.mark.parametrize('ground_edge', [True, False])
@pytest.mark.parametrize('connectivity', ['epsilon', 'vmax', 'vi', 'swept'])
def test_edges_are_those_of_build_graph(connectivity, ground_edge):
    config = replace(MODEL, connectivity=connectivity, epsilon=0.6, ground_edge=ground_edge)
    total = np.zeros(2, dtype=int)
    for seed in range(3):
        states = [random_spheres(seed + k, count) for k, count in enumerate(COUNTS)]
        graphs = [
            build_graph(*state, scene, DT, config.reach(0.7))
            for state, scene in zip(states, SCENES, strict=True)
        ]
        expected = TensorGraph.of(graphs, SCENES, COUNTS)
        owner = torch.repeat_interleave(torch.arange(4), torch.tensor(COUNTS))
        first = torch.tensor([0, 60, 85, 125])
        spheres = Spheres(owner, torch.arange(126) - first[owner], first)
        positions, velocities = (
            torch.from_numpy(np.concatenate([state[k] for state in states])) for k in (0, 1)
        )
        scenes = DeviceScenes.of(SCENES, COUNTS, CPU)
        found = connect(scenes, spheres, positions, velocities, DT, config.reach(0.7))
        for ours, theirs in zip(edges(found), edges(expected), strict=True):
            np.testing.assert_allclose(ours, theirs, atol=1e-13)  # points, in float64
        assert torch.equal(found.senders[found.reverse], found.receivers)
        assert torch.equal(found.reverse[found.reverse], torch.arange(len(found.reverse)))
        total += len(found.senders), len(found.surface_receivers)
    assert total.min() > 50  # dense enough to tell something


def source(seed, count, steps=10, scene=SCENES[0]):
    """Spheres that jitter, all of one radius."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-4, 4, (1, count, 3)) + [0, 0, 5]
    positions = positions + np.cumsum(0.2 * rng.normal(size=(steps + 1, count, 3)), axis=0)
    turns = np.cumsum(rng.normal(size=positions.shape), axis=0) * 0.3
    identity = np.tile([0.0, 0, 0, 1], (steps + 1, count, 1))
    trajectory = Trajectory(
        positions=positions,
        quaternions=rotate_quaternions(identity, turns),
        velocities=np.gradient(positions, DT, axis=0),
        angular_velocities=rng.normal(size=positions.shape),
        dt=DT,
    )
    return Source.of(trajectory, scene)


def sources():
    return [source(0, 25), source(1, 40, scene=SCENES[2]), source(2, 3, steps=4, scene=SCENES[1])]


@pytest.mark.parametrize('corrects', [False, True])
@pytest.mark.parametrize(
    'switch', [{}, {'history': 0}, {'mask_pose': False, 'sphere_properties': True}], ids=str
)
def test_batches_are_those_of_arrays(switch, corrects):
    config, own = replace(MODEL, **switch), sources()
    rng = np.random.default_rng(0)
    draws = draw_windows(
        own, 12, config, Noise(0.02), rng, start_fraction=0.5, rotate=config.mask_pose, steps=3
    )
    resident = Resident(own, config, CPU)
    found = resident.windows(draws, 3, corrects)
    expected = stack_windows(own, draws, config, 3, corrects)
    for name in ('positions', 'targets', 'properties', 'owner', 'angles'):
        ours, theirs = getattr(found, name), getattr(expected, name)
        # a division by dt more or less, in float64
        torch.testing.assert_close(ours, theirs, rtol=1e-12, atol=1e-12)
    for ours, theirs in zip(found.start, expected.start, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-12, atol=1e-12)
    start = found.start.positions, found.start.velocities[0]
    links = resident.connector(draws)(*start)
    for ours, theirs in zip(
        edges(links), edges(connector(own, draws, config)(*start)), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-13)


def test_a_batch_of_one_step_is_that_of_arrays():
    own, config = sources(), replace(MODEL, mask_pose=False)
    draws = draw_windows(own, 9, config, Noise(0.02), np.random.default_rng(1))
    batch = one_step_batch(own, draws, config, True)
    resident = Resident(own, config, CPU)
    windows = resident.windows(draws, 1, True)
    start = windows.start
    links = resident.connector(draws)(start.positions, start.velocities[0])
    graph = tensor_features(config, start, links, windows.properties)
    # float64 rounded to float32, once each
    for ours, theirs in (
        (graph.nodes, batch.graph.nodes),
        (graph.motion, batch.graph.motion),
        (windows.targets[0].float(), batch.next_motion),
    ):
        torch.testing.assert_close(ours, theirs, rtol=2**-22, atol=1e-9)
    order = [torch.from_numpy(np.lexsort((g.receivers, g.senders))) for g in (graph, batch.graph)]
    torch.testing.assert_close(
        graph.edges[order[0]], batch.graph.edges[order[1]], rtol=2**-22, atol=1e-9
    )
    torch.testing.assert_close(
        graph.surface_edges, batch.graph.surface_edges, rtol=2**-22, atol=1e-9
    )
    assert len(graph.edges) > 10


@pytest.mark.parametrize('steps', [1, 3])
def test_training_on_a_device_is_training(steps):
    config = GNSTrainConfig(
        model=replace(MODEL, message_passing_steps=2),
        batch=5,
        closed_loop_steps=steps,
        noise=Noise(0.01, True),
        energy_weight=0.1,
        start_fraction=0.3,
    )
    arrays, device = (GNSLearner(config, sources(), UNITS, resident=r) for r in (False, True))
    assert device.resident is not None
    assert arrays.resident is None
    for _ in range(3):
        # float32 sums over edges in another order, through three steps of Adam
        assert device.advance() == pytest.approx(arrays.advance(), rel=1e-4)


def test_nothing_is_made_away_from_the_data():
    config = GNSTrainConfig(
        model=MODEL, batch=3, closed_loop_steps=2, noise=Noise(0.01, True), energy_weight=0.1
    )
    learner = GNSLearner(config, sources(), UNITS, resident=True)
    expected = learner.loss_at(0)
    with torch.device('meta'):  # what does not say where it belongs lands there, and fails
        assert learner.loss_at(0) == expected


@pytest.mark.skipif(not torch.cuda.is_available(), reason='needs a CUDA device')
def test_training_on_cuda_is_training():
    config = GNSTrainConfig(model=MODEL, batch=5, closed_loop_steps=2)
    arrays = GNSLearner(config, sources(), UNITS)
    device = GNSLearner(config, sources(), UNITS, device=torch.device('cuda'))
    for _ in range(3):
        assert device.advance() == pytest.approx(arrays.advance(), rel=1e-3)  # TF32 is off
    state = device.state()
    assert {value.device.type for value in state.values()} == {'cpu'}
    device.load_state(state)
    assert device.advance() == pytest.approx(arrays.advance(), rel=1e-3)
