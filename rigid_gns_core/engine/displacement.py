# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Displacements of a substep beyond those of free flight, by the impulses found."""

from __future__ import annotations

from .contact_law import Law
from .contacts import Contacts
from .direct import Pivots, solve_normals
from .impulses import Bodies, Impulses
from .residuals import SolverState
from .world import World
from ..kernels.jit import in_place
from ..kernels.vector import add_to, dot, minus, plus, put, row, times


@in_place
def displace_by_blows(
    world: World,
    contacts: Contacts,
    law: Law,
    impulses: Impulses,
    state: SolverState,
    closes: bool,
    bodies_out: Bodies,
) -> None:
    """Displacements t J / m of many contacts, or of one.

    The impulse of a contact alone acts at once, t = `impulse_time` before the end; what others add
    to it is spread over the rest of the substep after the impact, with t half of that. Contacts
    that rest close their gaps if `closes`, which those of a body with others could not.
    """
    _clear(contacts, bodies_out)
    for k in range(len(contacts.a)):
        a, b, normal = contacts.a[k], contacts.b[k], impulses.normal[k]
        if closes and normal > 0 and state.end_gap[k] == 0:
            mass = law.inverse_effective_mass[k]
            close = times(-contacts.rest_gap[k] / mass, row(contacts.normal, k))
            add_to(bodies_out.displacement, a, times(world.inverse_mass[a], close))
            add_to(bodies_out.displacement, b, times(-world.inverse_mass[b], close))
        alone, time, remaining = row(state.target, k)
        share = min(normal, alone / law.inverse_effective_mass[k]) / max(normal, 1e-30)
        time = share * time + (1.0 - share) * 0.5 * remaining
        impulse = plus(times(normal, row(contacts.normal, k)), row(impulses.tangential, k))
        add_to(bodies_out.displacement, a, times(time * world.inverse_mass[a], impulse))
        add_to(bodies_out.displacement, b, times(-time * world.inverse_mass[b], impulse))


@in_place
def displace_directly(
    world: World,
    contacts: Contacts,
    pivots: Pivots,
    impulses: Impulses,
    state: SolverState,
    h: float,
    bodies_out: Bodies,
) -> bool:
    """Displacements of few contacts, which end with the gaps that their laws ask for.

    As the impulses themselves, products of impulse and time P >= 0 along the normals, such that no
    gap is smaller, and each equal where P > 0. A force that passes through light bodies moves
    them no farther than their contacts allow. False where there are none.
    """
    _clear(contacts, bodies_out)
    for k in range(len(contacts.a)):  # friction acts with the impulse of the contact alone
        a, b = contacts.a[k], contacts.b[k]
        time = min(max(state.target[k, 1], 0.0), h)
        across = times(time, row(impulses.tangential, k))
        add_to(bodies_out.displacement, a, times(world.inverse_mass[a], across))
        add_to(bodies_out.displacement, b, times(-world.inverse_mass[b], across))
    for k in range(len(contacts.a)):
        a, b, normal = contacts.a[k], contacts.b[k], row(contacts.normal, k)
        state.active[k] = impulses.normal[k] > 0
        pivots.impulse[k] = impulses.normal[k]
        left = h - max(contacts.time[k], 0.0)
        opened = contacts.speculative_gap[k] - contacts.approach_speed[k] * left
        opened += 0.5 * contacts.acceleration[k] * left * left
        shift = minus(row(bodies_out.displacement, a), row(bodies_out.displacement, b))
        pivots.goal[k] = state.end_gap[k] - opened - dot(normal, shift)
        if state.end_gap[k] == 0:
            pivots.goal[k] -= contacts.rest_gap[k]
    if not solve_normals(state.active, pivots):
        return False
    for k in range(len(contacts.a)):
        a, b, along = (
            contacts.a[k],
            contacts.b[k],
            times(pivots.impulse[k], row(contacts.normal, k)),
        )
        add_to(bodies_out.displacement, a, times(world.inverse_mass[a], along))
        add_to(bodies_out.displacement, b, times(-world.inverse_mass[b], along))
    return True


@in_place
def _clear(contacts: Contacts, bodies_out: Bodies) -> None:
    for k in range(len(contacts.a)):
        put(bodies_out.displacement, contacts.a[k], (0.0, 0.0, 0.0))
        put(bodies_out.displacement, contacts.b[k], (0.0, 0.0, 0.0))
