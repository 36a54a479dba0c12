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
from .restitution import curve_of
from .world import given_law, gravity_of, GRIP, weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.vector import across, dot, minus, put, row, times, Vector
from ..scenes.state import Array

# contacts with this share of the force of a body's strongest one count half
_FAINT = 0.01
# residuals below this [g h], and this [approach speed], press no bodies together
_LEAST, _ROUNDING = 1e-9, 1e-13


class SolverState(NamedTuple):
    """What is known of each contact from iteration to iteration; c contacts.

    free_separation: of their free paths, shape (c,);
    start_coupling: change of separation velocity by the other contacts, at the start; residual:
    target minus present separation velocity; active: whether it carries force; weight: how much it
    counts at a and b, 0 to 1, shape (c, 2); split, friction_split: parts into which a and b are
    split for normal and friction impulses, shape (c, 2); rolling_split: parts of a for rolling
    friction; slip_at_end: slip that friction leaves where it sticks, by gravity in flight after a
    bounce and by tangential restitution; momentum: share of the last step that is repeated;
    previous_normal, previous_tangential: impulses before the last step; end_gap: gap of the target
    at the end; target: its impulse, impulse_time and remaining, shape (c, 3); step: to add, shape
    (c, 3).
    """

    free_separation: Array
    start_coupling: Array
    residual: Array
    active: NDArray[np.bool_]
    weight: Array
    split: Array
    friction_split: Array
    rolling_split: Array
    slip_at_end: Array
    momentum: Array
    previous_normal: Array
    previous_tangential: Array
    end_gap: Array
    target: Array
    step: Array


@compiled
def new_state(size: int) -> SolverState:
    """Room for so many contacts, to be reset."""
    numbers, vectors = np.empty((6, size)), np.empty((4, size, 3))
    return SolverState(
        free_separation=numbers[0],
        start_coupling=numbers[1],
        residual=numbers[2],
        active=np.empty(size, np.bool_),
        weight=np.empty((size, 2)),
        split=np.empty((size, 2)),
        friction_split=np.empty((size, 2)),
        rolling_split=np.empty(size),
        slip_at_end=vectors[0],
        momentum=numbers[3],
        previous_normal=numbers[4],
        previous_tangential=vectors[1],
        end_gap=numbers[5],
        target=vectors[2],
        step=vectors[3],
    )


@in_place
def reset_state(state_out: SolverState) -> None:
    """State before the first iteration: bodies are not split, and no slip is left."""
    state = state_out
    for k in range(len(state.residual)):
        state.split[k, 0] = state.split[k, 1] = 1.0
        state.friction_split[k, 0] = state.friction_split[k, 1] = 1.0
        state.rolling_split[k], state.momentum[k], state.previous_normal[k] = 1.0, 0.0, 0.0
        put(state.previous_tangential, k, (0.0, 0.0, 0.0))
        put(state.slip_at_end, k, (0.0, 0.0, 0.0))


@in_place
def state_among(state: SolverState, first: int, last: int) -> SolverState:
    """View of the state of some contacts in a row."""
    return SolverState(
        free_separation=state.free_separation[first:last],
        start_coupling=state.start_coupling[first:last],
        residual=state.residual[first:last],
        active=state.active[first:last],
        weight=state.weight[first:last],
        split=state.split[first:last],
        friction_split=state.friction_split[first:last],
        rolling_split=state.rolling_split[first:last],
        slip_at_end=state.slip_at_end[first:last],
        momentum=state.momentum[first:last],
        previous_normal=state.previous_normal[first:last],
        previous_tangential=state.previous_tangential[first:last],
        end_gap=state.end_gap[first:last],
        target=state.target[first:last],
        step=state.step[first:last],
    )


@in_place
def find_free_motion(
    contacts: Contacts, law: Law, bodies: Bodies, impulses: Impulses, state_out: SolverState
) -> None:
    """Find the separation on free paths, and the coupling by the impulses so far."""
    for k in range(len(contacts.a)):
        free = minus(
            row(bodies.free_velocity, contacts.a[k]), row(bodies.free_velocity, contacts.b[k])
        )
        state_out.free_separation[k] = (
            dot(row(contacts.normal, k), free) + contacts.turning_speed[k]
        )
        separation = separation_velocity(contacts, bodies, k)
        state_out.start_coupling[k] = _coupling(law, impulses, state_out, k, separation)


@in_place
def _target(
    world: World, contacts: Contacts, law: Law, k: int, given: int, h: float, coupling: float
) -> Target:
    slow = fast = law.restitution[k]
    middle = 1.0
    if given >= 0:
        slow, fast, middle = curve_of(world, given)
    return target_of(
        slow=slow,
        fast=fast,
        middle=middle,
        h=h,
        time=contacts.time[k],
        gap=contacts.speculative_gap[k],
        approach_speed=contacts.approach_speed[k],
        acceleration=contacts.acceleration[k],
        coupling=coupling,
    )


@in_place
def _coupling(
    law: Law, impulses: Impulses, state: SolverState, k: int, separation: float
) -> float:
    """Change of the separation velocity by the other contacts; with all it is `separation`."""
    own = impulses.normal[k] * law.inverse_effective_mass[k]
    return separation - state.free_separation[k] - own


@in_place
def _set_rebound(
    contacts: Contacts,
    law: Law,
    bodies: Bodies,
    k: int,
    grip: float,
    pull: Vector,
    target: Target,
    state_out: SolverState,
) -> None:
    """Set the slip at the end with tangential restitution beta: a t_f - beta (s - a t).

    That of gravity, a, across the normal in the flight t_f since a bounce; and of the blow, which
    turns the slip of the free motion, s, less what it gains in the time t after the impact.
    """
    fall = across(pull, row(contacts.normal, k))
    slip = times(target.flight_time, fall)
    if target.bounced:
        blow = minus(free_slip(contacts, law, bodies, k), times(target.remaining, fall))
        slip = minus(slip, times(grip, blow))
    put(state_out.slip_at_end, k, slip)


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
    gravity = gravity_of(world)
    least = _LEAST * weight_of(world) * nominal_h
    bodies, state = bodies_out, state_out
    for k in range(len(contacts.a)):
        bodies.strongest[contacts.a[k]] = bodies.strongest[contacts.b[k]] = 1e-30
    for k in range(len(contacts.a)):
        separation = separation_velocity(contacts, bodies, k)
        coupling = _coupling(law, impulses, state, k, separation)
        # what acted at the start too is a force that lasts through the substep, the rest a blow
        lasting = _minmod(state.start_coupling[k], coupling) / h if h > 0 else 0.0
        given = given_law(world, contacts.plane[k])
        target = _target(world, contacts, law, k, given, h, lasting)
        put(state.target, k, (target.impulse, target.impulse_time, target.remaining))
        pull = (0.0, 0.0, 0.0)  # of two spheres, which fall alike
        if contacts.plane[k] >= 0:
            pull = row(accelerations, contacts.a[k]) if world.in_air else gravity
            slip = times(target.flight_time, across(pull, row(contacts.normal, k)))
            put(state.slip_at_end, k, slip)
        if given >= 0 and world.laws[given, GRIP] != 0:
            grip = world.laws[given, GRIP]
            _set_rebound(contacts, law, bodies, k, grip, pull, target, state)
        state.residual[k] = target.separation_velocity - separation
        state.end_gap[k] = target.end_gap
        slowest = least + _ROUNDING * math.fabs(contacts.approach_speed[k])
        presses = impulses.normal[k] > 0 or state.residual[k] > slowest
        # a gap that the free path does not close takes a force that presses the bodies together
        gap = contacts.rest_gap[k] + contacts.speculative_gap[k]
        apart = h > 0 and lasting >= 0 and gap > TOUCH * world.radius[contacts.a[k]]
        state.active[k] = target.active and presses and not apart
        # weight 0 holds the force until the strongest of each body is known
        own = impulses.normal[k] * law.inverse_effective_mass[k]
        strength = own + math.fabs(state.residual[k])
        state.weight[k, 0] = strength if state.active[k] else 0.0
        for body in (contacts.a[k], contacts.b[k]):
            bodies.strongest[body] = max(bodies.strongest[body], state.weight[k, 0])
    for k in range(len(contacts.a)):
        strength = state.weight[k, 0]
        for side, body in enumerate((contacts.a[k], contacts.b[k])):
            total = strength + _FAINT * bodies.strongest[body]
            state.weight[k, side] = (1.0 + _FAINT) * strength / total
