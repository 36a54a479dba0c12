"""The learned part: a graph network on contacts, which sets the pace of each in every round.

The same as models/contact/network.py and features.py, contact by contact.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..state import Array
from .contacts import Contacts
from .jit import compiled, in_place
from .law import Law
from .neighbours import Indices
from .vector import Vector, dot, length, minus, row, times
from .world import UNIT_GRAVITY, World

Floats = NDArray[np.float32]

# share of a round's step that the next one repeats, without a network: halves the rounds of piles
MOMENTUM = 0.5


class Weights(NamedTuple):
    """Weights, inputs first, so that rows are read in order; M rounds of width w.

    encoder: shape (17, w); encoder_last: (w, w); rounds: latent, latents around and features of a
    round, (M, 2 w + 7, w); rounds_last: (M, w, w); heads: (M, w, 4); each with its bias.
    """

    encoder: Floats
    encoder_bias: Floats
    encoder_last: Floats
    encoder_last_bias: Floats
    rounds: Floats
    rounds_bias: Floats
    rounds_last: Floats
    rounds_last_bias: Floats
    heads: Floats
    heads_bias: Floats


def weights_of(tensors: Mapping[str, NDArray[Any]], rounds: int) -> Weights:
    """Weights of a contact model's checkpoint, by its names."""

    def stack(name: str) -> Floats:
        return np.stack([tensors[name.format(k)].T for k in range(rounds)]).copy()

    parts = np.concatenate([stack('rounds.{}.weights.' + str(part)) for part in range(3)], axis=1)
    return Weights(
        tensors['encoder.weights.0'].T.copy(),
        tensors['encoder.bias'],
        tensors['encoder.last.weight'].T.copy(),
        tensors['encoder.last.bias'],
        parts,
        stack('rounds.{}.bias'),
        stack('rounds.{}.last.weight'),
        stack('rounds.{}.last.bias'),
        stack('heads.{}.weight'),
        stack('heads.{}.bias'),
    )


def no_weights() -> Weights:
    """For the law alone: no rounds."""
    two, three = np.zeros((0, 0), np.float32), np.zeros((0, 0, 0), np.float32)
    one = np.zeros(0, np.float32)
    return Weights(two, one, two, one, three, two, three, two, three, two)


@in_place
def plain(load: Array, pace: Array) -> None:
    """The pace without a network; see `tune`."""
    for c in range(len(load)):
        pace[c, 0] = pace[c, 1] = 1.0
        pace[c, 2] = MOMENTUM * (1.0 - 1.0 / load[c])


@in_place
def _layer(inputs: Floats, weight: Floats, bias: Floats, outputs: Floats) -> None:
    """Outputs = weight.T inputs + bias for all contacts at once; shapes (i, c), (o, c).

    Contacts are the inner loop, which the compiler turns into vector instructions; four inputs at
    a time, so that outputs are not written more often than needed.
    """
    size, count = inputs.shape
    whole = size - size % 4
    for o in range(len(bias)):
        out = outputs[o]
        out[:] = bias[o]
        for i in range(0, whole, 4):
            one, two, three, four = inputs[i], inputs[i + 1], inputs[i + 2], inputs[i + 3]
            w1, w2, w3, w4 = weight[i, o], weight[i + 1, o], weight[i + 2, o], weight[i + 3, o]
            for c in range(count):
                out[c] += (w1 * one[c] + w2 * two[c]) + (w3 * three[c] + w4 * four[c])
        for i in range(whole, size):
            one, w1 = inputs[i], weight[i, o]
            for c in range(count):
                out[c] += w1 * one[c]


@compiled
def _mlp(
    inputs: Floats, first: Floats, bias: Floats, last: Floats, last_bias: Floats, outputs: Floats
) -> None:
    hidden = np.empty((len(bias), inputs.shape[1]), np.float32)
    _layer(inputs, first, bias, hidden)
    for row_of in hidden:
        for c in range(len(row_of)):
            row_of[c] = max(row_of[c], np.float32(0.0))
    _layer(hidden, last, last_bias, outputs)


@in_place
def _speed(value: float, scale: float) -> float:
    return math.asinh(np.float32(10.0 * value / scale))


@in_place
def describe(
    world: World,
    contacts: Contacts,
    law: Law,
    k: int,
    pace: float,
    approach: float,
    flying: bool,
    parting: float,
    slip: Vector,
    spin_a: Vector,
    spin_b: Vector,
    features: Floats,
) -> None:
    """Invariant features of contact k, speeds in units of g h; shape (17,)."""
    a, b, fixed = contacts.a[k], contacts.b[k], contacts.plane[k] >= 0
    scale = UNIT_GRAVITY * pace
    radius_a, radius_b = world.radius[a], world.radius[a] if fixed else world.radius[b]
    gravity = (world.gravity[0], world.gravity[1], world.gravity[2])
    up = times(-1.0 / max(length(gravity), 1e-12), gravity)
    steep = dot(row(contacts.normal, k), up)
    smaller = min(radius_a, radius_b)
    turning = length(minus(times(law.arm_a[k], spin_a), times(law.arm_b[k], spin_b)))
    mass_ratio = 1.0 if fixed else world.inverse_mass[a] / world.inverse_mass[b]
    features[0] = _speed(approach, scale)
    features[1] = _speed(parting, scale)
    features[2] = _speed(length(slip), scale)
    features[3] = _speed(dot(slip, up) * steep, scale)
    features[4] = _speed(turning, scale)
    features[5] = math.asinh(1e3 * contacts.gap[k] / smaller)
    features[6] = contacts.time[k] / pace
    features[7] = law.restitution[k]
    features[8] = law.friction[k]
    features[9] = 10.0 * law.rolling[k] / radius_a
    features[10] = math.fabs(math.log(mass_ratio))
    features[11] = math.fabs(math.log(radius_a / radius_b))
    features[12] = 1.0 if fixed else 0.0
    features[13] = math.fabs(steep)
    features[14] = steep if fixed else 0.0
    features[15] = 1.0 if flying else 0.0
    features[16] = math.log(scale * pace / smaller)


@compiled
def encode(weights: Weights, features: Floats, latent: Floats) -> None:
    """Latents of contacts, shape (w, c), from features, shape (17, c)."""
    _mlp(
        features,
        weights.encoder,
        weights.encoder_bias,
        weights.encoder_last,
        weights.encoder_last_bias,
        latent,
    )


@in_place
def sum_latents(
    contacts: Contacts, group: Indices, latent: Floats, weight: Array, fixed: int, total: Array
) -> None:
    """Sums over the contacts of each moving body, shape (n + 1, w); the fixed one tells nothing.

    In float64 their order does not matter, so that equal contacts of a lattice stay equal.
    """
    for q in range(len(group)):
        for body in (contacts.a[group[q]], contacts.b[group[q]]):
            total[body] = 0.0
    for q in range(len(group)):
        a, b = contacts.a[group[q]], contacts.b[group[q]]
        for i in range(len(latent)):
            total[a, i] += weight[q, 0] * latent[i, q]
            if b != fixed:
                total[b, i] += weight[q, 1] * latent[i, q]


@in_place
def read_round(
    lacking: float, slip: float, carried: float, others: float, others_slip: float, load: float,
    scale: float, seen: Floats,
) -> None:  # fmt: skip
    """What a contact sees in a round, speeds; shape (7,), see `Feel` of the reference."""
    seen[0] = _speed(lacking, scale)
    seen[1] = _speed(slip, scale)
    seen[2] = _speed(carried, scale)
    seen[3] = _speed(others, scale)
    seen[4] = _speed(others_slip, scale)
    seen[5] = math.log(load)
    seen[6] = _speed(math.fabs(others) + others_slip, scale)


@compiled
def tune(
    weights: Weights, index: int, inputs: Floats, load: Array, latent: Floats, pace: Array
) -> None:
    """One round: latents are renewed, and say what the round does at each contact.

    Args:
        weights: Of the network.
        index: Of the round.
        inputs: Latents, latents around, features of the round, shape (2 w + 7, c).
        load: Contacts that press on the bodies, shape (c,).
        latent: Renewed, shape (w, c).
        pace: Factors on the damped steps of normal impulse and of friction, and the share of the
            last step that is repeated; written, shape (c, 3).
    """
    _mlp(
        inputs,
        weights.rounds[index],
        weights.rounds_bias[index],
        weights.rounds_last[index],
        weights.rounds_last_bias[index],
        latent,
    )
    for i in range(len(latent)):
        for c in range(len(load)):
            latent[i, c] += inputs[i, c]
    raw = np.empty((4, len(load)), np.float32)
    _layer(latent, weights.heads[index], weights.heads_bias[index], raw)
    for c in range(len(load)):
        # a contact that shares no body with one that presses keeps the exact step
        shared = 1.0 - 1.0 / load[c]
        momentum = MOMENTUM + (1.0 - MOMENTUM) * 0.9 * math.tanh(raw[2, c])
        pace[c, 0] = math.exp(np.float32(shared) * math.tanh(raw[0, c]))
        pace[c, 1] = math.exp(np.float32(shared) * math.tanh(raw[1, c]))
        pace[c, 2] = shared * momentum
