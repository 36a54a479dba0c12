# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Features follow the thesis sphere by sphere, with the slopes of finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.features import features_of, GraphBatch
from rigid_gns_core.gns.graph import build_graph
from rigid_gns_core.gns.motion import joined
from rigid_gns_core.gns.rotations import rotation_between
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import rotation_between as rotation_between_arrays
import torch

from .random_motion import random_motion

DT = 0.1
CPU = torch.device('cpu')
SCENE = Scene(surfaces=Plane.box(12.0, 12.0))
MODEL = GNSConfig(message_passing_steps=2, width=16)
SWITCHES = [
    {},
    {'history': 0},
    {'mask_pose': False},
    {'sphere_properties': True},
    {'ground_edge': False},
    {'target': 'acceleration'},
    {'connectivity': 'epsilon'},
    {'connectivity': 'vmax'},
    {'connectivity': 'swept'},
]


def expected_features(config, motion, scene):
    """Rows as the thesis writes them (3.2.2, 3.2.3), one after another, in float64."""
    p, q, v, w = (values.numpy() for values in motion)
    count = len(p)
    graph = build_graph(p, v[0], scene, DT, config.reach())
    nodes, edges, surface_edges = [], [], []
    for i in range(count):
        row = [*v[:, i].ravel(), *w[:, i].ravel()]
        if not config.mask_pose:
            row += [*p[i], *q[i]]
        if config.sphere_properties:
            row += [scene.per_sphere(name, count)[i] for name in ('radius', 'mass')]
        nodes.append(row)
    for i, j in zip(graph.receivers, graph.senders, strict=True):
        edges.append([*(p[i] - p[j]), np.sqrt(np.sum((p[i] - p[j]) ** 2))])
    for i, s in zip(graph.surface_receivers, graph.surface_senders, strict=True):
        normal = np.asarray(scene.surfaces[s].normal)
        height = (p[i] - scene.surfaces[s].point) @ normal
        surface_edges.append([*v[0, i], *normal, *(height * normal), abs(height)])
    rows = {
        'nodes': nodes,
        'edges': edges,
        'surface_edges': surface_edges,
        'motion': [[*v[0, i], *w[0, i]] for i in range(count)],
    }
    return rows, graph


@pytest.mark.parametrize('switch', SWITCHES, ids=str)
def test_features_of_a_batch_of_scenes_follow_the_thesis(switch):
    config = replace(MODEL, **switch)
    scenes = [replace(SCENE, mass=2.0), Scene(surfaces=()), SCENE]
    counts = [40, 3, 9]
    motions = [random_motion(s, n, config.history) for s, n in enumerate(counts)]
    batch = GraphBatch(scenes, counts, config, DT, CPU)
    found = batch.features(joined(motions))
    assert batch.owner.tolist() == [0] * 40 + [1] * 3 + [2] * 9
    expected, graphs = zip(
        *(expected_features(config, m, s) for m, s in zip(motions, scenes, strict=True)),
        strict=True,
    )
    assert len(found.edges) > 20 and len(found.surface_edges) > 10
    for name in ('nodes', 'edges', 'surface_edges', 'motion'):
        rows = np.array([row for each in expected for row in each[name]])
        assert getattr(found, name).dtype == torch.float32
        # one rounding to float32 each, of float64 values that may differ in their last bits
        np.testing.assert_allclose(getattr(found, name).numpy(), rows, rtol=2**-23, atol=1e-12)
    edges = np.cumsum([0] + [len(graph.senders) for graph in graphs])
    spheres = np.cumsum([0, *counts])
    for name, offsets in (
        ('senders', spheres),
        ('receivers', spheres),
        ('surface_receivers', spheres),
        ('reverse', edges),
    ):
        parts = [getattr(g, name) + o for g, o in zip(graphs, offsets[:-1], strict=True)]
        np.testing.assert_array_equal(getattr(found, name).numpy(), np.concatenate(parts))


def test_gradients_of_features_are_those_of_finite_differences():
    config = replace(MODEL, mask_pose=False)
    motion = random_motion(3, count=8)
    edges = GraphBatch([SCENE], [8], config, DT, CPU).connect(motion)
    rng = np.random.default_rng(0)
    weights = None

    def value(by):
        shifted = motion._replace(
            positions=motion.positions + by[:, :3], velocities=motion.velocities + by[:, 3:6]
        ).advanced(by, DT)
        found = features_of(config, shifted, edges, torch.ones(8, 2))
        nonlocal weights
        parts = [found.nodes.double(), found.edges.double(), found.surface_edges.double()]
        if weights is None:
            weights = [torch.from_numpy(rng.normal(size=part.shape)) for part in parts]
        return sum((part * weight).sum() for part, weight in zip(parts, weights, strict=True))

    by = torch.zeros(8, 6, dtype=torch.float64, requires_grad=True)
    value(by).backward()
    direction = torch.from_numpy(rng.normal(size=(8, 6)))
    step = 1e-2
    with torch.no_grad():
        slope = (value(step * direction) - value(-step * direction)) / (2 * step)
    # float32 of values up to 15 gives 1e-6 each; over 2e-2 and some hundred of them, about 1e-3;
    # the curvature of norms and quaternions adds step^2 = 1e-4 of the whole
    exact = (by.grad * direction).sum()
    assert float(slope) == pytest.approx(float(exact), rel=2e-3, abs=1e-2)


def test_rotation_between_is_that_of_arrays_and_has_a_gradient_at_rest():
    before, after = random_motion(0).quaternions, random_motion(1).quaternions
    found = rotation_between(before, after)
    # float64: a few roundings of angles up to pi
    np.testing.assert_allclose(
        found.numpy(), rotation_between_arrays(before.numpy(), after.numpy()), atol=1e-13
    )
    same = before.clone().requires_grad_()
    rotation_between(before, same).sum().backward()
    assert torch.isfinite(same.grad).all()
