# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impulses of all contacts of a substep, iteratively.

Each iteration compares every contact with its law under its coupling to the others (residual).
The normal impulses of few contacts are then found exactly (`direct.py`); those of many take the
step that would satisfy the law if bodies were split as the contacts couple (`couplings.py`):

    d lambda = momentum (lambda - lambda_before) + residual / (s_a / m_a + s_b / m_b).

Friction and rolling friction always step so. Splitting (Tonge, Benevolenski, Voroshilov, Mass
splitting for jitter-free parallel rigid body simulation, 2012) makes all steps at once stable;
momentum is Polyak's heavy ball (1964). All contacts step at once, so their order does not matter.
"""

from __future__ import annotations

import math

import numpy as np

from .contact_law import Law
from .contacts import Contacts
from .couplings import find_couplings, no_couplings, split_bodies
from .direct import MOST_CONTACTS, new_pivots, no_pivots, Pivots, solve_normals
from .displacement import displace_by_blows, displace_directly
from .impulses import apply_linear, Bodies, Impulses, start_from
from .residuals import find_free_motion, find_residuals, new_state, SolverState
from .steps import step_friction, step_normal, step_rolling
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import length, put, row, times
from ..scenes.state import Array

# largest momentum, the share of a step that the next one repeats: halves the iterations of piles
MOMENTUM = 0.5


@compiled
def solve(
    world: World,
    contacts: Contacts,
    law: Law,
    group: Indices,
    start: Impulses,
    lasting: Impulses,
    accelerations: Array,
    h: float,
    nominal_h: float,
    iterations: int,
    tolerance: float,
    shared: bool,
    bodies_out: Bodies,
    impulses_out: Impulses,
) -> Array:
    """Solve a group of contacts; returns the speed by which the last step changed each.

    Args:
        world: What does not move.
        contacts: All contacts of the substep.
        law: Their coefficients.
        group: Indices of those to solve; no other contact may share a moving body with them.
        start: Impulses of the first iteration.
        lasting: Impulses of the last substep, from which forces that last are told from blows.
        accelerations: Of the spheres in flight, shape (n, 3).
        h: Length of the substep; 0 for a correction of collisions that the last one missed.
        nominal_h: Length of a regular substep, for thresholds of speed.
        iterations: Most iterations.
        tolerance: An iteration that changes every contact by less than this speed is the last; 0:
            all are made.
        shared: Whether contacts of the group share moving bodies.
        bodies_out: Changes of the bodies of the group are written.
        impulses_out: Impulses of the group are written.
    """
    if len(group) == 0:
        return np.empty(0)
    bodies, impulses, state = bodies_out, impulses_out, new_state(group)
    start_from(world, contacts, law, group, lasting, bodies, impulses)
    find_free_motion(contacts, law, bodies, impulses, state)
    start_from(world, contacts, law, group, start, bodies, impulses)
    for q, k in enumerate(group):
        state.previous_normal[q] = impulses.normal[k]
        put(state.previous_tangential, q, row(impulses.tangential, k))
    direct = shared and len(group) <= MOST_CONTACTS
    couplings, pivots = no_couplings(len(group)), no_pivots()
    if shared:
        couplings = find_couplings(world, contacts, law, group, bodies.number)
    if direct:
        pivots = new_pivots(world, contacts, group)
    for _ in range(iterations):
        find_residuals(world, contacts, law, impulses, accelerations, h, nominal_h, bodies, state)
        if shared:
            split_bodies(
                couplings,
                law,
                group,
                state.weight,
                state.split,
                state.friction_split,
                state.rolling_split,
            )
        _set_momentum(state)
        if not (direct and _step_exactly(world, contacts, pivots, bodies, impulses, state)):
            step_normal(world, contacts, bodies, impulses, state)
        step_rolling(world, contacts, law, bodies, impulses, state)
        step_friction(world, contacts, law, bodies, impulses, state)
        if tolerance > 0 and _last_change(law, impulses, state).max() < tolerance:
            break
    if not (direct and displace_directly(world, contacts, pivots, impulses, state, h, bodies)):
        displace_by_blows(world, contacts, law, impulses, state, not shared, bodies)
    return _last_change(law, impulses, state)


@in_place
def _set_momentum(state_out: SolverState) -> None:
    """Set the momentum, (1 - 1 / split) / 2: none for a contact alone, whose step is exact."""
    for q in range(len(state_out.group)):
        split = max(state_out.split[q, 0], state_out.split[q, 1])
        state_out.momentum[q] = MOMENTUM * (1.0 - 1.0 / split)


@in_place
def _step_exactly(
    world: World,
    contacts: Contacts,
    pivots: Pivots,
    bodies_out: Bodies,
    impulses_out: Impulses,
    state_out: SolverState,
) -> bool:
    """Set all normal impulses to those of the law; False where there are none."""
    group, size = state_out.group, len(state_out.group)
    for q in range(size):
        pivots.impulse[q] = impulses_out.normal[group[q]]
    for q in range(size):
        pivots.goal[q] = state_out.residual[q]
        for p in range(size):
            pivots.goal[q] += pivots.matrix[q, p] * pivots.impulse[p]
    if not solve_normals(state_out.active, pivots):
        return False
    for q, k in enumerate(group):
        step = pivots.impulse[q] - impulses_out.normal[k]
        state_out.previous_normal[q] = impulses_out.normal[k]
        impulses_out.normal[k] = pivots.impulse[q]
        apply_linear(world, contacts, bodies_out, k, times(step, row(contacts.normal, k)))
    return True


@compiled
def _last_change(law: Law, impulses: Impulses, state: SolverState) -> Array:
    """Speed by which the last step changed each contact, along and across, shape (c,)."""
    change = np.empty(len(state.group))
    for q, k in enumerate(state.group):
        step = math.fabs(impulses.normal[k] - state.previous_normal[q])
        slip = length(row(state.step, q))
        mobility = law.inverse_effective_mass[k]
        turning = mobility + law.rotation_a[k] + law.rotation_b[k]
        change[q] = max(step * mobility, slip * turning)
    return change
