# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forward pass of the residual network; `networks/residual.py` is the same one in torch.

With x the features of contact c seen from body i, j the other body, n and t its normal and slip
seen from i, and R the ramp max(0, .):

    e = R(A2 R(A1 x)),   then twice, with matrices of their own:
    h_i = sum of e over the contacts of i,   V_i = sum of (P e) n + (Q e) t   (vectors, K of them)
    e <- R(B [e, V_i . n, V_i . t, V_j . n, V_j . t] + C h_i + D h_j),   and
    y_c = sum over the two sides of O R(E e).

Surfaces have h = 0 and V = 0.

The scale of a contact is multiplied by s max(0, 1 - d): s is the strength that held-out tracks
have chosen, 0 where the laws alone are better, and d is how far a feature is outside of the range
that was trained on, in standard deviations, the largest one. So the network fades to the laws
where it knows nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .learned_contacts import FEATURES, LearnedContacts
from .options import ResidualConfig
from .springs import SPRINGS
from ..kernels.jit import compiled, in_place
from ..scenes.state import Array

OUTPUTS = 6
"""Numbers that the network gives for a contact."""

Single = NDArray[np.float32]


class Exchange(NamedTuple):
    """Weights of one exchange between contacts that share a body; inputs first.

    edge: B, shape (W + 4 K, W); bias: shape (W,); own, other: C and D, shape (W, W); vectors: P
    and Q, shape (W, 2 K); vectors_bias: shape (2 K,).
    """

    edge: Single
    bias: Single
    own: Single
    other: Single
    vectors: Single
    vectors_bias: Single


class LearnedNetwork(NamedTuple):
    """Weights of a residual network of width W with K vectors; inputs first.

    stiffness: of contacts, per effective mass [1/s^2], shape (1,); see `learned_guard.py`.
    springs: of blows, all 0 where the laws make them, shape (SPRINGS,); see `springs.py`.
    strength: share of the outputs that acts, shape (1,); low, high: range of the features in
    training, shape (FEATURES,).
    mean, deviation: of the features, shape (FEATURES,); first: shape (FEATURES, W); second, last:
    shape (W, W); out: shape (W, OUTPUTS); and their biases.
    """

    stiffness: Single
    springs: Single
    strength: Single
    low: Single
    high: Single
    mean: Single
    deviation: Single
    first: Single
    first_bias: Single
    second: Single
    second_bias: Single
    exchange: Exchange
    exchange_again: Exchange
    last: Single
    last_bias: Single
    out: Single
    out_bias: Single


class RangeCounts(NamedTuple):
    """Contacts that a network was called for, beside the range that it was trained on.

    contacts: how many; faded: the sum of min(d, 1) over them, with d as above, which is how many
    were left to the laws; farthest: the largest d.
    """

    contacts: float
    faded: float
    farthest: float


def network_of(tensors: Mapping[str, NDArray[Any]], config: ResidualConfig) -> LearnedNetwork:
    """Network of the weights of a file, whose matrices have outputs first.

    Raises:
        KeyError: A weight is missing.
        ValueError: A weight has another shape, or there are more.
    """
    width, vectors, left = config.width, config.vectors, set(tensors)

    def taken(name: str, *shape: int) -> Single:
        left.discard(name)
        if tensors[name].shape != shape:
            raise ValueError(f'{name} has shape {tensors[name].shape}, expected {shape}')
        return np.ascontiguousarray(tensors[name].T, dtype=np.float32)

    def exchange(name: str) -> Exchange:
        return Exchange(
            edge=taken(f'{name}.edge.weight', width, width + 4 * vectors),
            bias=taken(f'{name}.edge.bias', width),
            own=taken(f'{name}.own.weight', width, width),
            other=taken(f'{name}.other.weight', width, width),
            vectors=taken(f'{name}.vectors.weight', 2 * vectors, width),
            vectors_bias=taken(f'{name}.vectors.bias', 2 * vectors),
        )

    made = LearnedNetwork(
        stiffness=taken('stiffness', 1),
        springs=taken('springs', SPRINGS),
        strength=taken('strength', 1),
        low=taken('low', FEATURES),
        high=taken('high', FEATURES),
        mean=taken('mean', FEATURES),
        deviation=taken('deviation', FEATURES),
        first=taken('first.weight', width, FEATURES),
        first_bias=taken('first.bias', width),
        second=taken('second.weight', width, width),
        second_bias=taken('second.bias', width),
        exchange=exchange('exchange'),
        exchange_again=exchange('exchange_again'),
        last=taken('last.weight', width, width),
        last_bias=taken('last.bias', width),
        out=taken('out.weight', OUTPUTS, width),
        out_bias=taken('out.bias', OUTPUTS),
    )
    if left:
        raise ValueError(f'unknown weight {min(left)!r}')
    return made


@compiled
def fade(network: LearnedNetwork, contacts_out: LearnedContacts, range_out: Array) -> None:
    """Multiply the scale of contacts by the share of the network that it trusts.

    Counts of `RangeCounts` are added to `range_out`.
    """
    contacts = contacts_out
    for c in range(len(contacts.a)):
        far = 0.0
        for side in range(2 if contacts.b[c] >= 0 else 1):
            for f in range(FEATURES):
                value = contacts.features[c, side, f]
                beyond = max(network.low[f] - value, value - network.high[f])
                far = max(far, beyond / network.deviation[f])
        share = max(0.0, 1.0 - far)
        contacts.scale[c] *= network.strength[0] * share
        range_out[0] += 1.0
        range_out[1] += 1.0 - share
        range_out[2] = max(range_out[2], far)


@compiled
def outputs_of(network: LearnedNetwork, contacts: LearnedContacts, count: int) -> Array:
    """Outputs for each contact, before their bounds; shape (c, OUTPUTS).

    Args:
        network: The weights.
        contacts: Of `count` spheres.
        count: Spheres.
    """
    size, width = len(contacts.a), len(network.first_bias)
    edges = np.zeros((size, 2, width), np.float32)
    wide, narrow = np.empty(width, np.float32), np.empty(FEATURES, np.float32)
    for c in range(size):
        for side in range(2 if contacts.b[c] >= 0 else 1):
            for f in range(FEATURES):
                value = np.float32(contacts.features[c, side, f])
                narrow[f] = (value - network.mean[f]) / network.deviation[f]
            _dense(narrow, network.first, network.first_bias, wide)
            _ramp(wide)
            _dense(wide, network.second, network.second_bias, edges[c, side])
            _ramp(edges[c, side])
    _exchange(network.exchange, contacts, count, edges)
    _exchange(network.exchange_again, contacts, count, edges)
    outputs, one = np.zeros((size, OUTPUTS)), np.empty(OUTPUTS, np.float32)
    for c in range(size):
        for side in range(2 if contacts.b[c] >= 0 else 1):
            _dense(edges[c, side], network.last, network.last_bias, wide)
            _ramp(wide)
            _dense(wide, network.out, network.out_bias, one)
            for k in range(OUTPUTS):
                outputs[c, k] += one[k]
    return outputs


@compiled
def _exchange(
    weights: Exchange, contacts: LearnedContacts, count: int, edges_out: NDArray[np.float32]
) -> None:
    """One exchange between contacts that share a body."""
    edges, size, width = edges_out, len(contacts.a), len(weights.bias)
    vectors = len(weights.vectors_bias) // 2
    sums = np.zeros((count + 1, width), np.float32)
    pushes = np.zeros((count + 1, vectors, 3), np.float32)
    some = np.empty(2 * vectors, np.float32)
    for c in range(size):
        for side in range(2 if contacts.b[c] >= 0 else 1):
            i, sign = contacts.a[c], np.float32(1.0)
            if side == 1:
                i, sign = contacts.b[c], np.float32(-1.0)
            for k in range(width):
                sums[i, k] += edges[c, side, k]
            _dense(edges[c, side], weights.vectors, weights.vectors_bias, some)
            for k in range(vectors):
                for axis in range(3):
                    n = sign * np.float32(contacts.normal[c, axis])
                    t = sign * np.float32(contacts.slip[c, axis])
                    pushes[i, k, axis] += some[k] * n + some[vectors + k] * t
    own, other = np.zeros_like(sums), np.zeros_like(sums)
    none, is_used = np.zeros(width, np.float32), np.zeros(count + 1, np.bool_)
    for c in range(size):
        is_used[contacts.a[c]] = is_used[contacts.b[c]] = True  # -1 is the last one
    for i in range(count):
        if is_used[i]:
            _dense(sums[i], weights.own, none, own[i])
            _dense(sums[i], weights.other, none, other[i])
    inner = np.empty(width + 4 * vectors, np.float32)
    for c in range(size):
        for side in range(2 if contacts.b[c] >= 0 else 1):
            i, j, sign = contacts.a[c], contacts.b[c], np.float32(1.0)
            if side == 1:
                i, j, sign = contacts.b[c], contacts.a[c], np.float32(-1.0)
            inner[:width] = edges[c, side]
            for k in range(vectors):
                for part in range(4):
                    inner[width + part * vectors + k] = 0.0
                for axis in range(3):
                    n = sign * np.float32(contacts.normal[c, axis])
                    t = sign * np.float32(contacts.slip[c, axis])
                    inner[width + k] += pushes[i, k, axis] * n
                    inner[width + vectors + k] += pushes[i, k, axis] * t
                    inner[width + 2 * vectors + k] += pushes[j, k, axis] * n
                    inner[width + 3 * vectors + k] += pushes[j, k, axis] * t
            _dense(inner, weights.edge, weights.bias, edges[c, side])
            for k in range(width):
                edges[c, side, k] += own[i, k] + other[j, k]
            _ramp(edges[c, side])


@in_place
def _dense(inputs: Single, matrix: Single, bias: Single, out: Single) -> None:
    """Affine map; inputs that the ramp has made zero cost nothing."""
    for k in range(len(out)):
        out[k] = bias[k]
    for i in range(len(inputs)):
        value = inputs[i]
        if value != 0:
            for k in range(len(out)):
                out[k] += value * matrix[i, k]


@in_place
def _ramp(values_out: Single) -> None:
    for k in range(len(values_out)):
        values_out[k] = max(values_out[k], np.float32(0.0))
