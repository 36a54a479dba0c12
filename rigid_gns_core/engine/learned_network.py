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
from ..kernels.neighbours import Indices
from ..kernels.single_lanes import add_product, ROWS, Single, WIDTH
from ..scenes.state import Array

OUTPUTS = 6
"""Numbers that the network gives for a contact."""


class Exchange(NamedTuple):
    """Weights of one exchange between contacts that share a body; inputs first.

    edge: B, shape (W + 4 K, W); bias: shape (W,); own, other: C and D, shape (W, W); vectors: P
    and Q, shape (W, 2 K); vectors_bias: shape (2 K,). Zeros fill W and all outputs up to a
    multiple of `WIDTH`, here and in `LearnedNetwork`.
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

    def matrix(name: str, outputs: int, inputs: int, wide: int = 0) -> Single:
        """Matrix with zeros for outputs, and after the first `wide` inputs, to fill registers."""
        weights = taken(f'{name}.weight', outputs, inputs)
        made = np.zeros((inputs - wide + _widened(wide), _widened(outputs)), np.float32)
        made[:wide, :outputs] = weights[:wide]
        made[_widened(wide) :, :outputs] = weights[wide:]
        return made

    def bias(name: str, outputs: int) -> Single:
        made = np.zeros(_widened(outputs), np.float32)
        made[:outputs] = taken(f'{name}.bias', outputs)
        return made

    def exchange(name: str) -> Exchange:
        return Exchange(
            edge=matrix(f'{name}.edge', width, width + 4 * vectors, width),
            bias=bias(f'{name}.edge', width),
            own=matrix(f'{name}.own', width, width, width),
            other=matrix(f'{name}.other', width, width, width),
            vectors=matrix(f'{name}.vectors', 2 * vectors, width, width),
            vectors_bias=bias(f'{name}.vectors', 2 * vectors),
        )

    made = LearnedNetwork(
        stiffness=taken('stiffness', 1),
        springs=taken('springs', SPRINGS),
        strength=taken('strength', 1),
        low=taken('low', FEATURES),
        high=taken('high', FEATURES),
        mean=taken('mean', FEATURES),
        deviation=taken('deviation', FEATURES),
        first=matrix('first', width, FEATURES),
        first_bias=bias('first', width),
        second=matrix('second', width, width, width),
        second_bias=bias('second', width),
        exchange=exchange('exchange'),
        exchange_again=exchange('exchange_again'),
        last=matrix('last', width, width, width),
        last_bias=bias('last', width),
        out=matrix('out', OUTPUTS, width, width),
        out_bias=bias('out', OUTPUTS),
    )
    if left:
        raise ValueError(f'unknown weight {min(left)!r}')
    return made


def _widened(columns: int) -> int:
    return -(-columns // WIDTH) * WIDTH


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


class _Sides(NamedTuple):
    """Contacts as their bodies see them: e sides, and empty ones up to a multiple of `ROWS`.

    contact: which one it is of; own, other: number of the body among those in contact, and of the
    other one, the last number being that of all surfaces; normal, slip: seen from it. Shapes (e,)
    and (e, 3).
    """

    contact: Indices
    own: Indices
    other: Indices
    normal: Single
    slip: Single


@compiled
def outputs_of(network: LearnedNetwork, contacts: LearnedContacts, count: int) -> Array:
    """Outputs for each contact, before their bounds; shape (c, OUTPUTS).

    Args:
        network: The weights.
        contacts: Of `count` spheres.
        count: Spheres.
    """
    sides, bodies = _sides_of(contacts, count)
    size, rows = len(sides.contact), _rows(len(sides.contact))
    inputs = np.zeros((rows, FEATURES), np.float32)
    for e in range(size):
        c = sides.contact[e]
        side = 0 if contacts.a[c] == bodies[sides.own[e]] else 1
        for f in range(FEATURES):
            value = np.float32(contacts.features[c, side, f])
            inputs[e, f] = (value - network.mean[f]) / network.deviation[f]
    # beside each edge there is room for what it sees of the vectors
    edges = np.empty((rows, len(network.exchange.edge)), np.float32)
    spare = np.empty_like(edges)
    _layer(inputs, network.first, network.first_bias, spare)
    _layer(spare, network.second, network.second_bias, edges)
    _exchange(network.exchange, sides, len(bodies), edges, spare)
    _exchange(network.exchange_again, sides, len(bodies), spare, edges)
    _layer(edges, network.last, network.last_bias, spare)
    last = np.empty((rows, len(network.out_bias)), np.float32)
    last[:] = network.out_bias
    add_product(spare, network.out, last)
    outputs = np.zeros((len(contacts.a), OUTPUTS))
    for e in range(size):
        for k in range(OUTPUTS):
            outputs[sides.contact[e], k] += last[e, k]
    return outputs


@compiled
def _sides_of(contacts: LearnedContacts, count: int) -> tuple[_Sides, Indices]:
    """Sides of the contacts, and the spheres in contact."""
    place, met = np.full(count, -1), 0
    size = len(contacts.a)
    for c in range(len(contacts.a)):
        for i in (contacts.a[c], contacts.b[c]):
            if i >= 0 and place[i] < 0:
                place[i] = met
                met += 1
        size += contacts.b[c] >= 0
    sides = _Sides(
        contact=np.empty(size, np.int64),
        own=np.empty(size, np.int64),
        other=np.empty(size, np.int64),
        normal=np.empty((size, 3), np.float32),
        slip=np.empty((size, 3), np.float32),
    )
    bodies, e = np.empty(met, np.int64), 0
    for c in range(len(contacts.a)):
        a, b = contacts.a[c], contacts.b[c]
        for side in range(2 if b >= 0 else 1):
            i, j, sign = (a, b, 1.0) if side == 0 else (b, a, -1.0)
            bodies[place[i]] = i
            sides.contact[e], sides.own[e] = c, place[i]
            sides.other[e] = place[j] if j >= 0 else met
            for axis in range(3):
                sides.normal[e, axis] = sign * contacts.normal[c, axis]
                sides.slip[e, axis] = sign * contacts.slip[c, axis]
            e += 1
    return sides, bodies


@in_place
def _rows(size: int) -> int:
    return (size + ROWS - 1) // ROWS * ROWS


@in_place
def _layer(inputs: Single, matrix: Single, bias: Single, out: Single) -> None:
    """R(inputs matrix + bias)."""
    for e in range(len(inputs)):
        for k in range(len(bias)):
            out[e, k] = bias[k]
    add_product(inputs, matrix, out)
    _ramp(len(bias), out)


@compiled
def _exchange(
    weights: Exchange, sides: _Sides, bodies: int, edges: Single, edges_out: Single
) -> None:
    """One exchange between contacts that share a body; `edges` get what they see of vectors."""
    size, rows, width = len(sides.contact), len(edges), len(weights.bias)
    vectors, wide = (len(weights.edge) - width) // 4, len(weights.vectors_bias)
    some = np.empty((rows, wide), np.float32)
    some[:] = weights.vectors_bias
    add_product(edges, weights.vectors, some)
    sums = np.zeros((_rows(bodies + 1), width), np.float32)
    pushes = np.zeros((bodies + 1, vectors, 3), np.float32)
    for e in range(size):
        i = sides.own[e]
        for k in range(width):
            sums[i, k] += edges[e, k]
        for k in range(vectors):
            for axis in range(3):
                pushes[i, k, axis] += some[e, k] * sides.normal[e, axis]
                pushes[i, k, axis] += some[e, vectors + k] * sides.slip[e, axis]
    own, other = np.zeros_like(sums), np.zeros_like(sums)
    add_product(sums, weights.own, own)
    add_product(sums, weights.other, other)
    for e in range(size):
        i, j = sides.own[e], sides.other[e]
        for k in range(width):
            edges_out[e, k] = weights.bias[k] + own[i, k] + other[j, k]
        for k in range(vectors):
            for part in range(4):
                edges[e, width + part * vectors + k] = 0.0
            for axis in range(3):
                n, t = sides.normal[e, axis], sides.slip[e, axis]
                edges[e, width + k] += pushes[i, k, axis] * n
                edges[e, width + vectors + k] += pushes[i, k, axis] * t
                edges[e, width + 2 * vectors + k] += pushes[j, k, axis] * n
                edges[e, width + 3 * vectors + k] += pushes[j, k, axis] * t
    add_product(edges, weights.edge, edges_out)
    _ramp(width, edges_out)


@in_place
def _ramp(width: int, values_out: Single) -> None:
    for e in range(len(values_out)):
        for k in range(width):
            values_out[e, k] = max(values_out[e, k], np.float32(0.0))
