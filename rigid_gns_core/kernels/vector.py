# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Vectors of three numbers as tuples, which the compiler keeps in registers."""

from __future__ import annotations

import math

from .jit import in_place
from ..scenes.state import Array

Vector = tuple[float, float, float]


@in_place
def row(array: Array, i: int) -> Vector:
    """Row i of an array of shape (n, 3)."""
    return array[i, 0], array[i, 1], array[i, 2]


@in_place
def put(array: Array, i: int, value: Vector) -> None:
    """Overwrite row i."""
    array[i, 0], array[i, 1], array[i, 2] = value


@in_place
def add_to(array: Array, i: int, value: Vector) -> None:
    """Add to row i."""
    array[i, 0] += value[0]
    array[i, 1] += value[1]
    array[i, 2] += value[2]


@in_place
def plus(one: Vector, other: Vector) -> Vector:
    """Sum."""
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


@in_place
def minus(one: Vector, other: Vector) -> Vector:
    """Difference."""
    return one[0] - other[0], one[1] - other[1], one[2] - other[2]


@in_place
def times(factor: float, vector: Vector) -> Vector:
    """Multiple."""
    return factor * vector[0], factor * vector[1], factor * vector[2]


@in_place
def dot(one: Vector, other: Vector) -> float:
    """Inner product."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


@in_place
def cross(one: Vector, other: Vector) -> Vector:
    """Vector product."""
    return (
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    )


@in_place
def length(vector: Vector) -> float:
    """Length."""
    return math.sqrt(dot(vector, vector))


@in_place
def across(vector: Vector, normal: Vector) -> Vector:
    """Part across a unit normal."""
    return minus(vector, times(dot(vector, normal), normal))


@in_place
def clip(vector: Vector, most: float) -> Vector:
    """Return the vector, no longer than `most`."""
    long = length(vector)
    return times(most / long, vector) if long > most else vector


@in_place
def solve_symmetric(m: Array, b: Vector) -> Vector:
    """X of m x = b for a symmetric positive definite matrix, shape (3, 3)."""
    first, second, third = row(m, 0), row(m, 1), row(m, 2)
    one, two, three = cross(second, third), cross(third, first), cross(first, second)
    scale = 1.0 / dot(first, one)
    return plus(
        plus(times(scale * b[0], one), times(scale * b[1], two)), times(scale * b[2], three)
    )
