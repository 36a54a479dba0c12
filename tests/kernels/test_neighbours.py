# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs of near spheres are those of brute force."""

import numpy as np
import pytest
from rigid_gns_core.kernels.neighbours import find_pairs


def brute(positions, extent, awake):
    distance = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    near = np.triu(distance <= extent[:, None] + extent[None], 1)
    return np.argwhere(near & (awake[:, None] | awake[None]))


@pytest.mark.parametrize('seed', range(4))
def test_pairs_are_those_of_brute_force(seed):
    draw = np.random.default_rng(seed)
    count = (1, 40, 500, 900)[seed]
    positions = draw.uniform(-30, 30, (count, 3))
    # reaches over three decades: several levels of cells, some with few spheres
    extent = draw.choice([0.3, 1.0, 4.0], count) * draw.uniform(0.5, 1.5, count)
    extent[0] = 90.0
    awake = draw.random(count) < 0.8
    first, second = find_pairs(positions, extent, awake)
    found = np.stack([first, second], 1)
    np.testing.assert_array_equal(found, brute(positions, extent, awake))


def test_no_spheres_have_no_pairs():
    first, second = find_pairs(np.empty((0, 3)), np.empty(0), np.empty(0, np.bool_))
    assert len(first) == len(second) == 0


@pytest.mark.parametrize('far', [0.0, 700.0, 1e6])
def test_cells_that_repeat_give_each_pair_once(far):
    # two clusters far apart, and one sphere farther: cells are fewer than the way has room for
    draw = np.random.default_rng(3)
    positions = draw.uniform(-8, 8, (700, 3))
    positions[350:] += far
    positions[-1] = [-3 * far, 2 * far, 40.0]
    extent, awake = draw.uniform(0.5, 0.99, 700), np.ones(700, np.bool_)
    found = np.stack(find_pairs(positions, extent, awake), 1)
    np.testing.assert_array_equal(found, brute(positions, extent, awake))
