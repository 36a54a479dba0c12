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

"""What the thesis' network guarantees for any weights, and what each switch does."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.features import Motion
from rigid_gns_core.gns.graph import build_graph
from rigid_gns_core.gns.network import GNBlock, GNS, graph_input, side_by_side
from rigid_gns_core.scenes.scene import Plane, Scene
import torch

from .random_motion import random_motion

SCENE = Scene(surfaces=Plane.box(12.0, 12.0))
CONFIG = GNSConfig(message_passing_steps=2, width=16)


def network(config=CONFIG, seed=0):
    torch.manual_seed(seed)
    return GNS(config).eval()


def output(net, moving, scene=SCENE):
    with torch.no_grad():
        return net(graph_input(net.config, moving, scene, 0.1)).numpy()


def permuted(moving, order):
    return Motion(
        moving.positions[order],
        moving.quaternions[order],
        moving.velocities[:, order],
        moving.angular_velocities[:, order],
    )


def shifted(moving, by):
    return replace(moving, positions=moving.positions + by)


def test_shapes_of_the_thesis():
    graph = graph_input(GNSConfig(), random_motion(0), SCENE, 0.1)
    assert graph.nodes.shape == (20, 18)  # v and omega at k, k - 1, k - 2
    assert graph.edges.shape[1] == 4
    assert graph.surface_edges.shape[1] == 10
    assert len(graph.edges) > 0
    # 0.9 million parameters: 3 encoders, 5 blocks of 3 MLPs with their own weights, a decoder
    assert sum(p.numel() for p in GNS(GNSConfig()).parameters()) == 894_342


def test_surface_features_follow_the_thesis():
    moving = random_motion(1)
    graph = build_graph(moving.positions, moving.velocities[0], SCENE, 0.1, CONFIG.reach())
    features = graph_input(CONFIG, moving, SCENE, 0.1, graph).surface_edges.numpy()
    for row, sphere, surface in zip(
        features, graph.surface_receivers, graph.surface_senders, strict=True
    ):
        plane = SCENE.surfaces[surface]
        normal = np.asarray(plane.normal)
        height = (moving.positions[sphere] - plane.point) @ normal
        expected = [*moving.velocities[0, sphere], *normal, *(height * normal), abs(height)]
        np.testing.assert_allclose(row, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize('third_law', [True, False])
def test_permutation_equivariant(third_law):
    net = network(replace(CONFIG, third_law=third_law))
    moving = random_motion(2)
    order = np.random.default_rng(0).permutation(20)
    # float32 sums in another order: a few units of the last place of values near 1
    np.testing.assert_allclose(
        output(net, permuted(moving, order)), output(net, moving)[order], atol=5e-6
    )


def test_translation_invariant_unless_the_pose_is_shown():
    by = np.array([100.0, -50.0, 30.0])
    scene = replace(
        SCENE,
        surfaces=tuple(
            replace(plane, point=tuple(np.asarray(plane.point) + by)) for plane in SCENE.surfaces
        ),
    )
    moving = random_motion(3)
    net = network()
    # features are differences taken in float64, then rounded
    np.testing.assert_allclose(
        output(net, shifted(moving, by), scene), output(net, moving), atol=5e-6
    )
    seeing = network(replace(CONFIG, mask_pose=False))
    difference = output(seeing, shifted(moving, by), scene) - output(seeing, moving)
    assert np.abs(difference).max() > 0.1


def test_batch_equals_single():
    net = network()
    graphs = [
        graph_input(CONFIG, random_motion(s, count), SCENE, 0.1)
        for s, count in ((4, 7), (5, 13), (6, 1))
    ]
    with torch.no_grad():
        together = net(side_by_side(graphs))
        alone = torch.cat([net(graph) for graph in graphs])
    torch.testing.assert_close(together, alone, rtol=0, atol=5e-6)


def test_messages_obey_newtons_third_law():
    torch.manual_seed(0)
    graph = graph_input(CONFIG, random_motion(7), SCENE, 0.1)
    nodes, edges = torch.randn(20, 16), torch.randn(len(graph.edges), 16)
    for third_law in (True, False):
        block = GNBlock(16, third_law)
        with torch.no_grad():
            _, after = block(nodes, edges, torch.zeros(0, 16), graph)
        message = after - edges
        total = (message + message[graph.reverse]).abs().max()
        # after - edges rounds once more, hence not exactly zero
        assert (total < 1e-5) == third_law


def test_particle_edges_change_in_every_block_and_surface_edges_do_not_reach_them():
    net = network()
    graph = graph_input(CONFIG, random_motion(8), SCENE, 0.1)
    nodes = net.node_encoder(graph.nodes)
    edges = net.edge_encoder(graph.edges)
    surface = net.surface_encoder(graph.surface_edges)
    for block in net.blocks:
        nodes, after = block(nodes, edges, surface, graph)
        assert (after - edges).abs().max() > 1e-4
        edges = after


def test_far_spheres_do_not_interact():
    net = network(replace(CONFIG, ground_edge=False))
    moving = random_motion(9, count=2)
    positions = np.array([[0.0, 0, 50.0], [5.0, 0, 50.0]])
    far = positions + [[0, 0, 0], [400.0, 0, 0]]
    scene = Scene(surfaces=())
    slow = replace(moving, velocities=moving.velocities * 0.1)
    first = output(net, replace(slow, positions=positions), scene)
    second = output(net, replace(slow, positions=far), scene)
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize('target', ['velocity', 'acceleration'])
def test_decode_is_the_inverse_of_encode_target(target):
    net = network(replace(CONFIG, target=target))
    net.target_normaliser.fit(torch.arange(6.0), torch.arange(1.0, 7.0))
    motion_now, following = torch.randn(9, 6), torch.randn(9, 6)
    back = net.decode(net.encode_target(following, motion_now), motion_now)
    torch.testing.assert_close(back, following, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('history', 0),
        ('ground_edge', False),
        ('sphere_properties', True),
        ('connectivity', 'swept'),
        ('connectivity', 'epsilon'),
        ('connectivity', 'vmax'),
        ('message_passing_steps', 1),
    ],
)
def test_every_switch_builds_and_runs(name, value):
    config = replace(CONFIG, **{name: value})
    result = output(network(config), random_motion(10, history=config.history))
    assert result.shape == (20, 6)
    assert np.isfinite(result).all()


def test_empty_scene_and_single_sphere():
    net = network()
    assert output(net, random_motion(0, count=0)).shape == (0, 6)
    assert output(net, random_motion(0, count=1), Scene(surfaces=())).shape == (1, 6)


@pytest.mark.parametrize(
    ('name', 'value'), [('message_passing_steps', 0), ('history', -1), ('width', 0)]
)
def test_sizes_out_of_range_are_named(name, value):
    with pytest.raises(ValueError, match=name):
        GNSConfig(**{name: value})
