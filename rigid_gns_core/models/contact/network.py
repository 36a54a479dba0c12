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

Nodes of its graph are the contacts and the bodies between them. Contacts read invariant scalars
only, so the model turns with the scene about gravity, and the two bodies of a contact play the
same part, so that Newton's third law stays exact.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import nn, Tensor

from ...gns.config import CONTACT_FEATURES, ContactConfig, ROUND_FEATURES
from ...gns.layers import MLP

# share of a round's step that the next one repeats, without a network: halves the rounds of piles
MOMENTUM = 0.5


class Feel(NamedTuple):
    """What each contact sees in a round; shape (c,) each, speeds.

    lacking: what its normal velocity lacks; slip: speed of slip; carried: its normal impulse as a
    change of speed; others, others_slip: change of its normal velocity (signed) and of its slip
    that the other contacts of its bodies make, beyond what they did when the substep began; load:
    contacts that press on its bodies.
    """

    lacking: Tensor
    slip: Tensor
    carried: Tensor
    others: Tensor
    others_slip: Tensor
    load: Tensor


class Tuning(NamedTuple):
    """Output of a round, shape (c,) each.

    pace, pace_slip: factors on the damped steps of normal impulse and friction; momentum: share of
    the last step that is repeated; raw: -1 to 1, for networks without a law.
    """

    pace: Tensor
    pace_slip: Tensor
    momentum: Tensor
    raw: Tensor

    @classmethod
    def plain(cls, load: Tensor) -> Tuning:
        """Without a network."""
        one = torch.ones_like(load)
        return cls(one, one, MOMENTUM * (1.0 - 1.0 / load), torch.zeros_like(load))


class ContactNetwork(nn.Module):
    """Encoder of contacts and M rounds, each with weights of its own.

    Zero-initialised outputs: an untrained network leaves the law as it is.
    """

    def __init__(self, config: ContactConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.encoder = MLP((CONTACT_FEATURES,), width, width)
        self.rounds = nn.ModuleList(
            MLP((width, width, ROUND_FEATURES), width, width) for _ in range(config.rounds)
        )
        heads = [nn.Linear(width, 4) for _ in range(config.rounds)]
        for head in heads:
            nn.init.zeros_(head.weight)
            nn.init.zeros_(head.bias)
        self.heads = nn.ModuleList(heads)

    def encode(self, features: Tensor) -> Tensor:
        """Latents of contacts, shape (c, width)."""
        latents: Tensor = self.encoder(features.float())
        return latents

    def round(
        self,
        index: int,
        latent: Tensor,
        feel: Feel,
        unit: float,
        a: Tensor,
        b: Tensor,
        weight_a: Tensor,
        weight_b: Tensor,
        bodies: int,
    ) -> tuple[Tensor, Tuning]:
        """One round of message passing.

        Args:
            index: Number of the round.
            latent: Of the contacts, shape (c, width).
            feel: What contacts see.
            unit: Speed that scales it.
            a: One body of each contact, shape (c,).
            b: The other, shape (c,); body n is fixed.
            weight_a: How much the contact counts at body a, shape (c,).
            weight_b: The same at body b.
            bodies: n + 1.
        """
        scaled = torch.stack([torch.asinh(10.0 * value / unit) for value in feel[:5]], 1)
        load = feel.load.log()[:, None]
        both = (feel.others.abs() + feel.others_slip) / unit
        seen = torch.cat([scaled, load, torch.asinh(10.0 * both)[:, None]], 1).float()
        # in float64 the order of sums does not matter: equal contacts of a lattice stay equal
        exact = latent.double()
        total = exact.new_zeros(bodies, latent.shape[1])
        from_a, from_b = weight_a[:, None] * exact, weight_b[:, None] * exact
        total = total.index_add(0, a, from_a).index_add(0, b, from_b)
        # the fixed body tells nothing
        total = torch.cat([total[:-1], torch.zeros_like(total[-1:])])
        moving = (b < bodies - 1)[:, None]
        around = (total[a] - from_a + total[b] - moving * from_b).float()
        latent = latent + self.rounds[index](latent, around, seen)
        raw = torch.tanh(self.heads[index](latent)).to(feel.lacking.dtype)
        # a contact that shares no body with one that presses keeps the exact step
        shared = 1.0 - 1.0 / feel.load
        return latent, Tuning(
            pace=torch.exp(shared * raw[:, 0]),
            pace_slip=torch.exp(shared * raw[:, 1]),
            momentum=shared * (MOMENTUM + (1.0 - MOMENTUM) * 0.9 * raw[:, 2]),
            raw=raw[:, 3],
        )
