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

"""The learned part: a graph network on contacts, which sets the pace of each in every round.

The same as models/contact/network.py and features.py, contact by contact.
"""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .contacts import Contacts
from .law import Law
from .layers import layer, mlp
from .world import UNIT_GRAVITY, World
from ..kernels.elementary import asinh_all, exp, Floats, log_all, tanh_all
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import dot, length, minus, row, times, Vector
from ..scenes.state import Array

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
    """Write the pace without a network; see `tune`."""
    for c in range(len(load)):
        pace[c, 0] = pace[c, 1] = 1.0
        pace[c, 2] = MOMENTUM * (1.0 - 1.0 / load[c])


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
    """Features of contact k before their logarithms, see `encode`; shape (17,)."""
    a, b, fixed = contacts.a[k], contacts.b[k], contacts.plane[k] >= 0
    scale = UNIT_GRAVITY * pace
    speed = 10.0 / scale
    radius_a, radius_b = world.radius[a], world.radius[a] if fixed else world.radius[b]
    gravity = (world.gravity[0], world.gravity[1], world.gravity[2])
    up = times(-1.0 / max(length(gravity), 1e-12), gravity)
    steep = dot(row(contacts.normal, k), up)
    smaller = min(radius_a, radius_b)
    turning = length(minus(times(law.arm_a[k], spin_a), times(law.arm_b[k], spin_b)))
    mass_ratio = 1.0 if fixed else world.inverse_mass[a] / world.inverse_mass[b]
    features[0] = speed * approach
    features[1] = speed * parting
    features[2] = speed * length(slip)
    features[3] = speed * dot(slip, up) * steep
    features[4] = speed * turning
    features[5] = 1e3 * contacts.gap[k] / smaller
    features[6] = contacts.time[k] / pace
    features[7] = law.restitution[k]
    features[8] = law.friction[k]
    features[9] = 10.0 * law.rolling[k] / radius_a
    features[10] = mass_ratio
    features[11] = radius_a / radius_b
    features[12] = 1.0 if fixed else 0.0
    features[13] = math.fabs(steep)
    features[14] = steep if fixed else 0.0
    features[15] = 1.0 if flying else 0.0
    features[16] = scale * pace / smaller


@compiled
def encode(weights: Weights, features: Floats, latent: Floats) -> None:
    """Latents of contacts, shape (w, c), from what `describe` wrote, shape (17, c).

    Speeds in units of g h, and gaps in radii, go through asinh, ratios through logarithms.
    """
    for i in range(6):
        asinh_all(features[i])
    for i in (10, 11, 16):
        log_all(features[i])
    for i in (10, 11):
        for c in range(features.shape[1]):
            features[i, c] = math.fabs(features[i, c])
    mlp(
        features,
        weights.encoder,
        weights.encoder_bias,
        weights.encoder_last,
        weights.encoder_last_bias,
        latent,
    )


@in_place
def gather_latents(
    contacts: Contacts, group: Indices, latents: Floats, weight: Array, fixed: int, total: Array
) -> None:
    """Sum what each contact's bodies have of their other contacts; the fixed one tells nothing.

    Sums are in float64, where their order does not matter, so that equal contacts of a lattice
    stay equal.

    Args:
        contacts: All.
        group: Those that are solved.
        latents: Of each contact, shape (c, w); overwritten by what is around it.
        weight: How much each counts at a and b, shape (c, 2).
        fixed: Index of the fixed body.
        total: Sums by body, shape (n + 1, w); overwritten.
    """
    width = latents.shape[1]
    for k in group:
        one, other = total[contacts.a[k]], total[contacts.b[k]]
        for i in range(width):
            one[i] = other[i] = 0.0
    for q in range(len(group)):
        one, other = total[contacts.a[group[q]]], total[contacts.b[group[q]]]
        own, at_one, at_other = latents[q], weight[q, 0], weight[q, 1]
        for i in range(width):
            one[i] += at_one * own[i]
        for i in range(width):
            other[i] += at_other * own[i]
    for q in range(len(group)):
        a, b, own = contacts.a[group[q]], contacts.b[group[q]], latents[q]
        one, other, at_one, at_other = total[a], total[b], weight[q, 0], weight[q, 1]
        if b == fixed:
            for i in range(width):
                own[i] = one[i] - at_one * own[i]
        else:
            for i in range(width):
                own[i] = (one[i] - at_one * own[i]) + (other[i] - at_other * own[i])


@in_place
def read_round(
    lacking: float, slip: float, carried: float, others: float, others_slip: float, load: float,
    scale: float, seen: Floats,
) -> None:  # fmt: skip
    """Write what a contact sees in a round, before logarithms; (7,): `Feel` of the reference."""
    speed = 10.0 / scale
    seen[0] = speed * lacking
    seen[1] = speed * slip
    seen[2] = speed * carried
    seen[3] = speed * others
    seen[4] = speed * others_slip
    seen[5] = load
    seen[6] = speed * (math.fabs(others) + others_slip)


@compiled
def tune(
    weights: Weights, index: int, inputs: Floats, load: Array, latent: Floats, pace: Array
) -> None:
    """One round: latents are renewed, and say what the round does at each contact.

    Args:
        weights: Of the network.
        index: Of the round.
        inputs: Latents, latents around, what `read_round` wrote, shape (2 w + 7, c).
        load: Contacts that press on the bodies, shape (c,).
        latent: Renewed, shape (w, c).
        pace: Factors on the damped steps of normal impulse and of friction, and the share of the
            last step that is repeated; written, shape (c, 3).
    """
    width, count = latent.shape
    for i in (0, 1, 2, 3, 4, 6):
        asinh_all(inputs[2 * width + i])
    log_all(inputs[2 * width + 5])
    mlp(
        inputs,
        weights.rounds[index],
        weights.rounds_bias[index],
        weights.rounds_last[index],
        weights.rounds_last_bias[index],
        latent,
    )
    for i in range(width):
        for c in range(count):
            latent[i, c] += inputs[i, c]
    raw = np.empty((4, count), np.float32)
    layer(latent, weights.heads[index], weights.heads_bias[index], raw, 0, 0, count)
    for i in range(3):
        tanh_all(raw[i])
    for c in range(count):
        # a contact that shares no body with one that presses keeps the exact step
        shared = 1.0 - 1.0 / load[c]
        pace[c, 0] = exp(shared * raw[0, c])
        pace[c, 1] = exp(shared * raw[1, c])
        pace[c, 2] = shared * (MOMENTUM + (1.0 - MOMENTUM) * 0.9 * raw[2, c])
