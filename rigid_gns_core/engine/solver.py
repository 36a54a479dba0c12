# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impulses of all contacts of a substep, by damped Jacobi iterations with momentum.

Each iteration compares every contact with its law under its coupling to the others (residual),
and takes the step that would satisfy the law if bodies were split among their active contacts:

    d lambda = momentum (lambda - lambda_before) + residual / (n_a / m_a + n_b / m_b),

with n the parts of a body. Mass splitting (Tonge, Benevolenski, Voroshilov, Mass splitting for
jitter-free parallel rigid body simulation, 2012) makes all steps at once stable; momentum is
Polyak's heavy ball (1964). All contacts step at once, so their order does not matter.
"""

from __future__ import annotations

import math

import numpy as np

from .contact_law import Law
from .contacts import Contacts
from .impulses import Bodies, Impulses, start_from
from .residuals import find_free_motion, find_residuals, new_state, SolverState
from .steps import step_friction, step_normal, step_rolling
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Indices
from ..kernels.vector import add_to, plus, put, row, times
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
    h: float,
    nominal_h: float,
    iterations: int,
    tolerance: float,
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
        h: Length of the substep; 0 for a correction of collisions that the last one missed.
        nominal_h: Length of a regular substep, for thresholds of speed.
        iterations: Most iterations.
        tolerance: An iteration that changes every contact by less than this speed is the last; 0:
            all are made.
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
    for _ in range(iterations):
        find_residuals(world, contacts, law, impulses, h, nominal_h, bodies, state)
        _set_momentum(contacts, bodies, state)
        step_normal(world, contacts, bodies, impulses, state)
        step_rolling(world, contacts, law, bodies, impulses, state)
        step_friction(world, contacts, law, bodies, impulses, state)
        if tolerance > 0 and _last_change(law, impulses, state).max() < tolerance:
            break
    _set_displacement(world, contacts, law, impulses, state, bodies)
    return _last_change(law, impulses, state)


@in_place
def _set_momentum(contacts: Contacts, bodies: Bodies, state_out: SolverState) -> None:
    """Set the momentum, (1 - 1 / split) / 2: none for a contact alone, whose step is exact."""
    for q, k in enumerate(state_out.group):
        split = max(bodies.split[contacts.a[k]], bodies.split[contacts.b[k]])
        state_out.momentum[q] = MOMENTUM * (1.0 - 1.0 / split)


@compiled
def _last_change(law: Law, impulses: Impulses, state: SolverState) -> Array:
    """Speed by which the last step changed each contact, shape (c,)."""
    change = np.empty(len(state.group))
    for q, k in enumerate(state.group):
        step = math.fabs(impulses.normal[k] - state.previous_normal[q])
        change[q] = step * law.inverse_effective_mass[k]
    return change


@in_place
def _set_displacement(
    world: World,
    contacts: Contacts,
    law: Law,
    impulses: Impulses,
    state: SolverState,
    bodies_out: Bodies,
) -> None:
    """Find displacements beyond those of free flight: t J / m.

    The impulse of a contact alone acts at once, t = `impulse_time` before the end; what others add
    to it is spread over the rest of the substep after the impact, with t half of that.
    """
    for k in state.group:
        put(bodies_out.displacement, contacts.a[k], (0.0, 0.0, 0.0))
        put(bodies_out.displacement, contacts.b[k], (0.0, 0.0, 0.0))
    for q, k in enumerate(state.group):
        a, b, normal = contacts.a[k], contacts.b[k], impulses.normal[k]
        alone, time, remaining = row(state.target, q)
        share = min(normal, alone / law.inverse_effective_mass[k]) / max(normal, 1e-30)
        time = share * time + (1.0 - share) * 0.5 * remaining
        impulse = plus(times(normal, row(contacts.normal, k)), row(impulses.tangential, k))
        add_to(bodies_out.displacement, a, times(time * world.inverse_mass[a], impulse))
        add_to(bodies_out.displacement, b, times(-time * world.inverse_mass[b], impulse))
