# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Products of matrices in single precision, four rows of sixteen numbers at a time."""

import numba
import numpy as np
from rigid_gns_core.kernels.single_lanes import add_product


@numba.njit(error_model='numpy')
def product(inputs, matrix, out):
    add_product(inputs, matrix, out)


def test_a_product_is_added_within_rounding_and_further_columns_are_left_alone():
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(8, 23)).astype(np.float32)
    matrix = rng.normal(size=(20, 32)).astype(np.float32)
    out = rng.normal(size=(8, 35)).astype(np.float32)
    expected = out[:, :32] + inputs[:, :20].astype(float) @ matrix.astype(float)
    beyond, alone = out[:, 32:].copy(), out[4:].copy()
    product(inputs, matrix, out)
    # 20 sums of numbers of about one, each rounded to 2^-24 of at most ten
    np.testing.assert_allclose(out[:, :32], expected, atol=20 * 10 * 2**-24)
    np.testing.assert_array_equal(out[:, 32:], beyond)
    product(inputs[4:], matrix, alone)
    np.testing.assert_array_equal(alone, out[4:])
