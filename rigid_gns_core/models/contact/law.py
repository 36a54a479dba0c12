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

"""The law of one isolated contact: what it would come to, whatever else there is."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .geometry import Contacts
from .world import UNIT_GRAVITY, World

# approach speeds below this do not bounce: as the teacher, 3 g dt / 240
_QUIET = 3.0 * UNIT_GRAVITY * 0.1 / 240.0


class Law:
    """Coefficients of the contacts of one substep.

    Args:
        world: What does not move.
        contacts: Of the substep.
        h: Its length; 0 for one that only mends what the last one missed.
        pace: Length of a substep as such, to which speeds are compared.
    """

    def __init__(self, world: World, contacts: Contacts, h: float, pace: float) -> None:
        self.world, self.contacts, self.h, self.pace = world, contacts, h, pace
        a, b, plane = contacts.a, contacts.b, contacts.plane
        fixed = plane >= 0
        which = plane.clamp(min=0)
        has_planes = len(world.surface_restitution) > 0

        def pair(own: Tensor, surface: Tensor) -> Tensor:
            other = torch.cat([own, own.new_zeros(1)])[b]
            if has_planes:
                other = torch.where(fixed, surface[which], other)
            return own[a] * other

        self.fixed = fixed
        self.restitution = pair(world.restitution, world.surface_restitution)
        self.friction = pair(world.friction, world.surface_friction)
        self.rolling = torch.where(fixed, (world.rolling_friction * world.radius[:-1])[a], 0.0)
        self.rolls = bool((self.rolling > 0).any())
        self.inverse_a, self.inverse_b = world.inverse_mass[a], world.inverse_mass[b]
        self.arm_a = world.radius[a] + torch.where(fixed, contacts.gap, 0.5 * contacts.gap)
        self.arm_b = torch.where(fixed, 0.0, world.radius[b] + 0.5 * contacts.gap)
        self.spin_a = self.arm_a.square() * world.inverse_inertia[a]
        self.spin_b = self.arm_b.square() * world.inverse_inertia[b]


class Aim(NamedTuple):
    """What contacts would come to, each alone, under what pulls at it now; shape (c,) each.

    hit: whether they touch at all; parting: normal velocity at the end of the substep; flying:
    whether they are then apart after a bounce; airborne: time since that bounce; impulse: normal
    impulse over reduced mass; lever: time before the end at which that impulse, acting at once,
    leads to the same place; rest: what is left of the substep after the impact.
    """

    hit: Tensor
    parting: Tensor
    flying: Tensor
    airborne: Tensor
    impulse: Tensor
    lever: Tensor
    rest: Tensor


def aim_of(law: Law, approach: Tensor, extra: Tensor) -> Aim:
    """Return the law of one isolated contact along its normal.

    On a surface that pulls, a sphere bounces with e times the speed of each approach, in flights
    whose times are a geometric series, until it approaches slower than `_QUIET` and rests. So
    small bounces need no small substeps.

    Args:
        law: Coefficients.
        approach: Speed of approach at the time of impact on the free path, shape (c,).
        extra: Relative acceleration along the normal that other contacts make, shape (c,). It
            shifts the time of impact, or prevents it: a sphere that others hold does not fall.
    """
    contacts, e, h = law.contacts, law.restitution, law.h
    pull = contacts.pull + extra
    before = contacts.time.clamp(min=0.0)
    gap = contacts.open + 0.5 * extra * before.square()
    closing = approach - extra * before
    root = closing.square() - 2.0 * pull * gap
    sum_of = closing + root.clamp(min=1e-24).sqrt()
    later = torch.where(gap == 0, 0.0, 2.0 * gap / torch.where(sum_of > 1e-12, sum_of, 1.0))
    hit = ((before == 0) & (gap == 0)) | ((root >= 0) & (sum_of > 1e-12) & (before + later <= h))
    later = torch.where(hit, torch.maximum(later, -before), 0.0)
    approach = closing - pull * later
    rest = (h - before - later).clamp(min=0.0)
    pull = (-pull).clamp(min=0.0)
    late = (before - contacts.time) * approach.clamp(min=0.0)  # how far they went too deep
    loud = approach > _QUIET
    speed = (e * approach).clamp(min=1e-12)
    one_less = (1.0 - e).clamp(1e-6, 1.0 - 1e-6)
    log_e = torch.log1p(-one_less)
    with torch.no_grad():
        left = 1.0 - rest * pull * one_less / (2.0 * speed)
        flights = torch.floor(left.clamp(min=1e-30).log() / log_e).clamp(min=0.0)
        allowed = torch.ceil(torch.log(_QUIET / approach.clamp(min=_QUIET)) / log_e)
        flying = loud & (e > 1e-3) & (left > 0) & (flights < allowed)
        flights = torch.where(flying, flights, 0.0)
    damping = torch.exp(flights * log_e)
    spent = 2.0 * speed / pull.clamp(min=1e-9) * (1.0 - damping) / one_less
    airborne = torch.where(flying, rest - torch.where(flights > 0, spent, 0.0), 0.0)
    last = speed * damping
    parting = torch.where(flying, last - pull * airborne, 0.0)
    height = torch.where(flying, last * airborne - 0.5 * pull * airborne.square(), 0.0)
    closing = approach.clamp(min=0.0)
    impulse = parting + closing + pull * rest
    fallen = closing * rest + 0.5 * pull * rest.square()
    late = late * torch.where(flying, 1.0 + e, 1.0)
    lever = (height + fallen + late) / impulse.clamp(min=1e-9)
    return Aim(hit, parting, flying, airborne, impulse, lever, rest)
