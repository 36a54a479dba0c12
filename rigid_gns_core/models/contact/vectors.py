"""Rows of vectors, shape (c, 3): products, lengths, parts."""

from __future__ import annotations

from torch import Tensor


def dot(one: Tensor, other: Tensor) -> Tensor:
    """Inner products, shape (c,)."""
    return (one * other).sum(1)


def length(vector: Tensor) -> Tensor:
    """Lengths, shape (c,), with a gradient also at zero."""
    return vector.square().sum(1).clamp(min=1e-30).sqrt()


def across(vector: Tensor, normal: Tensor) -> Tensor:
    """Parts across unit normals, shape (c, 3)."""
    return vector - dot(vector, normal)[:, None] * normal


def clip(vector: Tensor, most: Tensor) -> Tensor:
    """Vectors no longer than `most`, shape (c, 3)."""
    return vector * (most / length(vector)).clamp(max=1.0)[:, None]
