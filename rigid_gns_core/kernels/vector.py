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
    """Set row i of an array of shape (n, 3)."""
    array[i, 0], array[i, 1], array[i, 2] = value


@in_place
def add_to(array: Array, i: int, value: Vector) -> None:
    """Add to row i of an array of shape (n, 3)."""
    array[i, 0] += value[0]
    array[i, 1] += value[1]
    array[i, 2] += value[2]


@in_place
def plus(a: Vector, b: Vector) -> Vector:
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@in_place
def minus(a: Vector, b: Vector) -> Vector:
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@in_place
def times(factor: float, vector: Vector) -> Vector:
    """Vector times a factor."""
    return factor * vector[0], factor * vector[1], factor * vector[2]


@in_place
def dot(a: Vector, b: Vector) -> float:
    """Scalar product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@in_place
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@in_place
def length(vector: Vector) -> float:
    """Length of a vector."""
    return math.sqrt(dot(vector, vector))


@in_place
def across(vector: Vector, normal: Vector) -> Vector:
    """Part of a vector across a unit normal: v - (v . n) n."""
    return minus(vector, times(dot(vector, normal), normal))


@in_place
def clip(vector: Vector, most: float) -> Vector:
    """Vector, shortened where it is longer than `most`."""
    size = length(vector)
    return times(most / size, vector) if size > most else vector


@in_place
def solve_symmetric(m: Array, b: Vector) -> Vector:
    """Solution x of m x = b, m symmetric and positive definite, shape (3, 3): Cramer's rule."""
    first, second, third = row(m, 0), row(m, 1), row(m, 2)
    x, y, z = cross(second, third), cross(third, first), cross(first, second)
    scale = 1.0 / dot(first, x)
    return plus(plus(times(scale * b[0], x), times(scale * b[1], y)), times(scale * b[2], z))
