# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Events within a substep, at which the motion of a small island changes its kind."""

from __future__ import annotations

import math

from .broad_phase import Candidates
from .contact_law import Law
from .contacts import Contacts
from .groups import Order
from .impact import TOUCH
from .impacts import APPROACH_SPEED, CROSSING_TIME, Impacts, SPECULATIVE_GAP, TURNING_SPEED
from .impulses import Bodies, Impulses, separation_velocity
from .world import weight_of, World
from ..kernels.jit import in_place
from ..kernels.neighbours import Indices
from ..scenes.state import Array

# most contacts of an island that is advanced from event to event
MOST_OF_EVENTS = 6
# edges crossed nearer to the start or end of a substep than this share of it are crossed there
NEAR = 1e-4
# blows faster than this [g h] are events: others are those of bodies that lie on each other
_BLOW = 1.0


@in_place
def is_blow(world: World, contacts: Contacts, k: int, nominal_h: float) -> bool:
    """Whether contact k is a blow rather than one of bodies that lie or roll on each other."""
    return _is_fast(world, contacts.speculative_gap[k], contacts.approach_speed[k], nominal_h)


@in_place
def _is_fast(world: World, gap: float, approach_speed: float, nominal_h: float) -> bool:
    """The same for a contact of this speculative gap and approach speed."""
    return gap == 0 and approach_speed > _BLOW * weight_of(world) * nominal_h + 1e-12


@in_place
def _crosses(time: float, h: float) -> bool:
    """Whether an edge is crossed within a step."""
    return NEAR * h < time < (1.0 - NEAR) * h


@in_place
def has_event(
    world: World, contacts: Contacts, k: int, h: float, nominal_h: float, shared: bool
) -> bool:
    """Whether contact k has an event: a blow on a body with other contacts, or a crossed edge.

    In air every blow is one, since drag and lift are others after it.
    """
    if (shared or world.in_air) and is_blow(world, contacts, k, nominal_h):
        return h > 0
    return _crosses(contacts.crossing_time[k], h)


@in_place
def set_events_aside(
    world: World,
    candidates: Candidates,
    impacts: Impacts,
    before: Impulses,
    size: int,
    islands: int,
    h: float,
    nominal_h: float,
    order_out: Order,
    label_out: Indices,
    opening_out: Array,
) -> int:
    """Leave out islands of which is known, before they are solved, that they have events.

    Those are not solved for nothing, as they are advanced anew from event to event. Where a
    contact may open its time is known only from the forces. Returns how many there are.

    Args:
        world: What does not move.
        candidates: All of the frame.
        impacts: Theirs.
        before: Impulses of the last step, by candidate.
        size: How many contacts are labelled.
        islands: How many islands of several contacts there are.
        h: Length of the step.
        nominal_h: Of a regular substep.
        order_out: With the labels; that of a contact that is left out becomes -1.
        label_out: Number of the island of each sphere of theirs; written.
        opening_out: When a contact of theirs opens, infinite; written.
    """
    order, v, fixed, events = order_out, impacts.values, len(world.restitution), 0
    count, has = order.begin, order.place  # not in use yet
    for island in range(1, islands + 1):
        count[island], has[island] = 0, 0
    for c in range(size):
        k, island = order.which[c], order.label[c]
        count[island] += 1
        if v[TURNING_SPEED, k] > 0 and before.normal[k] > 0:
            count[island] += MOST_OF_EVENTS
        fast = _is_fast(world, v[SPECULATIVE_GAP, k], v[APPROACH_SPEED, k], nominal_h)
        if fast or _crosses(v[CROSSING_TIME, k], h):
            has[island] = 1
    for island in range(1, islands + 1):
        if has[island] > 0 and count[island] <= MOST_OF_EVENTS:
            opening_out[events] = math.inf
            events += 1
            has[island] = events
        else:
            has[island] = 0
    for c in range(size if events > 0 else 0):
        k, island = order.which[c], order.label[c]
        if island > 0 and has[island] > 0:
            label_out[candidates.a[k]] = has[island] - 1
            if candidates.b[k] < fixed:
                label_out[candidates.b[k]] = has[island] - 1
            order.label[c] = -1
    return events


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
