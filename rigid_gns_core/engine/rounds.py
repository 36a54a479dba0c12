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

"""What each contact lacks of its law, and what the others make of it, round by round."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .contacts import Contacts
from .impulses import Bodies, Impulses, parting_of
from .law import Aim, aim_of, Law
from .world import UNIT_GRAVITY, World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import across, dot, minus, put, row, times
from ..scenes.state import Array

# contacts with this part of the force of a body's strongest count half
_FAINT = 0.01


class Rounds(NamedTuple):
    """Contacts that are solved, and what is known of each from round to round.

    group: which contacts, shape (c,); approach, free_parting: of their free paths;
    start_others: what the others made of them at the start; others: and now; lacking:
    what its normal velocity lacks; pressing: whether it presses; weight: how much it counts at a
    and b, 0 to 1, shape (c, 2); drag: what gravity does to the
    slip of a sphere that bounced; momentum: share of the last step that is repeated; last_normal,
    last_tangential: impulses before the last step; aim: impulse, lever and rest of the last round,
    shape (c, 3); step: to add, shape (c, 3).
    """

    group: Indices
    approach: Array
    free_parting: Array
    start_others: Array
    others: Array
    lacking: Array
    pressing: NDArray[np.bool_]
    weight: Array
    drag: Array
    momentum: Array
    last_normal: Array
    last_tangential: Array
    aim: Array
    step: Array


@compiled
def new_rounds(group: Indices) -> Rounds:
    """Nothing is known yet of the contacts of `group`."""
    size = len(group)
    one, three = np.zeros((7, size)), np.zeros((4, size, 3))
    return Rounds(
        group=group,
        approach=one[0],
        free_parting=one[1],
        start_others=one[2],
        others=one[3],
        lacking=one[4],
        pressing=np.zeros(size, np.bool_),
        weight=np.zeros((size, 2)),
        drag=three[0],
        momentum=one[5],
        last_normal=one[6],
        last_tangential=three[1],
        aim=three[2],
        step=three[3],
    )


@in_place
def look_ahead(c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds) -> None:
    """Find what free paths bring to each contact, and what the others make of that."""
    for q, k in enumerate(r.group):
        a, b, normal = c.a[k], c.b[k], row(c.normal, k)
        before = minus(row(bodies.before, a), row(bodies.before, b))
        r.approach[q] = -dot(normal, before) - max(c.time[k], 0.0) * c.pull[k]
        one, other = row(bodies.velocity, a), row(bodies.velocity, b)
        r.free_parting[q] = dot(normal, minus(one, other))
        r.start_others[q] = _others(law, made, r, q, parting_of(c, bodies, k))


@in_place
def _aim(c: Contacts, law: Law, r: Rounds, q: int, h: float, extra: float) -> Aim:
    k = r.group[q]
    return aim_of(law.restitution[k], h, c.time[k], c.open[k], r.approach[q], c.pull[k], extra)


@in_place
def _others(law: Law, made: Impulses, r: Rounds, q: int, parting: float) -> float:
    """Change of normal velocity, which is `parting` now, that the other contacts make."""
    k = r.group[q]
    return parting - r.free_parting[q] - made.normal[k] * law.unit[k]


@in_place
def _common(one: float, other: float) -> float:
    """Return the smaller of two numbers of one sign, else 0."""
    if one * other > 0:
        return math.copysign(min(math.fabs(one), math.fabs(other)), one)
    return 0.0


@in_place
def compare(
    world: World,
    c: Contacts,
    law: Law,
    bodies: Bodies,
    made: Impulses,
    r: Rounds,
    h: float,
    pace: float,
) -> None:
    """Find what each contact lacks of its law, and how many press on each body.

    The strongest of a body counts 1, one of no force nothing, so that contacts that carry nothing
    change nothing.
    """
    gravity = (world.gravity[0], world.gravity[1], world.gravity[2])
    least = 1e-9 * UNIT_GRAVITY * pace
    for k in r.group:
        bodies.load[c.a[k]] = bodies.load[c.b[k]] = 0.0
        bodies.most[c.a[k]] = bodies.most[c.b[k]] = 1e-30
    for q, k in enumerate(r.group):
        parting = parting_of(c, bodies, k)
        r.others[q] = _others(law, made, r, q, parting)
        extra = _common(r.start_others[q], r.others[q]) / h if h > 0 else 0.0
        aim = _aim(c, law, r, q, h, extra)
        put(r.aim, q, (aim.impulse, aim.lever, aim.rest))
        if c.plane[k] >= 0:
            put(r.drag, q, times(aim.airborne, across(gravity, row(c.normal, k))))
        r.lacking[q] = aim.parting - parting
        r.pressing[q] = aim.hit and (made.normal[k] > 0 or r.lacking[q] > least)
        # a strength until the strongest of each body is known
        carried = made.normal[k] * law.unit[k] + math.fabs(r.lacking[q])
        r.weight[q, 0] = carried if r.pressing[q] else 0.0
        for body in (c.a[k], c.b[k]):
            bodies.most[body] = max(bodies.most[body], r.weight[q, 0])
    for q, k in enumerate(r.group):
        strength = r.weight[q, 0]
        for side, body in enumerate((c.a[k], c.b[k])):
            r.weight[q, side] = (1.0 + _FAINT) * strength / (strength + _FAINT * bodies.most[body])
            bodies.load[body] += r.weight[q, side]
    bodies.load[-1] = 1.0
    for k in r.group:
        bodies.load[c.a[k]] = max(bodies.load[c.a[k]], 1.0)
        bodies.load[c.b[k]] = max(bodies.load[c.b[k]], 1.0)
