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

"""Impulses of all contacts of a substep, by rounds of a law whose pace the network sets.

The same as models/contact/solver.py: every round recomputes what each contact feels of the others
and takes a damped step (mass splitting) towards the law of one contact.
"""

from __future__ import annotations

import math

import numpy as np

from .contacts import Contacts
from .impulses import begin, Bodies, Impulses, own_slip, slip_now
from .law import Law
from .layers import turn_over
from .network import gather_latents, plain, read_round, tune, Weights
from .rounds import compare, look_ahead, new_rounds, Rounds, slip_of_others
from .steps import press, resist_rolling, resist_slip
from .world import UNIT_GRAVITY, World
from ..gns.config import ROUND_FEATURES
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import add_to, length, minus, plus, put, row, times
from ..scenes.state import Array


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
    weights: Weights,
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
        rounds: M, rounds of message passing.
        enough: Speed; a round that changes every contact by less is the last. 0: all rounds.
        weights: Of the network; none: the law alone.
        made: Impulses, written.
    """
    if len(group) == 0:
        return np.empty(0)
    learned = len(weights.rounds) > 0
    r = new_rounds(group, weights.encoder.shape[1])
    begin(world, c, law, group, support, bodies, made)
    look_ahead(world, c, law, bodies, made, r, h, pace, weights)
    begin(world, c, law, group, start, bodies, made)
    for q, k in enumerate(group):
        r.last_normal[q] = made.normal[k]
        put(r.last_tangential, q, row(made.tangential, k))
        if learned:
            put(r.start_slip, q, slip_of_others(world, c, law, bodies, made, r, q))
    for index in range(rounds):
        compare(world, c, law, bodies, made, r, h, pace)
        if learned:
            _set_pace(world, c, law, bodies, made, r, pace, weights, index)
        else:
            plain(_loads(c, bodies, r), r.pace)
        press(world, c, bodies, made, r)
        resist_rolling(world, c, law, bodies, made, r)
        resist_slip(world, c, law, bodies, made, r)
        if enough > 0 and _last_change(law, made, r).max() < enough:
            break
    _displace(world, c, law, bodies, made, r)
    return _last_change(law, made, r)


@compiled
def _set_pace(
    world: World,
    c: Contacts,
    law: Law,
    bodies: Bodies,
    made: Impulses,
    r: Rounds,
    pace: float,
    weights: Weights,
    index: int,
) -> None:
    """Pass messages for one round."""
    fixed, width = len(bodies.load) - 1, len(r.latent)
    inputs = np.empty((2 * width + ROUND_FEATURES, len(r.group)), np.float32)
    rows = np.empty((len(r.group), width), np.float32)
    turn_over(r.latent, rows)
    gather_latents(c, r.group, rows, r.weight, fixed, bodies.total)
    for i in range(width):
        for q in range(len(r.group)):
            inputs[i, q] = r.latent[i, q]
    turn_over(rows, inputs[width : 2 * width])
    load = _loads(c, bodies, r)
    for q, k in enumerate(r.group):
        slip = slip_now(c, law, bodies, k)
        other = minus(minus(slip, row(r.free_slip, q)), own_slip(world, c, law, made, k))
        read_round(
            r.lacking[q],
            length(minus(slip, row(r.drag, q))),
            made.normal[k] * law.unit[k],
            r.others[q] - r.start_others[q],
            length(minus(other, row(r.start_slip, q))),
            load[q],
            UNIT_GRAVITY * pace,
            inputs[2 * width :, q],
        )
    tune(weights, index, inputs, load, r.latent, r.pace)


@compiled
def _loads(c: Contacts, bodies: Bodies, r: Rounds) -> Array:
    """Contacts that press on the more loaded body of each contact, shape (c,)."""
    load = np.empty(len(r.group))
    for q, k in enumerate(r.group):
        load[q] = max(bodies.load[c.a[k]], bodies.load[c.b[k]])
    return load


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
