# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Events within a substep, at which the motion of a small island changes its kind."""

from __future__ import annotations

import math

from .contact_law import Law
from .contacts import Contacts
from .impact import TOUCH
from .impulses import Bodies, separation_velocity
from .world import weight_of, World
from ..kernels.jit import in_place

# most contacts of an island that is advanced from event to event
MOST_OF_EVENTS = 6
# edges crossed nearer to the start or end of a substep than this share of it are crossed there
NEAR = 1e-4
# blows faster than this [g h] are events: others are those of bodies that lie on each other
_BLOW = 1.0


@in_place
def is_blow(world: World, contacts: Contacts, k: int, nominal_h: float) -> bool:
    """Whether contact k is a blow rather than one of bodies that lie or roll on each other."""
    fall = weight_of(world) * nominal_h
    hits = contacts.speculative_gap[k] == 0
    return hits and contacts.approach_speed[k] > _BLOW * fall + 1e-12


@in_place
def has_event(
    world: World, contacts: Contacts, k: int, h: float, nominal_h: float, shared: bool
) -> bool:
    """Whether contact k has an event: a blow on a body with other contacts, or a crossed edge.

    In air every blow is one, since drag and lift are others after it.
    """
    if (shared or world.in_air) and is_blow(world, contacts, k, nominal_h):
        return h > 0
    return NEAR * h < contacts.crossing_time[k] < (1.0 - NEAR) * h


@in_place
def opening_time(
    contacts: Contacts,
    law: Law,
    bodies: Bodies,
    k: int,
    before: float,
    now: float,
    last_h: float,
    h: float,
) -> float:
    """When a body that rolls around another leaves it, infinite if it does not.

    The force falls until it is 0: it is taken as linear in time, from its means over the last step
    and this one, which is negative where the contact has opened already.

    Args:
        contacts: All contacts of the substep.
        law: Their coefficients.
        bodies: With the changes by all impulses.
        k: Index of the contact.
        before: Normal impulse of the last step, as if that had been as long as this one.
        now: That of this one.
        last_h: Length of the last step.
        h: Length of this one.
    """
    if contacts.turning_speed[k] <= 0 or before <= 0:
        return math.inf
    if now == 0:
        now = -max(separation_velocity(contacts, bodies, k), 0.0) / law.inverse_effective_mass[k]
    if now >= before:
        return math.inf
    return 0.5 * h + 0.5 * (h + last_h) * now / (before - now)


@in_place
def next_event(world: World, contacts: Contacts, h: float, nominal_h: float) -> tuple[float, bool]:
    """Time of the first event, infinite where there is none, and whether it is a blow.

    Args:
        world: What does not move.
        contacts: Contacts of the island.
        h: What is left of the substep.
        nominal_h: Length of a regular substep.
    """
    first, blow = math.inf, False
    for k in range(len(contacts.a)):
        if is_blow(world, contacts, k, nominal_h):
            # what a step of length 0 takes for a touch, which is what solves a blow
            rounding = 0.5 * TOUCH * world.radius[contacts.a[k]]
            closing = contacts.time[k] * contacts.approach_speed[k]
            time = contacts.time[k] if closing > rounding else 0.0
            if time <= first:
                first, blow = time, True
        crossing = contacts.crossing_time[k]
        if NEAR * nominal_h < crossing < h - NEAR * nominal_h and crossing < first:
            first, blow = crossing, False
    return first, blow
