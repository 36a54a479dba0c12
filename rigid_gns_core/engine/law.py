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

import math
from typing import NamedTuple

import numpy as np

from .contacts import Contacts
from .world import UNIT_GRAVITY, World
from ..kernels.jit import compiled, in_place
from ..scenes.state import Array

# approach speeds below this do not bounce: as the teacher, 3 g dt / 240
_QUIET = 3.0 * UNIT_GRAVITY * 0.1 / 240.0


class Law(NamedTuple):
    """Coefficients of the contacts of one substep, shape (c,) each.

    restitution, friction: of the pair; rolling: rho r [lengths], 0 between spheres; unit: change
    of normal velocity by a unit impulse; arm_a, arm_b: from centre to contact point; spin_a,
    spin_b: arm^2 / inertia.
    """

    restitution: Array
    friction: Array
    rolling: Array
    unit: Array
    arm_a: Array
    arm_b: Array
    spin_a: Array
    spin_b: Array


class Aim(NamedTuple):
    """What a contact would come to, alone, under what pulls at it now.

    hit: whether the bodies touch at all; parting: normal velocity at the end of the substep;
    flying: whether they are then apart after a bounce; airborne: time since that bounce; impulse:
    normal impulse over reduced mass; lever: time before the end at which that impulse, acting at
    once, leads to the same place; rest: what is left of the substep after the impact.
    """

    hit: bool
    parting: float
    flying: bool
    airborne: float
    impulse: float
    lever: float
    rest: float


@compiled
def law_of(world: World, contacts: Contacts) -> Law:
    """Coefficients of contacts: those of a pair are products."""
    size = len(contacts.a)
    own = np.empty((8, size))
    for k in range(size):
        a, b, plane, gap = contacts.a[k], contacts.b[k], contacts.plane[k], contacts.gap[k]
        if plane >= 0:
            restitution, friction = world.surface_restitution[plane], world.surface_friction[plane]
            own[2, k] = world.rolling_friction[a] * world.radius[a]
            own[4, k], own[5, k] = world.radius[a] + gap, 0.0
        else:
            restitution, friction = world.restitution[b], world.friction[b]
            own[2, k] = 0.0
            own[4, k], own[5, k] = world.radius[a] + 0.5 * gap, world.radius[b] + 0.5 * gap
        own[0, k] = world.restitution[a] * restitution
        own[1, k] = world.friction[a] * friction
        own[3, k] = world.inverse_mass[a] + world.inverse_mass[b]
        own[6, k] = own[4, k] * own[4, k] * world.inverse_inertia[a]
        own[7, k] = own[5, k] * own[5, k] * world.inverse_inertia[b]
    return Law(own[0], own[1], own[2], own[3], own[4], own[5], own[6], own[7])


@in_place
def aim_of(
    e: float, h: float, time: float, gap: float, approach: float, pull: float, extra: float
) -> Aim:
    """Return the law of one isolated contact along its normal.

    On a surface that pulls, a sphere bounces with e times the speed of each approach, in flights
    whose times are a geometric series, until it approaches slower than `_QUIET` and rests. So
    small bounces need no small substeps.

    Args:
        e: Restitution.
        h: Length of the substep.
        time: Of impact, on the free path.
        gap: Of the contact if it is open, else 0.
        approach: Speed of approach at the time of impact.
        pull: Relative acceleration along the normal.
        extra: Relative acceleration along the normal that other contacts make. It shifts the time
            of impact, or prevents it: a sphere that others hold does not fall.
    """
    pull += extra
    before = max(time, 0.0)
    gap += 0.5 * extra * before * before
    closing = approach - extra * before
    root = closing * closing - 2.0 * pull * gap
    sum_of = closing + math.sqrt(max(root, 1e-24))
    later, hit = 0.0, before == 0 and gap == 0
    if gap != 0:
        later = 2.0 * gap / (sum_of if sum_of > 1e-12 else 1.0)
    if not hit:
        hit = root >= 0 and sum_of > 1e-12 and before + later <= h
    later = max(later, -before) if hit else 0.0
    approach = closing - pull * later
    rest = max(h - before - later, 0.0)
    down = max(-pull, 0.0)
    closing = max(approach, 0.0)
    late = (before - time) * closing  # how far they went too deep
    fallen = closing * rest + 0.5 * down * rest * rest
    parting, height, airborne, flying = 0.0, 0.0, 0.0, False
    if approach > _QUIET and e > 1e-3:
        one_less = min(max(1.0 - e, 1e-6), 1.0 - 1e-6)
        speed = max(e * approach, 1e-12)
        left = 1.0 - rest * down * one_less / (2.0 * speed)
        if left > 0:
            log_e = math.log1p(-one_less)
            flights = max(math.floor(math.log(max(left, 1e-30)) / log_e), 0.0)
            flying = flights < math.ceil(math.log(_QUIET / approach) / log_e)
            if flying:
                damping = math.exp(flights * log_e)
                airborne = rest
                if flights > 0:
                    airborne -= 2.0 * speed / max(down, 1e-9) * (1.0 - damping) / one_less
                last = speed * damping
                parting = last - down * airborne
                height = last * airborne - 0.5 * down * airborne * airborne
    impulse = parting + closing + down * rest
    if flying:
        late *= 1.0 + e
    lever = (height + fallen + late) / max(impulse, 1e-9)
    return Aim(hit, parting, flying, airborne, impulse, lever, rest)
