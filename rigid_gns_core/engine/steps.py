# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The steps of an iteration: normal impulses, rolling friction, sliding friction."""

from __future__ import annotations

from .contact_law import Law
from .contacts import Contacts
from .impulses import apply_angular, apply_linear, Bodies, Impulses, slip_velocity
from .residuals import SolverState
from .world import World
from ..kernels.jit import in_place
from ..kernels.vector import (
    across,
    add_to,
    clip,
    cross,
    dot,
    length,
    minus,
    plus,
    put,
    row,
    times,
    Vector,
)


@in_place
def step_normal(
    world: World, contacts: Contacts, bodies_out: Bodies, impulses_out: Impulses,
    state_out: SolverState,
) -> None:  # fmt: skip
    """Step normal impulses: they push, and never pull (Signorini's condition: N >= 0)."""
    for q, k in enumerate(state_out.group):
        a, b, old = contacts.a[k], contacts.b[k], impulses_out.normal[k]
        inverse_mass = state_out.split[q, 0] * world.inverse_mass[a]
        inverse_mass += state_out.split[q, 1] * world.inverse_mass[b]
        repeated = state_out.momentum[q] * (old - state_out.previous_normal[q])
        more = repeated + state_out.residual[q] / inverse_mass
        state_out.previous_normal[q] = old
        impulses_out.normal[k] = max(old + more, 0.0) if state_out.active[q] else 0.0
    for q, k in enumerate(state_out.group):
        step = impulses_out.normal[k] - state_out.previous_normal[q]
        apply_linear(world, contacts, bodies_out, k, times(step, row(contacts.normal, k)))


@in_place
def _slip_and_inverse_mass(
    world: World, contacts: Contacts, law: Law, bodies: Bodies, state: SolverState, q: int
) -> tuple[Vector, float]:
    """Slip that friction acts on, and its change by a unit of impulse on the split bodies."""
    k = state.group[q]
    a, b = contacts.a[k], contacts.b[k]
    split = state.friction_split
    inverse_mass = split[q, 0] * (world.inverse_mass[a] + law.rotation_a[k])
    inverse_mass += split[q, 1] * (world.inverse_mass[b] + law.rotation_b[k])
    slip = minus(slip_velocity(contacts, law, bodies, k), row(state.slip_at_end, q))
    return slip, inverse_mass


@in_place
def step_rolling(
    world: World,
    contacts: Contacts,
    law: Law,
    bodies_out: Bodies,
    impulses_out: Impulses,
    state_out: SolverState,
) -> None:
    """Step the angular impulse of rolling friction: enough to stop the rolling, but limited.

    At most (rho + rho' v) r N, v the speed of the centre across the normal.

    Where the contact sticks it acts on the angular momentum about the contact point,
    L = I w + m r n x v, which friction does not change; where it slips, on that about the centre.
    About the normal it resists spinning, at most by sigma r N.
    """
    for q, k in enumerate(state_out.group):
        put(state_out.step, q, (0.0, 0.0, 0.0))
        if law.rolling[k] + law.rolling_slope[k] + law.spinning[k] == 0:
            continue
        a, normal, old = contacts.a[k], row(contacts.normal, k), row(impulses_out.rolling, k)
        slip, inverse_mass = _slip_and_inverse_mass(world, contacts, law, bodies_out, state_out, q)
        sticking = minus(row(impulses_out.tangential, k), times(1.0 / inverse_mass, slip))
        w = plus(row(bodies_out.angular_velocity, a), row(bodies_out.angular_change, a))
        about_centre = times(1.0 / world.inverse_inertia[a], w)
        flat = across(about_centre, normal)
        rolls = flat
        if length(sticking) <= law.friction[k] * impulses_out.normal[k]:
            v = plus(row(bodies_out.free_velocity, a), row(bodies_out.velocity_change, a))
            orbit = times(law.arm_a[k] / world.inverse_mass[a], cross(normal, across(v, normal)))
            rolls = across(plus(about_centre, orbit), normal)
        about_normal = minus(about_centre, flat)
        new = minus(old, times(1.0 / state_out.rolling_split[q], plus(rolls, about_normal)))
        limit = law.rolling[k] * impulses_out.normal[k]
        if law.rolling_slope[k] > 0:
            half = times(0.5, row(bodies_out.velocity_change, a))  # at the middle of the substep
            v = plus(row(bodies_out.free_velocity, a), half)
            limit += law.rolling_slope[k] * length(across(v, normal)) * impulses_out.normal[k]
        most = law.spinning[k] * impulses_out.normal[k]
        spinning = min(max(dot(new, normal), -most), most)
        new = plus(clip(across(new, normal), limit), times(spinning, normal))
        put(impulses_out.rolling, k, new)
        put(state_out.step, q, minus(new, old))
    for q, k in enumerate(state_out.group):
        a = contacts.a[k]
        step = times(world.inverse_inertia[a], row(state_out.step, q))
        add_to(bodies_out.angular_change, a, step)


@in_place
def step_friction(
    world: World,
    contacts: Contacts,
    law: Law,
    bodies_out: Bodies,
    impulses_out: Impulses,
    state_out: SolverState,
) -> None:
    """Step friction impulses T, which stop the slip as far as |T| <= mu N (Coulomb's law)."""
    for q, k in enumerate(state_out.group):
        old = row(impulses_out.tangential, k)
        slip, inverse_mass = _slip_and_inverse_mass(world, contacts, law, bodies_out, state_out, q)
        before = row(state_out.previous_tangential, q)
        repeated = times(state_out.momentum[q], minus(old, before))
        sticking = plus(old, minus(repeated, times(1.0 / inverse_mass, slip)))
        new = clip(sticking, law.friction[k] * impulses_out.normal[k])
        put(state_out.previous_tangential, q, old)
        put(impulses_out.tangential, k, new)
        put(state_out.step, q, minus(new, old))
    for q, k in enumerate(state_out.group):
        apply_linear(world, contacts, bodies_out, k, row(state_out.step, q))
        apply_angular(world, contacts, law, bodies_out, k, row(state_out.step, q))
