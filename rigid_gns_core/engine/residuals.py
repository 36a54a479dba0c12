# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Residual of each contact from its law, and its coupling to the others, in each iteration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .contact_law import Law, Target, target_of
from .contacts import Contacts
from .impact import TOUCH
from .impulses import Bodies, free_slip, Impulses, separation_velocity
from .world import weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import across, dot, minus, put, row, times, Vector
from ..scenes.state import Array

# contacts with this share of the force of a body's strongest one count half
_FAINT = 0.01
# residuals below this [g h], and this [approach speed], press no bodies together
_LEAST, _ROUNDING = 1e-9, 1e-13


class SolverState(NamedTuple):
    """Contacts that are solved, and what is known of each from iteration to iteration.

    group: indices of the contacts, shape (c,); free_separation: of their free paths;
    start_coupling: change of separation velocity by the other contacts, at the start; residual:
    target minus present separation velocity; active: whether it carries force; weight: how much it
    counts at a and b, 0 to 1, shape (c, 2); split, friction_split: parts into which a and b are
    split for normal and friction impulses, shape (c, 2); rolling_split: parts of a for rolling
    friction; slip_at_end: slip that friction leaves where it sticks, see `_slip_at_end`;
    free_slip: slip of the free motion at the end, where there is tangential restitution; momentum:
    share of the last step that is repeated; previous_normal, previous_tangential: impulses before
    the last step; end_gap: gap of the target at the end; target: its impulse, impulse_time and
    remaining, shape (c, 3); step: to add, shape (c, 3).
    """

    group: Indices
    free_separation: Array
    start_coupling: Array
    residual: Array
    active: NDArray[np.bool_]
    weight: Array
    split: Array
    friction_split: Array
    rolling_split: Array
    slip_at_end: Array
    free_slip: Array
    momentum: Array
    previous_normal: Array
    previous_tangential: Array
    end_gap: Array
    target: Array
    step: Array


@compiled
def new_state(group: Indices) -> SolverState:
    """State before the first iteration of the contacts of `group`."""
    size = len(group)
    numbers, vectors = np.zeros((6, size)), np.zeros((5, size, 3))
    return SolverState(
        group=group,
        free_separation=numbers[0],
        start_coupling=numbers[1],
        residual=numbers[2],
        active=np.zeros(size, np.bool_),
        weight=np.zeros((size, 2)),
        split=np.ones((size, 2)),
        friction_split=np.ones((size, 2)),
        rolling_split=np.ones(size),
        slip_at_end=vectors[0],
        free_slip=vectors[4],
        momentum=numbers[3],
        previous_normal=numbers[4],
        previous_tangential=vectors[1],
        end_gap=numbers[5],
        target=vectors[2],
        step=vectors[3],
    )


@in_place
def find_free_motion(
    contacts: Contacts, law: Law, bodies: Bodies, impulses: Impulses, state_out: SolverState
) -> None:
    """Find separation and slip on free paths, and the coupling by the impulses so far."""
    for q, k in enumerate(state_out.group):
        if law.tangential_restitution[k] != 0:
            put(state_out.free_slip, q, free_slip(contacts, law, bodies, k))
        free = minus(
            row(bodies.free_velocity, contacts.a[k]), row(bodies.free_velocity, contacts.b[k])
        )
        state_out.free_separation[q] = (
            dot(row(contacts.normal, k), free) + contacts.turning_speed[k]
        )
        separation = separation_velocity(contacts, bodies, k)
        state_out.start_coupling[q] = _coupling(law, impulses, state_out, q, separation)


@in_place
def _target(
    contacts: Contacts, law: Law, state: SolverState, q: int, h: float, coupling: float
) -> Target:
    k = state.group[q]
    return target_of(
        slow=law.restitution[k],
        fast=law.restitution_fast[k],
        middle=law.restitution_speed[k],
        h=h,
        time=contacts.time[k],
        gap=contacts.speculative_gap[k],
        approach_speed=contacts.approach_speed[k],
        acceleration=contacts.acceleration[k],
        coupling=coupling,
    )


@in_place
def _coupling(
    law: Law, impulses: Impulses, state: SolverState, q: int, separation: float
) -> float:
    """Change of the separation velocity by the other contacts; with all it is `separation`."""
    k = state.group[q]
    own = impulses.normal[k] * law.inverse_effective_mass[k]
    return separation - state.free_separation[q] - own


@in_place
def _slip_at_end(
    contacts: Contacts, law: Law, accelerations: Array, state: SolverState, q: int, target: Target
) -> Vector:
    """Slip at the end of a contact that sticks: a t_f - beta (s - a t), across the normal.

    That of gravity, a, in the flight since a bounce, t_f; and of the blow, which turns the slip of
    the free motion s, less what it gains after the impact in a time t, by tangential restitution.
    """
    k = state.group[q]
    pull = (0.0, 0.0, 0.0)
    if contacts.plane[k] >= 0:
        pull = across(row(accelerations, contacts.a[k]), row(contacts.normal, k))
    slip = times(target.flight_time, pull)
    if law.tangential_restitution[k] != 0 and target.bounced:
        blow = minus(row(state.free_slip, q), times(target.remaining, pull))
        slip = minus(slip, times(law.tangential_restitution[k], blow))
    return slip


@in_place
def _minmod(a: float, b: float) -> float:
    """The smaller of two numbers of one sign, else 0."""
    if a * b > 0:
        return math.copysign(min(math.fabs(a), math.fabs(b)), a)
    return 0.0


@in_place
def find_residuals(
    world: World,
    contacts: Contacts,
    law: Law,
    impulses: Impulses,
    accelerations: Array,
    h: float,
    nominal_h: float,
    bodies_out: Bodies,
    state_out: SolverState,
) -> None:
    """Find the residual of each contact, and how much it counts at its bodies.

    A contact of force x counts 1.01 x / (x + 0.01 x_max) in a body whose strongest has x_max, so
    that contacts without force change nothing.
    """
    least = _LEAST * weight_of(world) * nominal_h
    bodies, state = bodies_out, state_out
    for k in state.group:
        bodies.strongest[contacts.a[k]] = bodies.strongest[contacts.b[k]] = 1e-30
    for q, k in enumerate(state.group):
        separation = separation_velocity(contacts, bodies, k)
        coupling = _coupling(law, impulses, state, q, separation)
        # what acted at the start too is a force that lasts through the substep, the rest a blow
        lasting = _minmod(state.start_coupling[q], coupling) / h if h > 0 else 0.0
        target = _target(contacts, law, state, q, h, lasting)
        put(state.target, q, (target.impulse, target.impulse_time, target.remaining))
        if contacts.plane[k] >= 0 or law.tangential_restitution[k] != 0:
            put(state.slip_at_end, q, _slip_at_end(contacts, law, accelerations, state, q, target))
        state.residual[q] = target.separation_velocity - separation
        state.end_gap[q] = target.end_gap
        slowest = least + _ROUNDING * math.fabs(contacts.approach_speed[k])
        presses = impulses.normal[k] > 0 or state.residual[q] > slowest
        # a gap that the free path does not close takes a force that presses the bodies together
        gap = contacts.rest_gap[k] + contacts.speculative_gap[k]
        apart = h > 0 and lasting >= 0 and gap > TOUCH * world.radius[contacts.a[k]]
        state.active[q] = target.active and presses and not apart
        # weight 0 holds the force until the strongest of each body is known
        own = impulses.normal[k] * law.inverse_effective_mass[k]
        strength = own + math.fabs(state.residual[q])
        state.weight[q, 0] = strength if state.active[q] else 0.0
        for body in (contacts.a[k], contacts.b[k]):
            bodies.strongest[body] = max(bodies.strongest[body], state.weight[q, 0])
    for q, k in enumerate(state.group):
        strength = state.weight[q, 0]
        for side, body in enumerate((contacts.a[k], contacts.b[k])):
            total = strength + _FAINT * bodies.strongest[body]
            state.weight[q, side] = (1.0 + _FAINT) * strength / total
