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

"""Features with gradients: those of prediction, with the slopes of finite differences."""

from dataclasses import replace

import numpy as np
import pytest
from rigid_gns_core.gns.config import GNSConfig
from rigid_gns_core.gns.features import features_of
from rigid_gns_core.gns.graph import build_graph
from rigid_gns_core.gns.rotations import rotation_between
from rigid_gns_core.gns.tensor_features import tensor_features, TensorGraph, TensorMotion
from rigid_gns_core.scenes.scene import Plane, Scene
from rigid_gns_core.scenes.state import rotation_between as rotation_between_arrays
import torch

from .random_motion import random_motion

DT = 0.1
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


@pytest.mark.parametrize('switch', SWITCHES, ids=str)
def test_features_with_gradients_are_those_of_prediction(switch):
    config = replace(MODEL, **switch)
    scenes = [replace(SCENE, mass=2.0), Scene(surfaces=()), SCENE]
    motions = [random_motion(s, count, config.history) for s, count in ((0, 40), (1, 3), (2, 9))]
    graphs = [
        build_graph(m.positions, m.velocities[0], s, DT, config.reach())
        for m, s in zip(motions, scenes, strict=True)
    ]
    expected = [features_of(config, m, s, DT) for m, s in zip(motions, scenes, strict=True)]
    counts = [len(motion.positions) for motion in motions]
    properties = np.concatenate(
        [
            np.stack([s.per_sphere(p, n) for p in ('radius', 'mass')], 1)
            for s, n in zip(scenes, counts, strict=True)
        ]
    )
    found = tensor_features(
        config,
        TensorMotion.of(motions),
        TensorGraph.of(graphs, scenes, counts),
        torch.from_numpy(properties),
    )
    assert len(found.edges) > 20
    for name in ('nodes', 'edges', 'surface_edges', 'motion'):
        array = np.concatenate([getattr(features, name) for features in expected])
        # one rounding to float32 each, of float64 values that may differ in their last bits
        np.testing.assert_allclose(getattr(found, name).numpy(), array, rtol=2**-23, atol=1e-12)
    edges = np.cumsum([0] + [len(features.edges) for features in expected])
    spheres = np.cumsum([0, *counts])
    for name, offsets in (
        ('senders', spheres),
        ('receivers', spheres),
        ('surface_receivers', spheres),
        ('reverse', edges),
    ):
        parts = [getattr(f, name) + o for f, o in zip(expected, offsets[:-1], strict=True)]
        np.testing.assert_array_equal(getattr(found, name).numpy(), np.concatenate(parts))


def test_gradients_of_features_are_those_of_finite_differences():
    config = replace(MODEL, mask_pose=False)
    motion = random_motion(3, count=8)
    graph = build_graph(motion.positions, motion.velocities[0], SCENE, DT, config.reach())
    links = TensorGraph.of([graph], [SCENE], [8])
    rng = np.random.default_rng(0)
    weights = None

    def value(by):
        start = TensorMotion.of([motion])
        shifted = start._replace(
            positions=start.positions + by[:, :3], velocities=start.velocities + by[:, 3:6]
        ).advanced(by, DT)
        found = tensor_features(config, shifted, links, torch.ones(8, 2))
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
    found = rotation_between(torch.from_numpy(before), torch.from_numpy(after))
    # float64: a few roundings of angles up to pi
    np.testing.assert_allclose(found.numpy(), rotation_between_arrays(before, after), atol=1e-13)
    same = torch.from_numpy(before).requires_grad_()
    rotation_between(torch.from_numpy(before), same).sum().backward()
    assert torch.isfinite(same.grad).all()
