"""The learned part: a graph network on contacts, which tunes what each contact aims at.

Nodes of its graph are the contacts and the bodies between them. Contacts read invariant scalars
only, so the model turns with the scene about gravity, and the two bodies of a contact play the same
part, so that Newton's third law stays exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from ..layers import MLP

FEATURES = 17
ROUND_FEATURES = 7


@dataclass(frozen=True)
class ContactConfig:
    """The contact model.

    Args:
        substeps: K, substeps of a frame in which something may touch.
        rounds: M, rounds of message passing in a substep.
        width: Width of the latents.
        network: False: the law alone.
        law: False: no law of isolated contacts; the network finds impulses from nothing (ablation).
    """

    substeps: int = 4
    rounds: int = 6
    width: int = 24
    network: bool = True
    law: bool = True

    def __post_init__(self) -> None:
        for name in ('substeps', 'rounds', 'width'):
            if getattr(self, name) < 1:
                raise ValueError(f'{name} is {getattr(self, name)}, expected at least 1')
        if not (self.network or self.law):
            raise ValueError('network and law are both off, so nothing is left; switch one on')


class Feel(NamedTuple):
    """What each contact sees in a round; shape (c,) each, speeds.

    lacking: what its normal velocity lacks; slip: speed of slip; carried: its normal impulse as a
    change of speed; others, others_slip: change of its normal velocity (signed) and of its slip
    that the other contacts of its bodies make; load: contacts that press on its bodies.
    """

    lacking: Tensor
    slip: Tensor
    carried: Tensor
    others: Tensor
    others_slip: Tensor
    load: Tensor


class Tuning(NamedTuple):
    """Output of a round, shape (c,) each.

    normal, slip: shifts of the aimed normal velocity and slip speed; pace, pace_slip: factors on
    the damped steps towards them.
    """

    normal: Tensor
    slip: Tensor
    pace: Tensor
    pace_slip: Tensor


class ContactNetwork(nn.Module):
    """Encoder of contacts and M rounds, each with weights of its own.

    Zero-initialised outputs: an untrained network leaves the law as it is.
    """

    def __init__(self, config: ContactConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        self.encoder = MLP((FEATURES,), width, width)
        self.rounds = nn.ModuleList(
            MLP((width, width, ROUND_FEATURES), width, width) for _ in range(config.rounds)
        )
        self.heads = nn.ModuleList(nn.Linear(width, 4) for _ in range(config.rounds))
        for head in self.heads:
            nn.init.zeros_(head.weight)
            nn.init.zeros_(head.bias)

    def encode(self, features: Tensor) -> Tensor:
        """Latents of contacts, shape (c, width)."""
        return self.encoder(features.float())

    def round(
        self, index: int, latent: Tensor, feel: Feel, unit: Tensor, a: Tensor, b: Tensor, bodies: int
    ) -> tuple[Tensor, Tuning]:
        """One round of message passing.

        Args:
            index: Number of the round.
            latent: Of the contacts, shape (c, width).
            feel: What contacts see.
            unit: Speed that scales it, a scalar.
            a, b: Bodies of the contacts; the last body is fixed, shape (c,).
            bodies: n + 1.
        """
        scaled = torch.stack([torch.asinh(10.0 * value / unit) for value in feel[:5]], 1)
        load = feel.load.log()[:, None]
        both = (feel.others.abs() + feel.others_slip) / unit
        seen = torch.cat([scaled, load, torch.asinh(10.0 * both)[:, None]], 1).float()
        total = latent.new_zeros(bodies, latent.shape[1])
        total = total.index_add(0, a, latent).index_add(0, b, latent)
        total = torch.cat([total[:-1], torch.zeros_like(total[-1:])])  # the fixed body tells nothing
        around = total[a] + total[b] - latent
        latent = latent + self.rounds[index](latent, around, seen)
        raw = torch.tanh(self.heads[index](latent)).to(feel.lacking.dtype)
        felt = feel.others.abs() + feel.others_slip
        shared = 1.0 - 1.0 / feel.load  # contacts that share no body keep the exact step
        return latent, Tuning(
            normal=felt * raw[:, 0],
            slip=felt * raw[:, 1],
            pace=torch.exp(shared * raw[:, 2]),
            pace_slip=torch.exp(shared * raw[:, 3]),
        )
