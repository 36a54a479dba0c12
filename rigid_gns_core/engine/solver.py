# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impulses of all contacts of a substep, island by island.

Each iteration compares every contact with its law under its coupling to the others (residual).
The normal impulses of few contacts are then found exactly (`direct.py`); those of many
(`large.py`) take the step that would satisfy the law if bodies were split as contacts couple:

    d lambda = momentum (lambda - lambda_before) + residual / (s_a / m_a + s_b / m_b).

Friction and rolling friction always step so. Splitting (Tonge, Benevolenski, Voroshilov, Mass
splitting for jitter-free parallel rigid body simulation, 2012) makes all steps at once stable;
momentum is Polyak's heavy ball (1964). All contacts step at once, so their order does not matter.
"""

from __future__ import annotations

import math

from .blocks import Blocks
from .contact_law import Law, law_among
from .contacts import Contacts
from .couplings import Couplings, find_couplings, split_bodies
from .direct import MOST_CONTACTS, Pivots, pivots_of, solve_normals
from .displacement import displace_by_blows, displace_directly
from .groups import contacts_among
from .impulses import apply_linear, Bodies, Impulses, impulses_among, start_from
from .large import solve_large
from .residuals import find_free_motion, find_residuals, reset_state, SolverState, state_among
from .splitting import LARGEST_MOMENTUM
from .steps import step_friction, step_normal, step_rolling
from .world import weight_of, World
from ..kernels.jit import in_place
from ..kernels.vector import length, put, row, times
from ..scenes.state import Array

# few contacts are solved until an iteration changes none by more than this [g h, and approach
# speed]; blows need it, and resting contacts have it after the first iteration
_EXACT, _MOST_ITERATIONS = 3e-4, 16
# few whose last iteration changed one by more than this [g h, and approach speed] have friction
# that does not converge, as between masses of a ratio of 1e6
_LOST = 30.0
# bodies are split anew in the first iterations, and then in every so many
_FIRST, _EVERY = 3, 4


@in_place
def solve_isolated(
    world: World,
    contacts: Contacts,
    law: Law,
    last: int,
    accelerations: Array,
    h: float,
    nominal_h: float,
    state_out: SolverState,
    bodies_out: Bodies,
    impulses_out: Impulses,
) -> None:
    """Solve contacts that share no moving body with any other: one step is exact.

    Args:
        world: What does not move.
        contacts: All contacts of the substep, these first.
        law: Their coefficients.
        last: Where they end.
        accelerations: Of the spheres in flight, shape (n, 3).
        h: Length of the substep; 0 for a correction of collisions that the last one missed.
        nominal_h: Length of a regular substep, for thresholds of speed.
        state_out: Reset, and written.
        bodies_out: Changes of their bodies are written.
        impulses_out: Written.
    """
    contacts, law = contacts_among(contacts, 0, last), law_among(law, 0, last)
    state = state_among(state_out, 0, last)
    bodies, impulses = bodies_out, impulses_among(impulses_out, 0, last)
    reset_state(state)
    for k in range(last):  # no warm start: one step is exact
        impulses.normal[k] = 0.0
        put(impulses.tangential, k, (0.0, 0.0, 0.0))
        put(impulses.rolling, k, (0.0, 0.0, 0.0))
    find_free_motion(contacts, law, bodies, impulses, state)
    find_residuals(world, contacts, law, impulses, accelerations, h, nominal_h, bodies, state)
    step_normal(world, contacts, bodies, impulses, state)
    step_rolling(world, contacts, law, bodies, impulses, state)
    step_friction(world, contacts, law, bodies, impulses, state)
    displace_by_blows(world, contacts, law, impulses, state, True, bodies)


@in_place
def solve(
    world: World,
    contacts: Contacts,
    law: Law,
    start: Impulses,
    first: int,
    last: int,
    accelerations: Array,
    h: float,
    nominal_h: float,
    iterations: int,
    couplings_out: Couplings,
    pivots_out: Pivots,
    blocks_out: Blocks,
    state_out: SolverState,
    bodies_out: Bodies,
    impulses_out: Impulses,
) -> float:
    """Solve the contacts of an island; returns the speed by which the last step changed one most.

    Args:
        world: What does not move.
        contacts: All contacts of the substep.
        law: Their coefficients.
        start: Impulses of the last substep, from which forces that last are told from blows.
        first: Where the island begins; no other contact shares a moving body with it.
        last: Where it ends.
        accelerations: Of the spheres in flight, shape (n, 3).
        h: Length of the substep; 0 for a correction of collisions that the last one missed.
        nominal_h: Length of a regular substep, for thresholds of speed.
        iterations: Iterations, unless more are needed.
        couplings_out: Scratch.
        pivots_out: Scratch of the direct solution.
        blocks_out: Scratch of a large island.
        state_out: Scratch of a small one.
        bodies_out: Changes of their bodies are written.
        impulses_out: Written.
    """
    contacts, law = contacts_among(contacts, first, last), law_among(law, first, last)
    start, impulses = impulses_among(start, first, last), impulses_among(impulses_out, first, last)
    if last - first > MOST_CONTACTS:
        return solve_large(
            world, contacts, law, start, accelerations, h, nominal_h, iterations, blocks_out,
            bodies_out, impulses,
        )  # fmt: skip
    bodies, state, couplings = bodies_out, state_among(state_out, first, last), couplings_out
    find_couplings(world, contacts, law, couplings)
    reset_state(state)
    start_from(world, contacts, law, start, bodies, impulses)
    find_free_motion(contacts, law, bodies, impulses, state)
    pivots, fastest = pivots_of(world, contacts, pivots_out), 0.0
    for k in range(len(contacts.a)):
        state.previous_normal[k] = impulses.normal[k]
        put(state.previous_tangential, k, row(impulses.tangential, k))
        fastest = max(fastest, contacts.approach_speed[k])
    unit = weight_of(world) * nominal_h + fastest
    change = _iterate(
        world, contacts, law, couplings, accelerations, h, nominal_h,
        max(iterations, _MOST_ITERATIONS), _EXACT * unit, pivots, bodies, impulses, state,
    )  # fmt: skip
    if change > _LOST * unit:
        _drop_friction(
            world, contacts, law, h, nominal_h, pivots, accelerations, state, bodies, impulses
        )
    if not displace_directly(world, contacts, pivots, impulses, state, h, bodies):
        displace_by_blows(world, contacts, law, impulses, state, False, bodies)
    return change


@in_place
def _iterate(
    world: World,
    contacts: Contacts,
    law: Law,
    couplings: Couplings,
    accelerations: Array,
    h: float,
    nominal_h: float,
    most: int,
    tolerance: float,
    pivots: Pivots,
    bodies_out: Bodies,
    impulses_out: Impulses,
    state_out: SolverState,
) -> float:
    """Iterate until one changes every contact by less than the tolerance; returns its change."""
    bodies, impulses, state, change = bodies_out, impulses_out, state_out, 0.0
    for iteration in range(most):
        find_residuals(world, contacts, law, impulses, accelerations, h, nominal_h, bodies, state)
        if iteration < _FIRST or iteration % _EVERY == 0:
            split_bodies(
                couplings,
                law,
                state.weight,
                state.split,
                state.friction_split,
                state.rolling_split,
            )
            _set_momentum(state)
        if not _step_exactly(world, contacts, pivots, bodies, impulses, state):
            step_normal(world, contacts, bodies, impulses, state)
        step_rolling(world, contacts, law, bodies, impulses, state)
        step_friction(world, contacts, law, bodies, impulses, state)
        change = _last_change(law, impulses, state)
        if change < tolerance:
            break
    return change


@in_place
def _drop_friction(
    world: World,
    contacts: Contacts,
    law: Law,
    h: float,
    nominal_h: float,
    pivots: Pivots,
    accelerations: Array,
    state_out: SolverState,
    bodies_out: Bodies,
    impulses_out: Impulses,
) -> None:
    """Solve the contacts without friction, which is exact whatever the masses."""
    impulses = impulses_out
    for k in range(len(contacts.a)):
        put(impulses.tangential, k, (0.0, 0.0, 0.0))
        put(impulses.rolling, k, (0.0, 0.0, 0.0))
    for _ in range(2):  # the first finds which contacts carry force
        start_from(world, contacts, law, impulses, bodies_out, impulses)
        find_residuals(
            world, contacts, law, impulses, accelerations, h, nominal_h, bodies_out, state_out
        )
        if not _step_exactly(world, contacts, pivots, bodies_out, impulses, state_out):
            return


@in_place
def _set_momentum(state_out: SolverState) -> None:
    """Set the momentum, (1 - 1 / split) / 2: none for a contact that shares no force."""
    for k in range(len(state_out.momentum)):
        split = max(state_out.split[k, 0], state_out.split[k, 1])
        state_out.momentum[k] = LARGEST_MOMENTUM * (1.0 - 1.0 / split)


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
    size = len(contacts.a)
    for k in range(size):
        pivots.impulse[k] = impulses_out.normal[k]
    for k in range(size):
        pivots.goal[k] = state_out.residual[k]
        for m in range(size):
            pivots.goal[k] += pivots.matrix[k, m] * pivots.impulse[m]
    if not solve_normals(state_out.active, pivots):
        return False
    for k in range(size):
        step = pivots.impulse[k] - impulses_out.normal[k]
        state_out.previous_normal[k] = impulses_out.normal[k]
        impulses_out.normal[k] = pivots.impulse[k]
        apply_linear(world, contacts, bodies_out, k, times(step, row(contacts.normal, k)))
    return True


@in_place
def _last_change(law: Law, impulses: Impulses, state: SolverState) -> float:
    """Largest speed by which the last step changed a contact, along or across its normal."""
    largest = 0.0
    for k in range(len(state.step)):
        step = math.fabs(impulses.normal[k] - state.previous_normal[k])
        slip = length(row(state.step, k))
        mobility = law.inverse_effective_mass[k]
        turning = mobility + law.rotation_a[k] + law.rotation_b[k]
        largest = max(largest, step * mobility, slip * turning)
    return largest
