# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The steps of an iteration: normal impulses, rolling friction, sliding friction."""

from __future__ import annotations

from .contact_law import Law
from .contacts import Contacts
from .impulses import apply_angular, apply_linear, Bodies, Impulses, slip_velocity
from .residuals import SolverState
from .world import given_law, SLOPE, SPIN, World
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
    for k in range(len(contacts.a)):
        a, b, old = contacts.a[k], contacts.b[k], impulses_out.normal[k]
        inverse_mass = state_out.split[k, 0] * world.inverse_mass[a]
        inverse_mass += state_out.split[k, 1] * world.inverse_mass[b]
        repeated = state_out.momentum[k] * (old - state_out.previous_normal[k])
        more = repeated + state_out.residual[k] / inverse_mass
        state_out.previous_normal[k] = old
        impulses_out.normal[k] = max(old + more, 0.0) if state_out.active[k] else 0.0
    for k in range(len(contacts.a)):
        step = impulses_out.normal[k] - state_out.previous_normal[k]
        apply_linear(world, contacts, bodies_out, k, times(step, row(contacts.normal, k)))


@in_place
def _slip_and_inverse_mass(
    world: World, contacts: Contacts, law: Law, bodies: Bodies, state: SolverState, k: int
) -> tuple[Vector, float]:
    """Slip that friction acts on, and its change by a unit of impulse on the split bodies."""
    a, b = contacts.a[k], contacts.b[k]
    split = state.friction_split
    inverse_mass = split[k, 0] * (world.inverse_mass[a] + law.rotation_a[k])
    inverse_mass += split[k, 1] * (world.inverse_mass[b] + law.rotation_b[k])
    slip = minus(slip_velocity(contacts, law, bodies, k), row(state.slip_at_end, k))
    return slip, inverse_mass


@in_place
def _limits(
    world: World,
    contacts: Contacts,
    law: Law,
    bodies: Bodies,
    impulses: Impulses,
    k: int,
    given: int,
) -> tuple[float, float]:
    """Limits of the angular impulses L of a contact law against rolling and spinning.

    L = (rho + rho' v) r N, at the speed v in the middle of the substep: L slows a sphere that
    rolls by l L / (I + m l^2), so that v = v_0 - l L / 2 (I + m l^2). And L = sigma r N.
    """
    a, normal, force = contacts.a[k], row(contacts.normal, k), impulses.normal[k]
    velocity = row(bodies.free_velocity, a)
    if contacts.plane[k] >= 0:
        velocity = minus(velocity, row(bodies.free_velocity, contacts.b[k]))
    speed, arm = length(across(velocity, normal)), law.arm_a[k]
    inertia = 1.0 / world.inverse_inertia[a] + arm * arm / world.inverse_mass[a]
    slope = world.laws[given, SLOPE] * world.radius[a] * force
    rolling = (law.rolling[k] * force + slope * speed) / (1.0 + 0.5 * slope * arm / inertia)
    return rolling, world.laws[given, SPIN] * world.radius[a] * force


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
    for k in range(len(contacts.a)):
        put(state_out.step, k, (0.0, 0.0, 0.0))
        if law.rolling[k] == 0:
            continue
        a, normal, old = contacts.a[k], row(contacts.normal, k), row(impulses_out.rolling, k)
        slip, inverse_mass = _slip_and_inverse_mass(world, contacts, law, bodies_out, state_out, k)
        sticking = minus(row(impulses_out.tangential, k), times(1.0 / inverse_mass, slip))
        w, v = row(bodies_out.angular_velocity, a), row(bodies_out.velocity, a)
        if contacts.plane[k] >= 0:  # on a surface that moves
            w = minus(w, row(bodies_out.angular_velocity, contacts.b[k]))
            v = minus(v, row(bodies_out.velocity, contacts.b[k]))
        about_centre = times(1.0 / world.inverse_inertia[a], w)
        flat = across(about_centre, normal)
        rolls = flat
        if length(sticking) <= law.friction[k] * impulses_out.normal[k]:
            orbit = times(law.arm_a[k] / world.inverse_mass[a], cross(normal, across(v, normal)))
            rolls = across(plus(about_centre, orbit), normal)
        about_normal = minus(about_centre, flat)
        new = minus(old, times(1.0 / state_out.rolling_split[k], plus(rolls, about_normal)))
        limit = most = law.rolling[k] * impulses_out.normal[k]
        given = given_law(world, contacts.plane[k])
        if given >= 0:
            limit, most = _limits(world, contacts, law, bodies_out, impulses_out, k, given)
        spinning = min(max(dot(new, normal), -most), most)
        new = plus(clip(across(new, normal), limit), times(spinning, normal))
        put(impulses_out.rolling, k, new)
        put(state_out.step, k, minus(new, old))
    for k in range(len(contacts.a)):
        a = contacts.a[k]
        step = times(world.inverse_inertia[a], row(state_out.step, k))
        add_to(bodies_out.angular_velocity, a, step)


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
    for k in range(len(contacts.a)):
        old = row(impulses_out.tangential, k)
        slip, inverse_mass = _slip_and_inverse_mass(world, contacts, law, bodies_out, state_out, k)
        before = row(state_out.previous_tangential, k)
        repeated = times(state_out.momentum[k], minus(old, before))
        sticking = plus(old, minus(repeated, times(1.0 / inverse_mass, slip)))
        new = clip(sticking, law.friction[k] * impulses_out.normal[k])
        put(state_out.previous_tangential, k, old)
        put(impulses_out.tangential, k, new)
        put(state_out.step, k, minus(new, old))
    for k in range(len(contacts.a)):
        apply_linear(world, contacts, bodies_out, k, row(state_out.step, k))
        apply_angular(world, contacts, law, bodies_out, k, row(state_out.step, k))
