# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Eight numbers at once: a type of Numba that is one vector register, or several short ones.

LLVM does not vectorise loops that gather rows by index. So lanes are a type of their own, with
arithmetic, comparison and choice; all else is built of these. No multiplication and addition is
fused, so that processors with and without wide registers compute the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import operator
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

WIDTH = 8
"""Numbers in a register."""

Lanes = Any
"""Annotation of eight numbers."""
Mask = Any
"""Annotation of eight truth values."""

_code: Any = intrinsic  # mypy takes the first argument, Numba's own, for one of the call
_NUMBER, _INDEX, _SHUFFLE = ir.DoubleType(), ir.IntType(64), ir.IntType(32)
_NUMBERS, _FLAGS = ir.VectorType(_NUMBER, WIDTH), ir.VectorType(ir.IntType(1), WIDTH)
_ROW = ir.VectorType(_NUMBER, 4)


class LanesType(types.Type):
    """Type of eight numbers."""


class MaskType(types.Type):
    """Type of eight truth values."""


LANES, MASK = LanesType('Lanes'), MaskType('Mask')


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _NUMBERS)  # type: ignore[no-untyped-call]


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _FLAGS)  # type: ignore[no-untyped-call]


def _same(builder: Any, value: Any) -> Any:
    """Eight times the same number."""
    one = builder.insert_element(
        ir.Constant(_NUMBERS, ir.Undefined), value, ir.Constant(_SHUFFLE, 0)
    )
    zeros = ir.Constant(ir.VectorType(_SHUFFLE, WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(_NUMBERS, ir.Undefined), zeros)


def _define(function: Any, emit: Callable[..., Any], result: Any) -> None:
    """Let an operator take lanes, or lanes and a number."""
    pairs = ((LANES, LANES), (LANES, types.float64), (types.float64, LANES))

    class _Template(ConcreteTemplate):
        cases = [signature(result, *pair) for pair in pairs]  # noqa: RUF012

    infer_global(function)(_Template)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        wide = [
            value if kind == LANES else _same(builder, value)
            for kind, value in zip(sig.args, args, strict=True)
        ]
        return emit(builder, *wide)

    for pair in pairs:
        lower_builtin(function, *pair)(lower)


def _define_own(function: Any, emit: Callable[..., Any], kind: Any, count: int) -> None:
    """Let an operator take arguments of one kind, and give that kind."""

    class _Template(ConcreteTemplate):
        cases = [signature(kind, *[kind] * count)]  # noqa: RUF012

    infer_global(function)(_Template)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return emit(builder, *args)

    lower_builtin(function, *[kind] * count)(lower)


def _root(builder: Any, value: Any) -> Any:
    name = f'llvm.sqrt.v{WIDTH}f64'
    found = builder.module.globals.get(name)
    function = found or ir.Function(builder.module, ir.FunctionType(_NUMBERS, [_NUMBERS]), name)
    return builder.call(function, [value])


_define(operator.add, lambda b, x, y: b.fadd(x, y), LANES)
_define(operator.sub, lambda b, x, y: b.fsub(x, y), LANES)
_define(operator.mul, lambda b, x, y: b.fmul(x, y), LANES)
_define(operator.truediv, lambda b, x, y: b.fdiv(x, y), LANES)
_define(operator.lt, lambda b, x, y: b.fcmp_ordered('<', x, y), MASK)
_define(operator.le, lambda b, x, y: b.fcmp_ordered('<=', x, y), MASK)
_define(operator.gt, lambda b, x, y: b.fcmp_ordered('>', x, y), MASK)
_define(operator.ge, lambda b, x, y: b.fcmp_ordered('>=', x, y), MASK)
_define_own(operator.neg, lambda b, x: b.fsub(ir.Constant(_NUMBERS, [-0.0] * WIDTH), x), LANES, 1)
_define_own(math.sqrt, _root, LANES, 1)
_define_own(operator.and_, lambda b, x, y: b.and_(x, y), MASK, 2)
_define_own(operator.or_, lambda b, x, y: b.or_(x, y), MASK, 2)
_define_own(operator.invert, lambda b, x: b.not_(x), MASK, 1)


def _define_by_lane(function: Any) -> None:
    """Let a function of one number take lanes, each by the function itself: the same bits."""

    class _Template(ConcreteTemplate):
        cases = [signature(LANES, LANES)]  # noqa: RUF012

    infer_global(function)(_Template)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        own = signature(types.float64, types.float64)
        call, value = context.get_function(function, own), ir.Constant(_NUMBERS, ir.Undefined)
        for lane in range(WIDTH):
            one = builder.extract_element(args[0], ir.Constant(_SHUFFLE, lane))
            found = call(builder, (one,))
            value = builder.insert_element(value, found, ir.Constant(_SHUFFLE, lane))
        return value

    lower_builtin(function, LANES)(lower)


_define_by_lane(math.sin)
_define_by_lane(math.cos)
_define_by_lane(math.exp)


def _address(context: Any, builder: Any, kind: Any, array: Any, place: Any) -> Any:
    """Pointer to a number of a contiguous array."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.gep(data, [place])


@_code  # type: ignore[untyped-decorator]
def same(typing: Any, value: Any) -> Any:
    """Eight times the same number."""
    return LANES(types.float64), lambda context, builder, sig, args: _same(builder, args[0])


@_code  # type: ignore[untyped-decorator]
def load(typing: Any, array: Any, place: Any) -> Any:
    """Eight numbers in a row of a contiguous array of one axis."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        address = _address(context, builder, sig.args[0], *args)
        return builder.load(builder.bitcast(address, _NUMBERS.as_pointer()), align=8)

    return LANES(array, types.int64), emit


@_code  # type: ignore[untyped-decorator]
def store(typing: Any, array: Any, place: Any, value: Any) -> Any:
    """Write eight numbers in a row of a contiguous array of one axis."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        address = _address(context, builder, sig.args[0], *args[:2])
        builder.store(args[2], builder.bitcast(address, _NUMBERS.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, LANES), emit


def _widen(builder: Any, wide: bool, kinds: Any, values: Any) -> list[Any]:
    """Values as lanes, if they are to be."""
    return [
        _same(builder, value) if wide and kind == types.float64 else value
        for kind, value in zip(kinds, values, strict=True)
    ]


@_code  # type: ignore[untyped-decorator]
def choose(typing: Any, mask: Any, yes: Any, no: Any) -> Any:
    """Of each lane `yes` where the mask holds, else `no`; of numbers likewise."""
    wide = mask == MASK

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(args[0], *_widen(builder, wide, sig.args[1:], args[1:]))

    kinds = [LANES if wide and kind == LANES else types.float64 for kind in (yes, no)]
    return (LANES if wide else types.float64)(MASK if wide else types.boolean, *kinds), emit


def _extreme(a: Any, b: Any, comparison: str) -> Any:
    """Signature and code of the larger or smaller one of numbers or lanes."""
    wide = LANES in (a, b)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        values = _widen(builder, wide, sig.args, args)
        return builder.select(builder.fcmp_ordered(comparison, *values), *values)

    kinds = [LANES if kind == LANES else types.float64 for kind in (a, b)]
    return (LANES if wide else types.float64)(*kinds), emit


@_code  # type: ignore[untyped-decorator]
def larger(typing: Any, a: Any, b: Any) -> Any:
    """The larger number of each lane, or of two numbers; the second where they are equal."""
    return _extreme(a, b, '>')


@_code  # type: ignore[untyped-decorator]
def smaller(typing: Any, a: Any, b: Any) -> Any:
    """The smaller number of each lane, or of two numbers; the second where they are equal."""
    return _extreme(a, b, '<')


@_code  # type: ignore[untyped-decorator]
def bits(typing: Any, mask: Any) -> Any:
    """The mask as a number, lane l in bit l."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.zext(builder.bitcast(args[0], ir.IntType(WIDTH)), _INDEX)

    return types.int64(MASK), emit


@_code  # type: ignore[untyped-decorator]
def lowest_bit(typing: Any, mask: Any) -> Any:
    """Place of the lowest bit of a number that is not 0."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.int64), emit


def _index(context: Any, builder: Any, kind: Any, array: Any, place: Any, lane: int) -> Any:
    """Index that a lane has in a contiguous array of them."""
    there = builder.add(place, ir.Constant(_INDEX, lane))
    return builder.load(_address(context, builder, kind, array, there))


def _half_row(context: Any, builder: Any, kind: Any, array: Any, index: Any, half: Any) -> Any:
    """Pointer to four numbers of a row of eight."""
    place = builder.add(builder.mul(index, ir.Constant(_INDEX, WIDTH)), half)
    address = _address(context, builder, kind, array, place)
    return builder.bitcast(address, _ROW.as_pointer())


def _shuffle(builder: Any, a: Any, b: Any, order: list[int]) -> Any:
    mask = ir.Constant(ir.VectorType(_SHUFFLE, len(order)), order)
    return builder.shuffle_vector(a, b, mask)


# of two registers, both in halves: first and third of each, second and fourth; pairs of them
_EVEN, _ODD = [0, 8, 2, 10, 4, 12, 6, 14], [1, 9, 3, 11, 5, 13, 7, 15]
_FIRST, _SECOND = [0, 1, 8, 9, 4, 5, 12, 13], [2, 3, 10, 11, 6, 7, 14, 15]


@_code  # type: ignore[untyped-decorator]
def columns_of(typing: Any, array: Any, half: Any, indices: Any, place: Any) -> Any:
    """Four lanes: columns of the rows that eight indices name.

    Args:
        array: Rows of eight numbers, contiguous, shape (8 n,).
        half: First column, 0 or 4.
        indices: Of rows, contiguous, shape (m,).
        place: Of the first of eight indices.
    """

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        rows = []
        for lane in range(WIDTH):
            index = _index(context, builder, sig.args[2], args[2], args[3], lane)
            address = _half_row(context, builder, sig.args[0], args[0], index, args[1])
            rows.append(builder.load(address, align=8))
        wide = [_shuffle(builder, rows[i], rows[i + 4], list(range(WIDTH))) for i in range(4)]
        columns: list[Any] = [None] * 4
        for odd, order in enumerate((_EVEN, _ODD)):
            low = _shuffle(builder, wide[0], wide[1], order)
            high = _shuffle(builder, wide[2], wide[3], order)
            columns[odd] = _shuffle(builder, low, high, _FIRST)
            columns[odd + 2] = _shuffle(builder, low, high, _SECOND)
        return context.make_tuple(builder, sig.return_type, columns)

    return types.UniTuple(LANES, 4)(array, types.int64, indices, types.int64), emit


@_code  # type: ignore[untyped-decorator]
def add_to_rows(typing: Any, array: Any, half: Any, indices: Any, place: Any, columns: Any) -> Any:
    """Add four lanes, as columns, to the rows that eight indices name, one after the other.

    Arguments are as of `columns_of`.
    """

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        x, y, z, w = cgutils.unpack_tuple(builder, args[4], 4)
        low = _shuffle(builder, x, z, _FIRST), _shuffle(builder, y, w, _FIRST)
        high = _shuffle(builder, x, z, _SECOND), _shuffle(builder, y, w, _SECOND)
        pairs = []  # rows 0 and 4, 1 and 5, 2 and 6, 3 and 7
        for one, other in (low, high):
            for order in (_EVEN, _ODD):
                pairs.append(_shuffle(builder, one, other, order))
        for lane in range(WIDTH):
            own = range(4) if lane < 4 else range(4, WIDTH)
            pair = pairs[lane % 4]
            step = _shuffle(builder, pair, pair, list(own))
            index = _index(context, builder, sig.args[2], args[2], args[3], lane)
            address = _half_row(context, builder, sig.args[0], args[0], index, args[1])
            old = builder.load(address, align=8)
            builder.store(builder.fadd(old, step), address, align=8)
        return context.get_dummy_value()

    columns = types.UniTuple(LANES, 4)
    return types.void(array, types.int64, indices, types.int64, columns), emit


@_code  # type: ignore[untyped-decorator]
def gather(typing: Any, array: Any, indices: Any, place: Any) -> Any:
    """The numbers of an array that eight indices name."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value = ir.Constant(_NUMBERS, ir.Undefined)
        for lane in range(WIDTH):
            index = _index(context, builder, sig.args[1], args[1], args[2], lane)
            one = builder.load(_address(context, builder, sig.args[0], args[0], index))
            value = builder.insert_element(value, one, ir.Constant(_SHUFFLE, lane))
        return value

    return LANES(array, indices, types.int64), emit


@_code  # type: ignore[untyped-decorator]
def skip_lines(typing: Any, array: Any) -> Any:
    """Numbers to skip in an array, so that no eight cross a line of the cache."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        number = builder.lshr(builder.ptrtoint(data, _INDEX), ir.Constant(_INDEX, 3))
        return builder.and_(builder.neg(number), ir.Constant(_INDEX, WIDTH - 1))

    return types.int64(array), emit
