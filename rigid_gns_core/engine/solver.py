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

"""Impulses of all contacts of a substep, by rounds of the law of one contact.

Every round recomputes what each contact feels of the others
and takes a damped step (mass splitting) towards the law of one contact.
"""

from __future__ import annotations

import math

import numpy as np

from .contacts import Contacts
from .impulses import begin, Bodies, Impulses
from .law import Law
from .rounds import compare, look_ahead, new_rounds, Rounds
from .steps import press, resist_rolling, resist_slip
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import add_to, plus, put, row, times
from ..scenes.state import Array

# share of a round's step that the next one repeats: halves the rounds of piles
MOMENTUM = 0.5


@compiled
def solve(
    world: World,
    c: Contacts,
    law: Law,
    group: Indices,
    bodies: Bodies,
    start: Impulses,
    support: Impulses,
    h: float,
    pace: float,
    rounds: int,
    enough: float,
    made: Impulses,
) -> Array:
    """Solve some contacts of a substep; returns the speed by which the last round changed each.

    Args:
        world: What does not move.
        c: Contacts.
        law: Their coefficients.
        group: Those to solve; no other contact may have one of their moving bodies.
        bodies: Changes of theirs are written.
        start: Impulses to start from, those of the last substep where contacts persist.
        support: Impulses that last, where they are not those to start from.
        h: Length of the substep; 0 for one that only mends what the last one missed.
        pace: Length of a substep as such, to which speeds are compared.
        rounds: M.
        enough: Speed; a round that changes every contact by less is the last. 0: all rounds.
        made: Impulses, written.
    """
    if len(group) == 0:
        return np.empty(0)
    r = new_rounds(group)
    begin(world, c, law, group, support, bodies, made)
    look_ahead(c, law, bodies, made, r)
    begin(world, c, law, group, start, bodies, made)
    for q, k in enumerate(group):
        r.last_normal[q] = made.normal[k]
        put(r.last_tangential, q, row(made.tangential, k))
    for _ in range(rounds):
        compare(world, c, law, bodies, made, r, h, pace)
        _set_momentum(c, bodies, r)
        press(world, c, bodies, made, r)
        resist_rolling(world, c, law, bodies, made, r)
        resist_slip(world, c, law, bodies, made, r)
        if enough > 0 and _last_change(law, made, r).max() < enough:
            break
    _displace(world, c, law, bodies, made, r)
    return _last_change(law, made, r)


@in_place
def _set_momentum(c: Contacts, bodies: Bodies, r: Rounds) -> None:
    """A contact that shares no body with one that presses keeps the exact step."""
    for q, k in enumerate(r.group):
        load = max(bodies.load[c.a[k]], bodies.load[c.b[k]])
        r.momentum[q] = MOMENTUM * (1.0 - 1.0 / load)


@compiled
def _last_change(law: Law, made: Impulses, r: Rounds) -> Array:
    """Speed by which the last round changed each contact, shape (c,)."""
    change = np.empty(len(r.group))
    for q, k in enumerate(r.group):
        change[q] = math.fabs(made.normal[k] - r.last_normal[q]) * law.unit[k]
    return change


@in_place
def _displace(
    world: World, c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds
) -> None:
    """Displacements beyond those of free flight.

    What a contact alone would get acts as if at its lever before the end; what others add to it is
    spread over the rest of the substep.
    """
    for k in r.group:
        put(bodies.moved, c.a[k], (0.0, 0.0, 0.0))
        put(bodies.moved, c.b[k], (0.0, 0.0, 0.0))
    for q, k in enumerate(r.group):
        a, b = c.a[k], c.b[k]
        alone, lever, rest = row(r.aim, q)
        share = min(made.normal[k], alone / law.unit[k]) / max(made.normal[k], 1e-30)
        lever = share * lever + (1.0 - share) * 0.5 * rest
        impulse = plus(times(made.normal[k], row(c.normal, k)), row(made.tangential, k))
        add_to(bodies.moved, a, times(lever * world.inverse_mass[a], impulse))
        add_to(bodies.moved, b, times(-lever * world.inverse_mass[b], impulse))
