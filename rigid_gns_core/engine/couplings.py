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
from .direct import MOST_CONTACTS
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import dot, row
from ..scenes.state import Array


class Couplings(NamedTuple):
    """Contacts of an island that share a body, for each contact and each of its bodies.

    start: where those of side s of contact k begin, at 2 k + s, shape (2 c + 1,); other: contact
    of the island; side: of it that the body is on; normal, friction: size of the coupling, over
    that with itself; shape (e,). head, next: scratch, the ends of contacts at each body as a list.
    """

    start: Indices
    other: Indices
    side: Indices
    normal: Array
    friction: Array
    head: Indices
    next: Indices


@compiled
def new_couplings(bodies: int) -> Couplings:
    """Room for those of a small island among so many bodies, to be written."""
    most = (2 * MOST_CONTACTS) * MOST_CONTACTS
    sizes, places = np.empty((2, most)), np.empty((2, most), np.int64)
    ends = np.empty((2, 2 * MOST_CONTACTS + 1), np.int64)
    return Couplings(
        start=ends[0],
        other=places[0],
        side=places[1],
        normal=sizes[0],
        friction=sizes[1],
        head=np.empty(bodies, np.int64),
        next=ends[1],
    )


@in_place
def find_couplings(world: World, contacts: Contacts, law: Law, couplings_out: Couplings) -> None:
    """Find the couplings among the contacts of a small island; the fixed body couples none.

    Args:
        world: What does not move.
        contacts: Those of the island, at most `MOST_CONTACTS`.
        law: Their coefficients.
        couplings_out: Written.
    """
    out, fixed, e, size = couplings_out, len(world.restitution), 0, len(contacts.a)
    for k in range(size):
        out.head[contacts.a[k]] = out.head[contacts.b[k]] = -1
    for end in range(2 * size - 1, -1, -1):
        i = contacts.a[end // 2] if end % 2 == 0 else contacts.b[end // 2]
        if i < fixed:
            out.next[end], out.head[i] = out.head[i], end
    for end in range(2 * size):
        i = contacts.a[end // 2] if end % 2 == 0 else contacts.b[end // 2]
        out.start[end] = e
        other = out.head[i] if i < fixed else -1
        while other >= 0:
            m, side = other // 2, other % 2
            out.other[e], out.side[e] = m, side
            out.normal[e], out.friction[e] = _sizes(
                world, contacts, law, end // 2, end % 2, m, side
            )
            e, other = e + 1, out.next[other]
    out.start[2 * size] = e


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
    couplings: Couplings,
    law: Law,
    weight: Array,
    normal_out: Array,
    friction_out: Array,
    rolling_out: Array,
) -> None:
    """Parts into which each body is split for each contact of an island, at least 1.

    The torques of rolling friction couple wholly.

    Args:
        couplings: Of the contacts.
        law: Their coefficients.
        weight: How much each counts at its two bodies, 0 to 1, shape (c, 2).
        normal_out: For normal impulses, shape (c, 2); written.
        friction_out: For friction impulses, shape (c, 2); written.
        rolling_out: Of body a for rolling friction, shape (c,); written.
    """
    for k in range(len(weight)):
        for own in range(2):
            normal, friction, rolling = 0.0, 0.0, 0.0
            for e in range(couplings.start[2 * k + own], couplings.start[2 * k + own + 1]):
                share = weight[couplings.other[e], couplings.side[e]]
                normal += share * couplings.normal[e]
                friction += share * couplings.friction[e]
                rolling += share if law.rolling[couplings.other[e]] > 0 else 0.0
            normal_out[k, own], friction_out[k, own] = max(normal, 1.0), max(friction, 1.0)
            if own == 0:
                rolling_out[k] = max(rolling, 1.0)
