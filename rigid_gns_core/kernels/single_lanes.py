# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sixteen single-precision numbers at once, for products of matrices.

A loop over the outputs of a layer loads and stores each sum for each input; sums in registers of
several rows at a time do not. Multiplication and addition are fused, always and by name, so that
all processors compute the same bits.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, register_model
import numpy as np
from numpy.typing import NDArray

from .jit import in_place

Single = NDArray[np.float32]

WIDTH = 16
"""Numbers in a register, of which columns of a matrix are a multiple."""
ROWS = 4
"""Rows that are multiplied at a time, of which their number is a multiple."""

_code: Any = intrinsic
_NUMBERS = ir.VectorType(ir.FloatType(), WIDTH)


class SinglesType(types.Type):
    """Type of sixteen numbers."""


_SINGLES = SinglesType('Singles')


@register_model(SinglesType)
class _SinglesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _NUMBERS)  # type: ignore[no-untyped-call]


def _address(context: Any, builder: Any, kind: Any, array: Any, place: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [place]), _NUMBERS.as_pointer())


@_code  # type: ignore[untyped-decorator]
def _load(typing: Any, array: Any, place: Any) -> Any:
    """Sixteen numbers in a row of a contiguous array."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_address(context, builder, sig.args[0], *args), align=4)

    return _SINGLES(array, types.int64), emit


@_code  # type: ignore[untyped-decorator]
def _store(typing: Any, array: Any, place: Any, value: Any) -> Any:
    """Write sixteen numbers in a row of a contiguous array."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[2], _address(context, builder, sig.args[0], *args[:2]), align=4)
        return context.get_dummy_value()

    return types.void(array, types.int64, _SINGLES), emit


@_code  # type: ignore[untyped-decorator]
def _times_plus(typing: Any, factor: Any, value: Any, total: Any) -> Any:
    """A number times sixteen plus sixteen, rounded once."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        index, none = ir.IntType(32), ir.Constant(_NUMBERS, ir.Undefined)
        one = builder.insert_element(none, args[0], ir.Constant(index, 0))
        zeros = ir.Constant(ir.VectorType(index, WIDTH), [0] * WIDTH)
        factors = builder.shuffle_vector(one, none, zeros)
        name = f'llvm.fma.v{WIDTH}f32'
        kind = ir.FunctionType(_NUMBERS, [_NUMBERS] * 3)
        found = builder.module.globals.get(name)
        return builder.call(found or ir.Function(builder.module, kind, name), [factors, *args[1:]])

    return _SINGLES(types.float32, _SINGLES, _SINGLES), emit


@in_place
def add_product(inputs: Single, matrix: Single, out: Single) -> None:
    """Add the product of two matrices to a third; all are contiguous.

    Args:
        inputs: Shape (r, k or more), r a multiple of `ROWS`; columns from k on are not used.
        matrix: Shape (k, c), c a multiple of `WIDTH`.
        out: Shape (r, c or more).
    """
    depth, columns, stride = len(matrix), matrix.shape[1], out.shape[1]
    for r in range(0, len(inputs), ROWS):
        for column in range(0, columns, WIDTH):
            place = r * stride + column
            first, second = _load(out, place), _load(out, place + stride)
            third, fourth = _load(out, place + 2 * stride), _load(out, place + 3 * stride)
            for i in range(depth):
                weights = _load(matrix, i * columns + column)
                first = _times_plus(inputs[r, i], weights, first)
                second = _times_plus(inputs[r + 1, i], weights, second)
                third = _times_plus(inputs[r + 2, i], weights, third)
                fourth = _times_plus(inputs[r + 3, i], weights, fourth)
            _store(out, place, first)
            _store(out, place + stride, second)
            _store(out, place + 2 * stride, third)
            _store(out, place + 3 * stride, fourth)
