# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the thesis' network guarantees for any weights, and what each switch does."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.motion import Motion
from rigid_gns_core.gns.network import GNBlock, GNS
from rigid_gns_core.scenes.scene import Plane, Scene
import torch

from .random_motion import features, random_motion

SCENE = Scene(surfaces=Plane.box(12.0, 12.0))
CONFIG = GNSConfig(message_passing_steps=2, width=16)


def network(config=CONFIG, seed=0):
    torch.manual_seed(seed)
    return GNS(config).eval()


def output(net, moving, scene=SCENE):
    with torch.no_grad():
        return net(features(net.config, scene, moving)).numpy()


def permuted(moving, order):
    return Motion(
        moving.positions[order],
        moving.quaternions[order],
        moving.velocities[:, order],
        moving.angular_velocities[:, order],
    )


def shifted(moving, by):
    return moving._replace(positions=moving.positions + torch.from_numpy(by))


def test_shapes_of_the_thesis():
    graph = features(GNSConfig(), SCENE, random_motion(0))
    assert graph.nodes.shape == (20, 18)  # v and omega at k, k - 1, k - 2
    assert graph.edges.shape[1] == 4
    assert graph.surface_edges.shape[1] == 10
    assert len(graph.edges) > 0
    # 0.9 million parameters: 3 encoders, 5 blocks of 3 MLPs with their own weights, a decoder
    assert sum(p.numel() for p in GNS(GNSConfig()).parameters()) == 894_342


def relu_mlp(mlp, *parts):
    """Linear, ReLU, linear on the parts in a row, in float64."""
    first, bias, last, last_bias = (
        w.detach().double().numpy()
        for w in (torch.cat(list(mlp.weights), 1), mlp.bias, mlp.last.weight, mlp.last.bias)
    )
    return last @ np.maximum(first @ np.concatenate(parts) + bias, 0.0) + last_bias


@pytest.mark.parametrize('third_law', [True, False])
@pytest.mark.parametrize('target', ['velocity', 'acceleration'])
def test_the_network_follows_the_equations_edge_by_edge(third_law, target):
    net = network(replace(CONFIG, third_law=third_law, target=target))
    for normaliser in (net.node_normaliser, net.edge_normaliser, net.surface_normaliser):
        normaliser.fit(torch.randn_like(normaliser.mean), torch.rand_like(normaliser.mean) + 0.5)
    net.target_normaliser.fit(torch.arange(6.0), torch.arange(1.0, 7.0))
    graph = features(net.config, SCENE, random_motion(11))
    with torch.no_grad():
        found = net.decode(net(graph), graph.motion).numpy()

    def encoded(encoder, normaliser, rows):
        mean, scale = normaliser.mean.double().numpy(), normaliser.scale.double().numpy()
        return [relu_mlp(encoder, (row - mean) / scale) for row in rows.double().numpy()]

    v = encoded(net.node_encoder, net.node_normaliser, graph.nodes)
    e = encoded(net.edge_encoder, net.edge_normaliser, graph.edges)
    e_s = encoded(net.surface_encoder, net.surface_normaliser, graph.surface_edges)
    edge_of = {
        pair: k
        for k, pair in enumerate(
            zip(graph.receivers.tolist(), graph.senders.tolist(), strict=True)
        )
    }
    assert len(edge_of) == len(e) > 10
    for block in net.blocks:
        raw = {(i, j): relu_mlp(block.particle_message, v[i], v[j], e[k])
               for (i, j), k in edge_of.items()}  # fmt: skip
        m = {(i, j): (raw[i, j] - raw[j, i]) / 2 if third_law else raw[i, j] for i, j in raw}
        received = [np.zeros(16) for _ in v]
        for (i, j), k in edge_of.items():
            received[i] = received[i] + m[i, j]
            e[k] = e[k] + m[i, j]
        for k, i in enumerate(graph.surface_receivers.tolist()):
            received[i] = received[i] + relu_mlp(block.surface_message, v[i], e_s[k])
        v = [
            x + relu_mlp(block.node_update, x, total) for x, total in zip(v, received, strict=True)
        ]
    expected = np.array([relu_mlp(net.decoder, x) for x in v]) * np.arange(1, 7) + np.arange(6)
    if target == 'acceleration':
        expected += graph.motion.numpy()
    # float32: some 50 roundings of 6e-8 of values up to 10 in a row
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=3e-5)


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
    motions = [random_motion(s, count) for s, count in ((4, 7), (5, 13), (6, 1))]
    with torch.no_grad():
        together = net(features(CONFIG, SCENE, *motions))
        alone = torch.cat([net(features(CONFIG, SCENE, motion)) for motion in motions])
    torch.testing.assert_close(together, alone, rtol=0, atol=5e-6)


def test_messages_obey_newtons_third_law():
    torch.manual_seed(0)
    graph = features(CONFIG, SCENE, random_motion(7))
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
    graph = features(CONFIG, SCENE, random_motion(8))
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
    positions = torch.tensor([[0.0, 0, 50.0], [5.0, 0, 50.0]], dtype=torch.float64)
    far = positions + torch.tensor([[0, 0, 0], [400.0, 0, 0]])
    scene = Scene(surfaces=())
    slow = moving._replace(velocities=moving.velocities * 0.1)
    first = output(net, slow._replace(positions=positions), scene)
    second = output(net, slow._replace(positions=far), scene)
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
