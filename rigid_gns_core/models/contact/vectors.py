# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
