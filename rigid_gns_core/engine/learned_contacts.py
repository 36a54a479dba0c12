# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts of a frame as a residual network sees them: what a body meets, and what the laws did.

Only differences of positions and velocities enter, along the normal of a contact, along its slip,
and along gravity, so that nothing changes with a translation, a rotation about gravity, or the
order of the spheres. Each contact of two spheres is seen from both, and of a surface from one.

The network may change a contact by at most its *scale*, an impulse:

    S = m (|k_a| + |k_b| + 2 o / dt - c),   1 / m = 1 / m_a + 1 / m_b,

with o the overlap at the start of the frame, and k the smaller one of the change of a body's
velocity and of its change beyond free flight. It is zero in flight and at rest, so that a
contact at rest, and one that the laws do not know of, is none of the network's.

A start that was observed may be in the middle of a blow; what the network itself leads to never
is, since it learns from states after blows. A feature tells them apart.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .broad_phase import Candidates
from .rectangle import from_plane, is_over_face
from .shielding import offset_from_plane
from .spheres import Spheres
from .world import World
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import across, cross, dot, length, minus, plus, put, row, times, Vector
from ..scenes.state import Array

FEATURES = 23
"""Numbers that describe a contact as one of its bodies sees it."""

NEAR = 0.1
"""Gaps [radii] up to which bodies may have touched."""
# speeds [m/s] below which a slip has no direction, and rates [rad/s] below which a spin has none
_SLIP, _SPIN = 0.05, 0.1
# change of velocity [m/s] up to which a contact is at rest
_REST = 0.02


class LearnedContacts(NamedTuple):
    """Contacts of a frame, c of them; the model's units.

    a: sphere; b: the other sphere, or -1 for a surface; normal: from b to a at the time of
    contact; slip: direction in which a slips over b, of length 1 or less; roll: direction of the
    difference of spins across the normal, of length 1 or less; spin: that along it, in [-1, 1];
    shape (c, 3) or (c,). features: seen from a and from b, shape (c, 2, FEATURES); scale: the
    largest impulse, shape (c,).
    """

    a: Indices
    b: Indices
    normal: Array
    slip: Array
    roll: Array
    spin: Array
    features: Array
    scale: Array


class _Meeting(NamedTuple):
    """Relative motion of two bodies: offsets of a from b before and after, and of the frame.

    time: when they touch, or are nearest, on free paths; touches: whether they do; offset: then.
    """

    before: Vector
    after: Vector
    time: float
    touches: bool
    offset: Vector


@compiled
def find_learned_contacts(
    world: World,
    candidates: Candidates,
    before: Spheres,
    after: Spheres,
    dt: float,
    asleep: Flags,
    is_start: bool,
) -> LearnedContacts:
    """Contacts of a frame that a residual network may change.

    Args:
        world: What does not move.
        candidates: Of the frame.
        before: State at the start of the frame.
        after: State that the laws lead to.
        dt: Length of the frame.
        asleep: Spheres that sleep after it, which nothing has touched; shape (n,).
        is_start: Whether `before` was observed.
    """
    count = len(asleep)
    kicks, pushes = changes_by_laws(world, before, after, dt)
    chosen = np.empty(len(candidates.a), np.int64)
    size, most = 0, 0
    for k in range(len(chosen)):  # of those in flight there may be thousands
        a, b = candidates.a[k], candidates.b[k]
        fixed = b == count
        if not (asleep[a] or (not fixed and asleep[b])):
            kick = kicks[a] + (0.0 if fixed else kicks[b])
            if kick > _REST or overlap_of(world, candidates, k, before.positions) > 0:
                chosen[most] = k
                most += 1
    found = LearnedContacts(
        a=np.empty(most, np.int64),
        b=np.empty(most, np.int64),
        normal=np.empty((most, 3)),
        slip=np.empty((most, 3)),
        roll=np.empty((most, 3)),
        spin=np.empty(most),
        features=np.zeros((most, 2, FEATURES)),
        scale=np.empty(most),
    )
    for k in chosen[:most]:
        b = candidates.b[k]
        kick = kicks[candidates.a[k]] + (kicks[b] if b < count else 0.0)
        if _describe(world, before, after, dt, candidates, k, pushes, kick, size, found):
            found.features[size, :, FEATURES - 1] = 1.0 if is_start else 0.0
            size += 1
    return LearnedContacts(
        a=found.a[:size],
        b=found.b[:size],
        normal=found.normal[:size],
        slip=found.slip[:size],
        roll=found.roll[:size],
        spin=found.spin[:size],
        features=found.features[:size],
        scale=found.scale[:size],
    )


@compiled
def no_learned_contacts() -> LearnedContacts:
    """No contacts."""
    return LearnedContacts(
        a=np.empty(0, np.int64),
        b=np.empty(0, np.int64),
        normal=np.empty((0, 3)),
        slip=np.empty((0, 3)),
        roll=np.empty((0, 3)),
        spin=np.empty(0),
        features=np.empty((0, 2, FEATURES)),
        scale=np.empty(0),
    )


@in_place
def overlap_of(world: World, candidates: Candidates, k: int, positions: Array) -> float:
    """How deep the bodies of candidate k overlap; 0: they do not."""
    a, b, plane = candidates.a[k], candidates.b[k], candidates.plane[k]
    touching, place = world.radius[a], row(positions, a)
    if plane >= 0:
        return max(0.0, touching - length(offset_from_plane(world, plane, place)))
    return max(0.0, touching + world.radius[b] - length(minus(place, row(positions, b))))


@compiled
def changes_by_laws(
    world: World, before: Spheres, after: Spheres, dt: float
) -> tuple[Array, Array]:
    """Size of the laws' change of each velocity, shape (n,), and that beyond flight, (n, 3)."""
    count = len(before.positions)
    kicks, pushes = np.empty(count), np.empty((count, 3))
    for i in range(count):
        change = minus(row(after.velocities, i), row(before.velocities, i))
        pull = world.flight[i, 0], world.flight[i, 1], world.flight[i, 2]
        push = minus(change, times(dt, pull))
        put(pushes, i, push)
        kicks[i] = min(length(change), length(push))
    return kicks, pushes


@in_place
def _meet(before: Vector, after: Vector, velocity: Vector, touching: float, dt: float) -> _Meeting:
    """Meeting of two bodies on a straight relative path."""
    distance = length(before)
    gap, along, square = distance - touching, dot(before, velocity), dot(velocity, velocity)
    time, touches = 0.0, gap <= 0
    if gap > 0 and along < 0:
        time, root = dt, along * along - square * gap * (distance + touching)
        if root < 0:
            time = min(dt, -along / square)
        else:
            meets = gap * (distance + touching) / (math.sqrt(root) - along)
            if meets <= dt:
                time, touches = meets, True
    return _Meeting(before, after, time, touches, plus(before, times(time, velocity)))


@in_place
def _asinh(value: float) -> float:
    """As math.asinh, which takes three times as long; to 1e-16, but not where it is that small."""
    size = math.fabs(value)
    return math.copysign(math.log(size + math.sqrt(size * size + 1.0)), value)


@in_place
def _describe(
    world: World,
    before: Spheres,
    after: Spheres,
    dt: float,
    candidates: Candidates,
    k: int,
    pushes: Array,
    kick: float,
    c: int,
    found_out: LearnedContacts,
) -> bool:
    """Write candidate k as contact c; whether it is one that the network may change."""
    a, b, plane = candidates.a[k], candidates.b[k], candidates.plane[k]
    gravity, zero = world.gravity, (0.0, 0.0, 0.0)
    fixed = plane >= 0
    arm_b = 0.0 if fixed else world.radius[b]
    touching = world.radius[a] + arm_b
    radius = touching if fixed else 0.5 * touching
    v, v_after = row(before.velocities, a), row(after.velocities, a)
    w, w_after = row(before.angular_velocities, a), row(after.angular_velocities, a)
    v_b, w_b, v_b_after, w_b_after, push_b = zero, zero, zero, zero, zero
    if fixed:
        axes, local = world.axes[plane], offset_from_plane(world, plane, row(before.positions, a))
        offset = from_plane(axes, local)
        offset_after = from_plane(axes, offset_from_plane(world, plane, row(after.positions, a)))
        mean = plus(v, times(0.5 * dt, gravity))
        if is_over_face(local):  # the nearest point of a face moves along
            mean = minus(mean, across(mean, row(axes, 2)))
    else:
        offset = minus(row(before.positions, a), row(before.positions, b))
        offset_after = minus(row(after.positions, a), row(after.positions, b))
        v_b, v_b_after = row(before.velocities, b), row(after.velocities, b)
        w_b, w_b_after = row(before.angular_velocities, b), row(after.angular_velocities, b)
        push_b, mean = row(pushes, b), minus(v, v_b)
    meeting = _meet(offset, offset_after, mean, touching, dt)
    distance = length(meeting.offset)
    gap, gap_then = length(offset) - touching, distance - touching
    gap_after = length(offset_after) - touching
    if min(gap, gap_then, gap_after) > NEAR * radius or distance < 1e-9 * touching:
        return False
    overlap, inverse = max(0.0, -gap), world.inverse_mass[a] + world.inverse_mass[b]
    scale = (kick + 2.0 * overlap / dt - _REST) / inverse
    if not scale > 0:
        return False
    normal = times(1.0 / distance, meeting.offset)
    speed, speed_after = minus(v, v_b), minus(v_after, v_b_after)
    if fixed:
        speed = plus(speed, times(meeting.time, gravity))
    turns = plus(times(world.radius[a], w), times(arm_b, w_b))
    turns_after = plus(times(world.radius[a], w_after), times(arm_b, w_b_after))
    slip = across(minus(speed, cross(turns, normal)), normal)
    slip_after = across(minus(speed_after, cross(turns_after, normal)), normal)
    slips = length(slip)
    along = times(1.0 / math.sqrt(slips**2 + _SLIP**2), slip)
    relative = minus(w, w_b)
    spin, roll = dot(relative, normal), across(relative, normal)
    rolls = length(roll)
    found = found_out
    found.a[c], found.b[c], found.scale[c] = a, -1 if fixed else b, scale
    put(found.normal, c, normal)
    put(found.slip, c, along)
    put(found.roll, c, times(1.0 / math.sqrt(rolls**2 + _SPIN**2), roll))
    found.spin[c] = spin / math.sqrt(spin**2 + _SPIN**2)
    weight = length(gravity)
    up = times(-1.0 / weight, gravity) if weight > 0 else zero
    approach = dot(speed, normal)
    share = world.inverse_mass[b] / inverse
    for side in range(1 if fixed else 2):
        own, other, sign = row(pushes, a), push_b, 1.0
        if side == 1:
            own, other, sign, share = push_b, row(pushes, a), -1.0, 1.0 - share
        f = found.features[c, side]
        f[0] = _asinh(20.0 * gap / radius)
        f[1] = _asinh(20.0 * gap_after / radius)
        f[2] = _asinh(20.0 * gap_then / radius)
        f[3] = meeting.time / dt
        f[4] = 1.0 if meeting.touches else 0.0
        f[5] = _asinh(approach)
        f[6] = _asinh(dot(speed_after, normal))
        f[7] = _asinh(slips)
        f[8] = _asinh(dot(slip_after, along))
        f[9] = sign * dot(normal, up)
        f[10] = _asinh(sign * dot(own, normal))
        f[11] = _asinh(-sign * dot(other, normal))
        f[12] = _asinh(sign * dot(own, along))
        f[13] = _asinh(-sign * dot(other, along))
        f[14] = 1.0 if fixed else 0.0
        f[15] = share
        f[16] = _asinh(scale)
        f[17] = _asinh(dot(own, up))
        f[18] = _asinh(dot(other, up))
        f[19] = 20.0 * overlap / radius
        left = approach * (dt - meeting.time) if meeting.touches else 0.0
        f[20] = _asinh(20.0 * left / radius)
        f[21] = _asinh(rolls)
    return True
