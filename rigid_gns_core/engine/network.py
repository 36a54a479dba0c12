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
from .jit import compiled
from .law import Law
from .neighbours import Indices
from .vector import Vector, dot, length, minus, row, times
from .world import UNIT_GRAVITY, World

Floats = NDArray[np.float32]

FEATURES = 17
ROUND_FEATURES = 7
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


class Tuning(NamedTuple):
    """What a round does at a contact.

    pace, pace_slip: factors on the damped steps of normal impulse and friction; momentum: share of
    the last step that is repeated.
    """

    pace: float
    pace_slip: float
    momentum: float


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


@compiled
def plain(load: float) -> Tuning:
    """Without a network; `load` is the number of contacts that press on the bodies."""
    return Tuning(1.0, 1.0, MOMENTUM * (1.0 - 1.0 / load))


@compiled
def _layer(inputs: Floats, weight: Floats, bias: Floats, outputs: Floats) -> None:
    """Outputs = inputs @ weight + bias, for a few numbers."""
    outputs[:] = bias
    for i in range(len(inputs)):
        value = inputs[i]
        for o in range(len(outputs)):
            outputs[o] += value * weight[i, o]


@compiled
def _mlp(
    inputs: Floats, first: Floats, bias: Floats, last: Floats, last_bias: Floats, hidden: Floats,
    outputs: Floats,
) -> None:  # fmt: skip
    _layer(inputs, first, bias, hidden)
    for k in range(len(hidden)):
        hidden[k] = max(hidden[k], np.float32(0.0))
    _layer(hidden, last, last_bias, outputs)


@compiled
def _speed(value: float, scale: float) -> float:
    return math.asinh(10.0 * value / scale)


@compiled
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
def encode(weights: Weights, features: Floats, hidden: Floats, latent: Floats) -> None:
    """Latent of a contact, shape (w,)."""
    _mlp(
        features,
        weights.encoder,
        weights.encoder_bias,
        weights.encoder_last,
        weights.encoder_last_bias,
        hidden,
        latent,
    )


@compiled
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
        for i in range(latent.shape[1]):
            total[a, i] += weight[q, 0] * latent[q, i]
            if b != fixed:
                total[b, i] += weight[q, 1] * latent[q, i]


@compiled
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
    weights: Weights, index: int, inputs: Floats, load: float, hidden: Floats, latent: Floats,
    raw: Floats,
) -> Tuning:  # fmt: skip
    """One round at a contact: its latent is renewed from `inputs`, shape (2 w + 7,)."""
    _mlp(
        inputs,
        weights.rounds[index],
        weights.rounds_bias[index],
        weights.rounds_last[index],
        weights.rounds_last_bias[index],
        hidden,
        latent,
    )
    latent += inputs[: len(latent)]
    _layer(latent, weights.heads[index], weights.heads_bias[index], raw)
    # a contact that shares no body with one that presses keeps the exact step
    shared = 1.0 - 1.0 / load
    momentum = MOMENTUM + (1.0 - MOMENTUM) * 0.9 * math.tanh(raw[2])
    return Tuning(
        math.exp(shared * math.tanh(raw[0])),
        math.exp(shared * math.tanh(raw[1])),
        shared * momentum,
    )
