# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""How contacts that share a body couple, and into how many parts each body is split for them.

A unit impulse at contact k changes the velocity at contact l of the same body by the block C_kl.
With m_k the normal into the body, c = m_k . m_l and l^2 / I its rotation (r^2 / I for a sphere):

    normal:    C_kl = c / m
    friction: |C_kl| = max(|1 / m + c l^2 / I|, |c / m + l^2 / I|)

Steps of all contacts at once cannot overshoot if contact k counts a body as sum_l |C_kl| / C_kk
parts, since D - A is then diagonally dominant (Gershgorin): contacts at right angles do not damp
each other, contacts in line halve each other, as in mass splitting.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .contact_law import Law
from .contacts import Contacts
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import counting_sort, Indices
from ..kernels.vector import dot, row
from ..scenes.state import Array


class Couplings(NamedTuple):
    """Contacts of a group that share a body, for each contact and each of its bodies.

    start: where those of side s of contact q begin, at 2 q + s, shape (2 c + 1,); other: index in
    the group, shape (e,); side: of the other contact that the body is on; normal, friction: size
    of the coupling, over that with itself; shape (e,).
    """

    start: Indices
    other: Indices
    side: Indices
    normal: Array
    friction: Array


@compiled
def find_couplings(
    world: World, contacts: Contacts, law: Law, group: Indices, number: Indices
) -> Couplings:
    """Couplings among the contacts of `group`; the fixed body couples none.

    Args:
        world: What does not move.
        contacts: All contacts of the substep.
        law: Their coefficients.
        group: Indices of those to couple.
        number: Of each body, -1 for all, shape (n + 1,); used, and left as it was.
    """
    size, fixed = len(group), len(world.restitution)
    number[fixed] = 0
    bodies, body = 1, np.empty(2 * size, np.int64)
    for end in range(2 * size):
        k = group[end // 2]
        i = contacts.a[k] if end % 2 == 0 else contacts.b[k]
        if number[i] < 0:
            number[i] = bodies
            bodies += 1
        body[end] = number[i]
    for k in group:
        number[contacts.a[k]] = number[contacts.b[k]] = -1
    number[fixed] = -1
    ends, begin = counting_sort(body, bodies)
    total = 0
    for i in range(1, bodies):
        total += (begin[i + 1] - begin[i]) ** 2
    start = np.zeros(2 * size + 1, np.int64)
    other, side = np.empty(total, np.int64), np.empty(total, np.int64)
    normal, friction = np.empty(total), np.empty(total)
    e = 0
    for end in range(2 * size):
        i = body[end]
        if i > 0:
            for p in range(begin[i], begin[i + 1]):
                other[e], side[e] = ends[p] // 2, ends[p] % 2
                k, m = group[end // 2], group[other[e]]
                normal[e], friction[e] = _sizes(world, contacts, law, k, end % 2, m, side[e])
                e += 1
        start[end + 1] = e
    return Couplings(start=start, other=other, side=side, normal=normal, friction=friction)


@compiled
def no_couplings(size: int) -> Couplings:
    """Couplings of contacts that share no body."""
    none = np.empty(0, np.int64)
    return Couplings(
        start=np.zeros(2 * size + 1, np.int64),
        other=none,
        side=none,
        normal=np.empty(0),
        friction=np.empty(0),
    )


@in_place
def _sizes(
    world: World, contacts: Contacts, law: Law, k: int, side_k: int, m: int, side_m: int
) -> tuple[float, float]:
    """Coupling of contacts k and m at a body, along their normals and across them."""
    c = dot(row(contacts.normal, k), row(contacts.normal, m))
    if side_k != side_m:
        c = -c
    i = contacts.a[k] if side_k == 0 else contacts.b[k]
    arm_k = law.arm_a[k] if side_k == 0 else law.arm_b[k]
    arm_m = law.arm_a[m] if side_m == 0 else law.arm_b[m]
    mass, turn = world.inverse_mass[i], arm_k * arm_m * world.inverse_inertia[i]
    most = max(math.fabs(mass + c * turn), math.fabs(c * mass + turn))
    return math.fabs(c), most / (mass + arm_k * arm_k * world.inverse_inertia[i])


@in_place
def split_bodies(
    couplings: Couplings, law: Law, group: Indices, weight: Array, normal_out: Array,
    friction_out: Array, rolling_out: Array,
) -> None:  # fmt: skip
    """Parts into which each body is split for each contact, at least 1.

    The torques of rolling friction couple wholly.

    Args:
        couplings: Of the contacts.
        law: Coefficients of all contacts.
        group: Which of them these are, shape (c,).
        weight: How much each counts at its two bodies, 0 to 1, shape (c, 2).
        normal_out: For normal impulses, shape (c, 2); written.
        friction_out: For friction impulses, shape (c, 2); written.
        rolling_out: Of body a for rolling friction, shape (c,); written.
    """
    for q in range(len(group)):
        for own in range(2):
            normal, friction, rolling = 0.0, 0.0, 0.0
            for e in range(couplings.start[2 * q + own], couplings.start[2 * q + own + 1]):
                share = weight[couplings.other[e], couplings.side[e]]
                normal += share * couplings.normal[e]
                friction += share * couplings.friction[e]
                m = group[couplings.other[e]]
                resists = law.rolling[m] + law.rolling_slope[m] + law.spinning[m] > 0
                rolling += share if resists else 0.0
            normal_out[q, own], friction_out[q, own] = max(normal, 1.0), max(friction, 1.0)
            if own == 0:
                rolling_out[q] = max(rolling, 1.0)
