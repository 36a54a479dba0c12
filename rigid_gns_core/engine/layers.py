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

"""Layers of a network for all contacts at once, contacts innermost; as models/layers.py."""

from __future__ import annotations

import numpy as np

from ..kernels.elementary import Floats
from ..kernels.jit import compiled, in_place

# contacts that a layer takes at once, so that what it reads stays near
_BLOCK = 128


@in_place
def layer(
    inputs: Floats,
    weight: Floats,
    bias: Floats,
    outputs: Floats,
    first: int,
    start: int,
    size: int,
) -> None:
    """Set outputs = weight.T inputs + bias for `size` contacts; shapes (i, c), (o, c).

    Contacts are the inner loop, which the compiler turns into vector instructions; two outputs and
    four inputs at a time, so that little is read twice. Where outputs are odd, one comes twice.

    Args:
        inputs: From contact `first` on.
        weight: Inputs first, shape (i, o).
        bias: Shape (o,).
        outputs: From contact `start` on; written.
        first: See inputs.
        start: See outputs.
        size: Number of contacts.
    """
    many = len(inputs)
    whole = many - many % 4
    for pair in range((len(bias) + 1) // 2):
        o = min(2 * pair, len(bias) - 2)
        here, there = outputs[o][start : start + size], outputs[o + 1][start : start + size]
        for c in range(size):
            here[c], there[c] = bias[o], bias[o + 1]
        for i in range(0, whole, 4):
            one, two = inputs[i][first : first + size], inputs[i + 1][first : first + size]
            three, four = inputs[i + 2][first : first + size], inputs[i + 3][first : first + size]
            w1, w2, w3, w4 = weight[i, o], weight[i + 1, o], weight[i + 2, o], weight[i + 3, o]
            u1, u2 = weight[i, o + 1], weight[i + 1, o + 1]
            u3, u4 = weight[i + 2, o + 1], weight[i + 3, o + 1]
            for c in range(size):
                here[c] += (w1 * one[c] + w2 * two[c]) + (w3 * three[c] + w4 * four[c])
                there[c] += (u1 * one[c] + u2 * two[c]) + (u3 * three[c] + u4 * four[c])
        for i in range(whole, many):
            one, w1, u1 = inputs[i][first : first + size], weight[i, o], weight[i, o + 1]
            for c in range(size):
                here[c] += w1 * one[c]
                there[c] += u1 * one[c]


@compiled
def mlp(
    inputs: Floats, first: Floats, bias: Floats, last: Floats, last_bias: Floats, outputs: Floats
) -> None:
    """Two layers with a ReLU between them; shapes (i, c), (o, c)."""
    count = inputs.shape[1]
    hidden = np.empty((len(bias), _BLOCK), np.float32)
    for start in range(0, count, _BLOCK):
        size = min(_BLOCK, count - start)
        layer(inputs, first, bias, hidden, start, 0, size)
        for row_of in hidden:
            for c in range(size):
                row_of[c] = max(row_of[c], np.float32(0.0))
        layer(hidden, last, last_bias, outputs, 0, start, size)


@in_place
def turn_over(one: Floats, other: Floats) -> None:
    """Write the transpose of `one` into `other`."""
    for start in range(0, len(other), 8):  # few rows at a time, so that both stay near
        end = min(start + 8, len(other))
        for i in range(len(one)):
            row_of = one[i]
            for k in range(start, end):
                other[k, i] = row_of[k]
