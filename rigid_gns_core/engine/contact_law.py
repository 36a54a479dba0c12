# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The law of one contact alone: coefficients, and where it ends up along its normal.

Normal impact is Newton's: bodies that approach at u separate at e(u) u. Friction is Coulomb's,
|tangential impulse| <= mu times the normal one, and rolling friction has an angular impulse of at
most (rho + rho' v) r times it: both are in steps.py. `scenes.contact_law` has the formulas.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .contacts import Contacts
from .restitution import restitution_at
from .world import given_law, ROLL, SLIDE, SLOPE, SLOW, SPIN, THRESHOLD_TIME, weight_of, World
from ..kernels.jit import compiled, in_place
from ..scenes.state import Array

# restitutions nearer to 1 than this have no geometric series, but flights of one length
_ELASTIC = 1e-9
# resistance to rolling of a contact that resists only otherwise
_NEXT_TO_NOTHING = 1e-300
# restitutions up to this do not bounce
NO_BOUNCE = 1e-3
# speeds below this are rounding
ROUNDING = 1e-12


class Law(NamedTuple):
    """Coefficients of the contacts of one substep, shape (c,) each.

    restitution, friction: of the pair; rolling: rho r [lengths], 0 between spheres;
    inverse_effective_mass: change of separation velocity by a unit of normal impulse,
    1 / m_a + 1 / m_b; arm_a, arm_b: l, from centre to contact point; rotation_a, rotation_b:
    l^2 / I, what rotation adds to it across the normal.
    """

    restitution: Array
    friction: Array
    rolling: Array
    inverse_effective_mass: Array
    arm_a: Array
    arm_b: Array
    rotation_a: Array
    rotation_b: Array


class Target(NamedTuple):
    """Where a contact alone would end up, under its present acceleration.

    active: whether the bodies touch at all; bounced: whether a blow parts them;
    separation_velocity: at the end of the substep; flight_time: since the last bounce where they
    are apart at the end, else 0; end_gap: gap at the end; impulse: normal impulse over effective
    mass; impulse_time: time before the end at which that impulse, acting at once, leads to the
    same place; remaining: time from the impact to the end of the substep.
    """

    active: bool
    bounced: bool
    separation_velocity: float
    flight_time: float
    end_gap: float
    impulse: float
    impulse_time: float
    remaining: float


@compiled
def new_law(size: int) -> Law:
    """Coefficients of so many contacts, to be written."""
    own = np.empty((8, size))
    return Law(
        restitution=own[0],
        friction=own[1],
        rolling=own[2],
        inverse_effective_mass=own[3],
        arm_a=own[4],
        arm_b=own[5],
        rotation_a=own[6],
        rotation_b=own[7],
    )


@in_place
def find_law(world: World, contacts: Contacts, law_out: Law) -> None:
    """Coefficients of contacts: those of their contact law, or else products of materials.

    e = e_a e_b and mu = mu_a mu_b, of a sphere and a surface too. A contact law resists rolling
    where bodies lie on each other, but not in a blow, which has Walton's three parameters;
    materials do in both, as the teacher's.
    """
    weight = weight_of(world)
    law = law_out
    for k in range(len(contacts.a)):
        a, b, plane, gap = contacts.a[k], contacts.b[k], contacts.plane[k], contacts.gap[k]
        if plane >= 0:
            restitution, friction = world.laws[plane, SLOW], world.laws[plane, SLIDE]
            law.rolling[k] = world.rolling_friction[a] * world.radius[a]
            law.arm_a[k], law.arm_b[k] = world.radius[a] + gap, 0.0
        else:
            restitution, friction = world.restitution[b], world.friction[b]
            law.rolling[k] = 0.0
            law.arm_a[k], law.arm_b[k] = world.radius[a] + 0.5 * gap, world.radius[b] + 0.5 * gap
        law.restitution[k] = world.restitution[a] * restitution
        law.friction[k] = world.friction[a] * friction
        given = given_law(world, plane)
        if given >= 0:
            law.restitution[k], law.friction[k] = world.laws[given, SLOW], world.laws[given, SLIDE]
            law.rolling[k] = 0.0
            if contacts.approach_speed[k] <= THRESHOLD_TIME * weight:
                law.rolling[k] = _rolling_of(world, given, world.radius[a])
        law.inverse_effective_mass[k] = world.inverse_mass[a] + world.inverse_mass[b]
        law.rotation_a[k] = law.arm_a[k] * law.arm_a[k] * world.inverse_inertia[a]
        law.rotation_b[k] = law.arm_b[k] * law.arm_b[k] * world.inverse_inertia[b]


@in_place
def law_among(law: Law, first: int, last: int) -> Law:
    """View of the law of some contacts in a row."""
    return Law(
        restitution=law.restitution[first:last],
        friction=law.friction[first:last],
        rolling=law.rolling[first:last],
        inverse_effective_mass=law.inverse_effective_mass[first:last],
        arm_a=law.arm_a[first:last],
        arm_b=law.arm_b[first:last],
        rotation_a=law.rotation_a[first:last],
        rotation_b=law.rotation_b[first:last],
    )


@in_place
def _rolling_of(world: World, given: int, radius: float) -> float:
    """Resistance rho r by a contact law: more than 0 where it has any of rho, rho' and sigma."""
    others = world.laws[given, SLOPE] + world.laws[given, SPIN]
    return max(world.laws[given, ROLL] * radius, _NEXT_TO_NOTHING if others > 0 else 0.0)


@in_place
def target_of(
    slow: float,
    fast: float,
    middle: float,
    h: float,
    time: float,
    gap: float,
    approach_speed: float,
    acceleration: float,
    coupling: float,
) -> Target:
    """Where one contact alone ends up along its normal, after all bounces of a substep.

    The coupling c moves the impact from its time t0 on the free path to t0 + t, with t the first
    root of (d + c t0^2 / 2) - (u - c t0) t + (a + c) t^2 / 2 = 0, and gives an approach speed u
    there. With N = -(a + c) and Newton's restitution, flights take 2 e^k u / N, k = 1, 2, ...,
    a geometric series: in the time T after the impact there are
    n = floor(log(1 - T N (1 - e) / (2 e u)) / log(e)) of them, floor(T N / (2 u)) where e = 1, and
    the last bounce was 2 e u / N (1 - e^n) / (1 - e) after the impact, at e^(n+1) u. The contact
    rests where an approach is slower than N times `THRESHOLD_TIME`, or where all flights of the
    series end within T (the logarithm's argument is not positive). So small bounces need no small
    substeps. Where e depends on u, flights are followed one by one. Where nothing presses the
    bodies together, N <= 0, they part at e u, however slow.

    Args:
        slow: e_slow of the restitution, see `restitution_at`.
        fast: e_fast.
        middle: u_0.
        h: Length of the substep.
        time: t0, negative where the bodies overlap.
        gap: d, gap of a speculative contact, else 0.
        approach_speed: u, on the free path.
        acceleration: a, relative acceleration of free motion along the normal.
        coupling: c, relative acceleration along the normal by other contacts: a sphere that others
            hold does not fall.
    """
    acceleration += coupling
    fall, before = -acceleration, max(time, 0.0)
    gap += 0.5 * coupling * before * before
    closing = approach_speed - coupling * before
    root = closing * closing + 2.0 * fall * gap
    later, meets = 0.0, root >= 0
    # bodies that touch and part slower than this stay: so much is left by rounding and by turning
    touches = before == 0 and gap == 0
    rests = touches and closing >= -THRESHOLD_TIME * max(fall, 0.0) - ROUNDING
    if closing > 0:
        later = 2.0 * gap / (closing + math.sqrt(max(root, 0.0)))
    elif fall > 0 and meets:
        later = (math.sqrt(root) - closing) / fall
    else:
        meets = False
    meets = meets and before + later <= h
    active = touches or meets
    later = max(later, -before) if meets and not rests else 0.0
    # what leaves acts only if others push it back
    leaves = touches and not (rests or meets)
    approach_speed = closing - acceleration * later
    remaining = max(h - before - later, 0.0)
    closing = approach_speed if rests or leaves else max(approach_speed, 0.0)
    late = (before - time) * closing  # depth that a missed impact has led to
    fallen = closing * remaining + 0.5 * fall * remaining * remaining
    separation, height, flight_time, bounced = 0.0, 0.0, 0.0, False
    e = restitution_at(slow, fast, middle, closing)
    speed = -closing if leaves else e * closing
    if leaves or fall <= 0:
        flight_time, bounced = remaining, True
    elif slow != fast:
        since, speed = _last_flight(slow, fast, middle, closing, fall, remaining)
        bounced = since >= 0
        flight_time = since if bounced else 0.0
    elif closing > THRESHOLD_TIME * fall and e > NO_BOUNCE:
        flights, series, damping = _flights(e, speed, fall, remaining)
        # the first flight whose approach is too slow is not begun
        most = math.ceil(math.log(THRESHOLD_TIME * fall / closing) / math.log(e)) if e < 1 else 1e9
        bounced = flights < most
        if bounced:
            flight_time = remaining - series
            speed *= damping
    if bounced:
        separation = speed - fall * flight_time
        height = speed * flight_time - 0.5 * fall * flight_time * flight_time
        late *= 1.0 + e
    impulse = separation + closing + fall * remaining
    if leaves:
        separation = min(separation, 0.0)
    return Target(
        active=active,
        bounced=bounced and not leaves,
        separation_velocity=separation,
        flight_time=flight_time,
        end_gap=height + late,
        impulse=impulse,
        impulse_time=(height + fallen + late) / max(impulse, 1e-9),
        remaining=remaining,
    )


@in_place
def _last_flight(
    slow: float, fast: float, middle: float, speed: float, fall: float, remaining: float
) -> tuple[float, float]:
    """Time since the last bounce, and its speed, after bounces of a restitution curve.

    The time is -1 where an approach was too slow to bounce: each flight but the last takes at
    least 2 e `THRESHOLD_TIME`, so that there are few.

    Args:
        slow: e_slow.
        fast: e_fast.
        middle: u_0.
        speed: Of the first approach.
        fall: Acceleration that ends flights.
        remaining: Time after the first impact.
    """
    while speed > THRESHOLD_TIME * fall:
        speed *= restitution_at(slow, fast, middle, speed)
        flight = 2.0 * speed / fall
        if flight > remaining:
            return remaining, speed
        remaining -= flight
    return -1.0, 0.0


@in_place
def _flights(e: float, speed: float, fall: float, remaining: float) -> tuple[float, float, float]:
    """Flights that end within a time: their number n, how long they take, and e^n.

    Infinitely many where all of the series do.

    Args:
        e: Restitution.
        speed: At which the first begins.
        fall: Acceleration that ends them.
        remaining: The time.
    """
    first = 2.0 * speed / fall
    if 1.0 - e < _ELASTIC:
        flights = math.floor(remaining / first)
        return flights, flights * first, 1.0
    argument = 1.0 - remaining * (1.0 - e) / first
    if argument <= 0:
        return math.inf, 0.0, 0.0
    flights = max(math.floor(math.log(argument) / math.log(e)), 0.0)
    damping = math.exp(flights * math.log(e))
    return flights, first * (1.0 - damping) / (1.0 - e), damping
