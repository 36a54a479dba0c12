# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0
"""Lanes compute the bits of NumPy, eight at once."""

import math

import numba
import numpy as np
from rigid_gns_core.kernels.lanes import (
    add_to_rows,
    bits,
    choose,
    columns_of,
    gather,
    larger,
    load,
    same,
    skip_lines,
    smaller,
    store,
)
from rigid_gns_core.kernels.vector import cross, dot


@numba.njit(error_model='numpy')
def arithmetic(a, b, out):
    x, y = load(a, 3), load(b, 0)
    results = (
        x + y, x - y, x * y, x / y, -x, math.sqrt(x * x), larger(x, y), smaller(x, y),
        choose((x < y) & ~(x <= 0.0), x, y), choose((x > 1.0) | (y >= 1.0), x, same(7.0)),
        2.0 * x, x * 2.0, 1.0 / x, x - 1.0, dot((x, y, x), (y, y, x)),
        cross((x, y, x), (y, y, x))[1], math.sin(9.0 * x), math.cos(9.0 * x),
    )  # fmt: skip
    for i in range(len(results)):
        store(out, 8 * i, results[i])
    return bits(x < y)


def test_arithmetic_is_that_of_single_numbers():
    rng = np.random.default_rng(0)
    a, b, out = rng.normal(size=11), rng.normal(size=8), np.empty(18 * 8)
    mask = arithmetic(a, b, out)
    x, y = a[3:], b
    expected = [
        x + y, x - y, x * y, x / y, -x, np.sqrt(x * x), np.maximum(x, y), np.minimum(x, y),
        np.where((x < y) & (x > 0), x, y), np.where((x > 1) | (y >= 1), x, 7.0),
        2 * x, 2 * x, 1 / x, x - 1, x * y + y * y + x * x, x * y - x * x,
        [math.sin(9.0 * one) for one in x], [math.cos(9.0 * one) for one in x],
    ]  # fmt: skip
    np.testing.assert_array_equal(out.reshape(18, 8), expected)
    assert mask == sum(1 << lane for lane in range(8) if x[lane] < y[lane])


@numba.njit(error_model='numpy')
def rows(array, half, indices, place, out, sums):
    columns = columns_of(array, half, indices, place)
    for i in range(4):
        store(out, 8 * i, columns[i])
    store(out, 32, gather(array, indices, place))
    add_to_rows(sums, half, indices, place, columns)


def test_columns_are_those_of_the_rows_that_indices_name():
    rng = np.random.default_rng(1)
    array, indices = rng.normal(size=(9, 8)), rng.integers(0, 9, 12)
    indices[5] = indices[6]  # twice the same row
    for half in (0, 4):
        out, sums = np.empty(40), np.zeros((9, 8))
        rows(array.ravel(), half, indices, 4, out, sums.reshape(-1))
        named = array[indices[4:], half : half + 4]
        np.testing.assert_array_equal(out[:32].reshape(4, 8), named.T)
        np.testing.assert_array_equal(out[32:], array.ravel()[indices[4:]])
        expected = np.zeros((9, 8))
        np.add.at(expected[:, half : half + 4], indices[4:], named)
        np.testing.assert_array_equal(sums, expected)


@numba.njit(error_model='numpy')
def skipped(array):
    return skip_lines(array)


def test_registers_are_aligned_after_what_is_skipped():
    for shift in range(8):
        array = np.empty(64)[shift:]
        first = array[skipped(array) :]
        assert first.ctypes.data % 64 == 0 and len(array) - len(first) < 8
