# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Rotations turned eight at once: the bits of one at a time."""

import numba
import numpy as np
import pytest
from rigid_gns_core.kernels.quaternions import turn, turn_all
from rigid_gns_core.kernels.vector import row


@numba.njit(error_model='numpy')
def one_by_one(quaternions, spins, time):
    for i in range(len(quaternions)):
        turn(quaternions, i, row(spins, i), time)


@numba.njit(error_model='numpy')
def all_at_once(quaternions, spins, time):
    turn_all(quaternions, spins, time, np.empty(8 * len(quaternions)))


@pytest.mark.parametrize('count', [0, 1, 8, 21])
def test_eight_at_once_turn_to_the_bits_of_one(count):
    rng = np.random.default_rng(count)
    quaternions = rng.normal(size=(count, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    spins = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-12, 3, (count, 1))
    spins[::3] = 0.0  # what does not spin keeps its bits, also where its length is not quite 1
    spins[count // 2 : count // 2 + 1] = np.nan
    one, many = quaternions.copy(), quaternions.copy()
    one_by_one(one, spins, 0.0125)
    all_at_once(many, spins, 0.0125)
    np.testing.assert_array_equal(one, many)
    if count > 1:
        np.testing.assert_array_equal(many[0], quaternions[0])
