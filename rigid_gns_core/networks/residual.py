# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The residual network in torch, for its training; `engine/learned_network.py` states it.

Names of parameters are those of the weights file, which the engine reads without torch.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from torch import nn, Tensor

from ..engine.learned_contacts import FEATURES, LearnedContacts
from ..engine.learned_network import OUTPUTS
from ..engine.options import ResidualConfig
from ..engine.springs import SPRINGS

# range of the features before any is known
_NO_BOUND = 1e30


@dataclass
class Contacts:
    """Contacts of one frame or of several, one after the other, as tensors.

    count: spheres, n, of all frames; features: seen from one side, shape (e, FEATURES); own,
    other: spheres of each side, n for a surface, shape (e,); normal, slip: seen from it, shape
    (e, 3); a, b: spheres of each contact, n for a surface, shape (c,); sides: its two sides, e for
    the second one of a surface, shape (c, 2); roll: shape (c, 3); spin, scale: shape (c,).
    """

    count: int
    features: Tensor
    own: Tensor
    other: Tensor
    normal: Tensor
    slip: Tensor
    a: Tensor
    b: Tensor
    sides: Tensor
    roll: Tensor
    spin: Tensor
    scale: Tensor

    @classmethod
    def of(cls, frames: list[LearnedContacts], counts: list[int]) -> Contacts:
        """Contacts of frames with so many spheres each."""
        count, sizes = sum(counts), [len(one.a) for one in frames]
        shift = np.repeat(np.cumsum([0, *counts[:-1]]), sizes)

        def joined(name: str) -> Any:
            return np.concatenate([getattr(one, name) for one in frames])

        a, b = joined('a') + shift, joined('b')
        fixed = b < 0
        b = np.where(fixed, count, b + shift)
        features, normal, slip = joined('features'), joined('normal'), joined('slip')
        pairs = np.flatnonzero(~fixed)
        sides = np.full((len(a), 2), len(a) + len(pairs))
        sides[:, 0] = np.arange(len(a))
        sides[pairs, 1] = len(a) + np.arange(len(pairs))

        def numbers(values: Any) -> Tensor:
            return torch.as_tensor(values, dtype=torch.float32)

        return cls(
            count=count,
            features=numbers(np.concatenate([features[:, 0], features[pairs, 1]])),
            own=torch.as_tensor(np.concatenate([a, b[pairs]])),
            other=torch.as_tensor(np.concatenate([b, a[pairs]])),
            normal=numbers(np.concatenate([normal, -normal[pairs]])),
            slip=numbers(np.concatenate([slip, -slip[pairs]])),
            a=torch.as_tensor(a),
            b=torch.as_tensor(b),
            sides=torch.as_tensor(sides),
            roll=numbers(joined('roll')),
            spin=numbers(joined('spin')),
            scale=numbers(joined('scale')),
        )


@dataclass
class Bodies:
    """Properties of the spheres of all frames, and of surfaces last, shape (n + 1,) each."""

    radius: Tensor
    inverse_mass: Tensor
    inverse_inertia: Tensor = field(repr=False)


class _Exchange(nn.Module):
    def __init__(self, width: int, vectors: int) -> None:
        super().__init__()
        self.edge = nn.Linear(width + 4 * vectors, width)
        self.own = nn.Linear(width, width, bias=False)
        self.other = nn.Linear(width, width, bias=False)
        self.vectors = nn.Linear(width, 2 * vectors)

    def forward(self, edges: Tensor, contacts: Contacts) -> Tensor:
        own, other, rows = contacts.own, contacts.other, contacts.count + 1
        sums = edges.new_zeros(rows, edges.shape[1]).index_add(0, own, edges)
        along, across = self.vectors(edges).chunk(2, dim=1)
        normal, slip = contacts.normal[:, :, None], contacts.slip[:, :, None]
        pushes = along[:, None, :] * normal + across[:, None, :] * slip  # (e, 3, K)
        total = edges.new_zeros(rows, *pushes.shape[1:]).index_add(0, own, pushes)
        mine, theirs = total[own], total[other]
        seen = [(one * axis).sum(1) for one in (mine, theirs) for axis in (normal, slip)]
        inner = self.edge(torch.cat([edges, *seen], dim=1))
        return torch.relu(inner + self.own(sums)[own] + self.other(sums)[other])


class ResidualNetwork(nn.Module):
    """The residual network; see `engine/learned_network.py`."""

    stiffness: Tensor
    springs: Tensor
    strength: Tensor
    low: Tensor
    high: Tensor
    mean: Tensor
    deviation: Tensor

    def __init__(self, config: ResidualConfig) -> None:
        super().__init__()
        width = config.width
        self.register_buffer('stiffness', torch.zeros(1))
        self.register_buffer('springs', torch.zeros(SPRINGS))
        self.register_buffer('strength', torch.ones(1))
        self.register_buffer('low', torch.full((FEATURES,), -_NO_BOUND))
        self.register_buffer('high', torch.full((FEATURES,), _NO_BOUND))
        self.register_buffer('mean', torch.zeros(FEATURES))
        self.register_buffer('deviation', torch.ones(FEATURES))
        self.first, self.second = nn.Linear(FEATURES, width), nn.Linear(width, width)
        self.exchange = _Exchange(width, config.vectors)
        self.exchange_again = _Exchange(width, config.vectors)
        self.last, self.out = nn.Linear(width, width), nn.Linear(width, OUTPUTS)
        with torch.no_grad():  # begin near the laws
            self.out.weight.mul_(0.1)
            self.out.bias.zero_()

    def forward(self, contacts: Contacts) -> Tensor:
        """Outputs of each contact, before their bounds; shape (c, OUTPUTS)."""
        edges = (contacts.features - self.mean) / self.deviation
        edges = torch.relu(self.second(torch.relu(self.first(edges))))
        edges = self.exchange_again(self.exchange(edges, contacts), contacts)
        sides = self.out(torch.relu(self.last(edges)))
        none = sides.new_zeros(1, OUTPUTS)
        return torch.cat([sides, none])[contacts.sides].sum(1)


def changes(
    outputs: Tensor, contacts: Contacts, bodies: Bodies, dt: float
) -> tuple[Tensor, Tensor, Tensor]:
    """Changes of position, velocity and spin of the spheres, shape (n, 3) each.

    As `engine/learned_impulses.py`, without the limits of displacements.
    """
    size = contacts.scale[:, None]
    bounded = size * torch.tanh(outputs)
    pairs = len(contacts.a)
    n, t = contacts.normal[:pairs], contacts.slip[:pairs]
    impulse = bounded[:, 0:1] * n + bounded[:, 1:2] * t
    way = dt * (bounded[:, 2:3] * n + bounded[:, 3:4] * t)
    radius_b = bodies.radius[contacts.b]
    mean = torch.where(
        contacts.b == contacts.count,
        bodies.radius[contacts.a],
        0.5 * (bodies.radius[contacts.a] + radius_b),
    )
    turn = bounded[:, 4:5] * contacts.roll + bounded[:, 5:6] * contacts.spin[:, None] * n
    turn = mean[:, None] * turn
    lever = torch.linalg.cross(n, impulse)

    def summed(of_a: Tensor, of_b: Tensor, by: Tensor) -> Tensor:
        total = of_a.new_zeros(contacts.count + 1, 3)
        total = total.index_add(0, contacts.a, of_a).index_add(0, contacts.b, of_b)
        return (by[:, None] * total)[:-1]

    positions = summed(way, -way, bodies.inverse_mass)
    velocities = summed(impulse, -impulse, bodies.inverse_mass)
    arm_a, arm_b = bodies.radius[contacts.a][:, None], radius_b[:, None]
    spins = summed(turn - arm_a * lever, -turn - arm_b * lever, bodies.inverse_inertia)
    return positions, velocities, spins
