"""Impulses of all contacts of a substep, by rounds of a law whose pace the network sets.

The same as models/contact/solver.py: every round recomputes what each contact feels of the others
and takes a damped step (mass splitting) towards the law of one contact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..models.configs import CONTACT_FEATURES, ROUND_FEATURES
from ..state import Array
from .contacts import Contacts
from .impulses import Bodies, Impulses, begin, own_slip, parting_of, push, slip_now, slip_of, spin
from .jit import compiled, in_place
from .law import Aim, Law, aim_of
from .neighbours import Indices
from .network import Floats, Weights, describe, encode, plain, read_round, sum_latents, tune
from .vector import Vector, across, add_to, clip, cross, dot, length, minus, plus, put, row, times
from .world import UNIT_GRAVITY, World

# contacts with this part of the force of a body's strongest count half
_FAINT = 0.01


class Rounds(NamedTuple):
    """Contacts that are solved, and what is known of each from round to round.

    group: which contacts, shape (c,); approach, free_parting, free_slip: of their free paths;
    start_others, start_slip: what the others made of them at the start; others: and now; lacking:
    what its normal velocity lacks; pressing: whether it presses; weight: how much it counts at a
    and b, 0 to 1, shape (c, 2); drag: what gravity does to the
    slip of a sphere that bounced; pace: normal, of friction, momentum, shape (c, 3); last_normal,
    last_tangential: impulses before the last step; aim: impulse, lever and rest of the last round,
    shape (c, 3); step: to add, shape (c, 3); latent: shape (w, c).
    """

    group: Indices
    approach: Array
    free_parting: Array
    free_slip: Array
    start_others: Array
    start_slip: Array
    others: Array
    lacking: Array
    pressing: NDArray[np.bool_]
    weight: Array
    drag: Array
    pace: Array
    last_normal: Array
    last_tangential: Array
    aim: Array
    step: Array
    latent: Floats


@compiled
def _rounds(group: Indices, width: int) -> Rounds:
    size = len(group)
    one, three = np.zeros((6, size)), np.zeros((7, size, 3))
    return Rounds(
        group,
        one[0],
        one[1],
        three[0],
        one[2],
        three[1],
        one[3],
        one[4],
        np.zeros(size, np.bool_),
        np.zeros((size, 2)),
        three[2],
        three[3],
        one[5],
        three[4],
        three[5],
        three[6],
        np.zeros((width, size), np.float32),
    )


@compiled
def solve(
    world: World,
    c: Contacts,
    law: Law,
    group: Indices,
    bodies: Bodies,
    start: Impulses,
    support: Impulses,
    h: float,
    pace: float,
    rounds: int,
    weights: Weights,
    made: Impulses,
) -> Array:
    """Solve some contacts of a substep; returns the speed by which the last round changed each.

    Args:
        world: What does not move.
        c: Contacts.
        law: Their coefficients.
        group: Those to solve; no other contact may have one of their moving bodies.
        bodies: Changes of theirs are written.
        start: Impulses to start from, those of the last substep where contacts persist.
        support: Impulses that last, where they are not those to start from.
        h: Length of the substep; 0 for one that only mends what the last one missed.
        pace: Length of a substep as such, to which speeds are compared.
        rounds: M, rounds of message passing.
        weights: Of the network; none: the law alone.
        made: Impulses, written.
    """
    if len(group) == 0:
        return np.empty(0)
    learned = len(weights.rounds) > 0
    r = _rounds(group, weights.encoder.shape[1])
    begin(world, c, law, group, support, bodies, made)
    _look_ahead(world, c, law, bodies, made, r, h, pace, weights)
    begin(world, c, law, group, start, bodies, made)
    for q, k in enumerate(group):
        r.last_normal[q] = made.normal[k]
        put(r.last_tangential, q, row(made.tangential, k))
        if learned:
            put(r.start_slip, q, _slip_of_others(world, c, law, bodies, made, r, q))
    for index in range(rounds):
        _compare(world, c, law, bodies, made, r, h, pace)
        if learned:
            _set_pace(world, c, law, bodies, made, r, pace, weights, index)
        else:
            plain(_loads(c, bodies, r), r.pace)
        _press(world, c, bodies, made, r)
        _roll(world, c, law, bodies, made, r)
        _rub(world, c, law, bodies, made, r)
    unsettled = np.empty(len(group))
    _displace(world, c, law, bodies, made, r, unsettled)
    return unsettled


@compiled
def _look_ahead(
    world: World,
    c: Contacts,
    law: Law,
    bodies: Bodies,
    made: Impulses,
    r: Rounds,
    h: float,
    pace: float,
    weights: Weights,
) -> None:
    """What free paths bring to each contact, and what the others make of that."""
    learned = len(weights.rounds) > 0
    features = np.empty((CONTACT_FEATURES if learned else 0, len(r.group)), np.float32)
    for q, k in enumerate(r.group):
        a, b, normal = c.a[k], c.b[k], row(c.normal, k)
        before = minus(row(bodies.before, a), row(bodies.before, b))
        r.approach[q] = -dot(normal, before) - max(c.time[k], 0.0) * c.pull[k]
        one, other = row(bodies.velocity, a), row(bodies.velocity, b)
        r.free_parting[q] = dot(normal, minus(one, other))
        r.start_others[q] = _others(c, law, bodies, made, r, q)
        slip = slip_of(c, law, k, one, other, row(bodies.spin, a), row(bodies.spin, b))
        put(r.free_slip, q, slip)
        if learned:
            aim = _aim(c, law, r, q, h, 0.0)
            describe(
                world,
                c,
                law,
                k,
                pace,
                r.approach[q],
                aim.flying,
                r.free_parting[q],
                slip,
                row(bodies.spin, a),
                row(bodies.spin, b),
                features[:, q],
            )
    if learned:
        encode(weights, features, r.latent)


@in_place
def _aim(c: Contacts, law: Law, r: Rounds, q: int, h: float, extra: float) -> Aim:
    k = r.group[q]
    return aim_of(law.restitution[k], h, c.time[k], c.open[k], r.approach[q], c.pull[k], extra)


@in_place
def _others(c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds, q: int) -> float:
    """Change of normal velocity that the other contacts make."""
    k = r.group[q]
    return parting_of(c, bodies, k) - r.free_parting[q] - made.normal[k] * law.unit[k]


@in_place
def _slip_of_others(
    world: World, c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds, q: int
) -> Vector:
    """Change of slip that the other contacts make."""
    k = r.group[q]
    slip = minus(slip_now(c, law, bodies, k), row(r.free_slip, q))
    return minus(slip, own_slip(world, c, law, made, k))


@in_place
def _common(one: float, other: float) -> float:
    """The smaller of two numbers of one sign, else 0."""
    if one * other > 0:
        return math.copysign(min(math.fabs(one), math.fabs(other)), one)
    return 0.0


@in_place
def _compare(
    world: World,
    c: Contacts,
    law: Law,
    bodies: Bodies,
    made: Impulses,
    r: Rounds,
    h: float,
    pace: float,
) -> None:
    """What each contact lacks of its law, and how many press on each body.

    The strongest of a body counts 1, one of no force nothing, so that contacts that carry nothing
    change nothing.
    """
    gravity = (world.gravity[0], world.gravity[1], world.gravity[2])
    least = 1e-9 * UNIT_GRAVITY * pace
    for k in r.group:
        bodies.load[c.a[k]] = bodies.load[c.b[k]] = 0.0
        bodies.most[c.a[k]] = bodies.most[c.b[k]] = 1e-30
    for q, k in enumerate(r.group):
        r.others[q] = _others(c, law, bodies, made, r, q)
        extra = _common(r.start_others[q], r.others[q]) / h if h > 0 else 0.0
        aim = _aim(c, law, r, q, h, extra)
        put(r.aim, q, (aim.impulse, aim.lever, aim.rest))
        if c.plane[k] >= 0:
            put(r.drag, q, times(aim.airborne, across(gravity, row(c.normal, k))))
        r.lacking[q] = aim.parting - parting_of(c, bodies, k)
        r.pressing[q] = aim.hit and (made.normal[k] > 0 or r.lacking[q] > least)
        # a strength until the strongest of each body is known
        carried = made.normal[k] * law.unit[k] + math.fabs(r.lacking[q])
        r.weight[q, 0] = carried if r.pressing[q] else 0.0
        for body in (c.a[k], c.b[k]):
            bodies.most[body] = max(bodies.most[body], r.weight[q, 0])
    for q, k in enumerate(r.group):
        strength = r.weight[q, 0]
        for side, body in enumerate((c.a[k], c.b[k])):
            r.weight[q, side] = (1.0 + _FAINT) * strength / (strength + _FAINT * bodies.most[body])
            bodies.load[body] += r.weight[q, side]
    bodies.load[-1] = 1.0
    for k in r.group:
        bodies.load[c.a[k]] = max(bodies.load[c.a[k]], 1.0)
        bodies.load[c.b[k]] = max(bodies.load[c.b[k]], 1.0)


@compiled
def _set_pace(
    world: World,
    c: Contacts,
    law: Law,
    bodies: Bodies,
    made: Impulses,
    r: Rounds,
    pace: float,
    weights: Weights,
    index: int,
) -> None:
    """A round of message passing."""
    fixed, width = len(bodies.load) - 1, len(r.latent)
    inputs = np.empty((2 * width + ROUND_FEATURES, len(r.group)), np.float32)
    sum_latents(c, r.group, r.latent, r.weight, fixed, bodies.total)
    load = _loads(c, bodies, r)
    for q, k in enumerate(r.group):
        a, b = c.a[k], c.b[k]
        for i in range(width):
            around = bodies.total[a, i] - r.weight[q, 0] * r.latent[i, q]
            if b != fixed:
                around += bodies.total[b, i] - r.weight[q, 1] * r.latent[i, q]
            inputs[i, q], inputs[width + i, q] = r.latent[i, q], around
        slip = slip_now(c, law, bodies, k)
        other = minus(minus(slip, row(r.free_slip, q)), own_slip(world, c, law, made, k))
        read_round(
            r.lacking[q],
            length(minus(slip, row(r.drag, q))),
            made.normal[k] * law.unit[k],
            r.others[q] - r.start_others[q],
            length(minus(other, row(r.start_slip, q))),
            load[q],
            UNIT_GRAVITY * pace,
            inputs[2 * width :, q],
        )
    tune(weights, index, inputs, load, r.latent, r.pace)


@compiled
def _loads(c: Contacts, bodies: Bodies, r: Rounds) -> Array:
    """Contacts that press on the more loaded body of each contact, shape (c,)."""
    load = np.empty(len(r.group))
    for q, k in enumerate(r.group):
        load[q] = max(bodies.load[c.a[k]], bodies.load[c.b[k]])
    return load


@in_place
def _press(world: World, c: Contacts, bodies: Bodies, made: Impulses, r: Rounds) -> None:
    """Normal impulses."""
    for q, k in enumerate(r.group):
        a, b, old = c.a[k], c.b[k], made.normal[k]
        split = bodies.load[a] * world.inverse_mass[a] + bodies.load[b] * world.inverse_mass[b]
        more = r.pace[q, 2] * (old - r.last_normal[q]) + r.pace[q, 0] * r.lacking[q] / split
        r.last_normal[q] = old
        made.normal[k] = max(old + more, 0.0) if r.pressing[q] else 0.0
    for q, k in enumerate(r.group):
        push(world, c, bodies, k, times(made.normal[k] - r.last_normal[q], row(c.normal, k)))


@in_place
def _stiffness(world: World, c: Contacts, law: Law, bodies: Bodies, k: int, pace: float) -> float:
    """Inverse of the tangential impulse that a unit of slip calls for."""
    a, b = c.a[k], c.b[k]
    one = bodies.load[a] * (world.inverse_mass[a] + law.spin_a[k])
    return (one + bodies.load[b] * (world.inverse_mass[b] + law.spin_b[k])) / pace


@in_place
def _roll(world: World, c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds) -> None:
    """Torque of rolling friction: at most rho r N, and no more than stops the rolling.

    Where the contact sticks, what rolls is the angular momentum about the contact point, which
    friction does not change; where it slips, that about the centre.
    """
    for q, k in enumerate(r.group):
        put(r.step, q, (0.0, 0.0, 0.0))
        if law.rolling[k] == 0:
            continue
        a, normal, old = c.a[k], row(c.normal, k), row(made.rolling, k)
        stiffness = _stiffness(world, c, law, bodies, k, r.pace[q, 1])
        slip = minus(slip_now(c, law, bodies, k), row(r.drag, q))
        wanted = minus(row(made.tangential, k), times(1.0 / stiffness, slip))
        spinning = plus(row(bodies.spin, a), row(bodies.turn, a))
        about = times(1.0 / world.inverse_inertia[a], spinning)
        flat = across(about, normal)
        rolls = flat
        if length(wanted) <= law.friction[k] * made.normal[k]:
            moving = plus(row(bodies.velocity, a), row(bodies.change, a))
            orbit = cross(normal, across(moving, normal))
            rolls = across(plus(about, times(law.arm_a[k] / world.inverse_mass[a], orbit)), normal)
        resist = minus(old, times(1.0 / bodies.load[a], plus(rolls, minus(about, flat))))
        most = law.rolling[k] * made.normal[k]
        twist = min(max(dot(resist, normal), -most), most)
        resist = plus(clip(across(resist, normal), most), times(twist, normal))
        put(made.rolling, k, resist)
        put(r.step, q, minus(resist, old))
    for q, k in enumerate(r.group):
        a = c.a[k]
        add_to(bodies.turn, a, times(world.inverse_inertia[a], row(r.step, q)))


@in_place
def _rub(world: World, c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds) -> None:
    """Friction: it stops slip, as far as the cone allows."""
    for q, k in enumerate(r.group):
        old = row(made.tangential, k)
        stiffness = _stiffness(world, c, law, bodies, k, r.pace[q, 1])
        more = times(r.pace[q, 2], minus(old, row(r.last_tangential, q)))
        slip = minus(slip_now(c, law, bodies, k), row(r.drag, q))
        wanted = plus(old, minus(more, times(1.0 / stiffness, slip)))
        new = clip(wanted, law.friction[k] * made.normal[k])
        put(r.last_tangential, q, old)
        put(made.tangential, k, new)
        put(r.step, q, minus(new, old))
    for q, k in enumerate(r.group):
        push(world, c, bodies, k, row(r.step, q))
        spin(world, c, law, bodies, k, row(r.step, q))


@in_place
def _displace(
    world: World, c: Contacts, law: Law, bodies: Bodies, made: Impulses, r: Rounds, unsettled: Array
) -> None:
    """Displacements beyond those of free flight, and the speed that the last round changed.

    What a contact alone would get acts as if at its lever before the end; what others add to it is
    spread over the rest of the substep.
    """
    for k in r.group:
        put(bodies.moved, c.a[k], (0.0, 0.0, 0.0))
        put(bodies.moved, c.b[k], (0.0, 0.0, 0.0))
    for q, k in enumerate(r.group):
        a, b = c.a[k], c.b[k]
        alone, lever, rest = row(r.aim, q)
        share = min(made.normal[k], alone / law.unit[k]) / max(made.normal[k], 1e-30)
        lever = share * lever + (1.0 - share) * 0.5 * rest
        impulse = plus(times(made.normal[k], row(c.normal, k)), row(made.tangential, k))
        add_to(bodies.moved, a, times(lever * world.inverse_mass[a], impulse))
        add_to(bodies.moved, b, times(-lever * world.inverse_mass[b], impulse))
        unsettled[q] = math.fabs(made.normal[k] - r.last_normal[q]) * law.unit[k]
