# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs of near spheres are those of brute force."""

import numpy as np
import pytest
from rigid_gns_core.kernels.neighbours import find_pairs


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
    distance = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    near = np.triu(distance <= extent[:, None] + extent[None], 1)
    near &= awake[:, None] | awake[None]
    np.testing.assert_array_equal(np.stack([first, second], 1), np.argwhere(near))
