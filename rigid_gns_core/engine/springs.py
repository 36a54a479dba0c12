# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blows of a frame as springs make them: they take time, and contacts that overlap share them.

What training found of a lab's contacts (`training/residual/springs.py`): a spring and a dashpot
along the normal, and across it a spring that slides. With o the overlap, u the velocity of a at
the contact point over b, m the effective mass, and k, zeta and mu of the pair,

    N = m max(0, k o - 2 zeta sqrt(k) u . n),   zeta = -log e / sqrt(pi^2 + log^2 e),
    T = -q m (k s + 2 zeta sqrt(k) u_t),   |T| <= mu N,   ds/dt = u_t where it does not slide,

the law of Cundall and Strack (1979), in steps of velocity Verlet. e and mu are those of the
materials times factors. It replaces the laws where something was struck: in islands that the laws
or the springs connect, in which a sphere was kicked or is in the middle of a blow. What rests, and
what springs cannot express (deep overlaps, edges, paths longer than was looked for), is left to
the laws, an island as a whole, so that momenta stay.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .broad_phase import Candidates, linked_to, PAD
from .flight import reach_of
from .islands import connect, groups_of, Islands
from .rectangle import from_plane, is_over_face
from .shielding import offset_from_plane
from .spheres import copy_spheres, Spheres
from .world import given_law, SLIDE, SLOW, weight_of, World
from ..kernels.flight import acceleration, flight_at
from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.quaternions import turn
from ..kernels.vector import (
    across,
    add_to,
    cross,
    dot,
    length,
    minus,
    plus,
    put,
    row,
    times,
    Vector,
)
from ..scenes.state import Array

Single = NDArray[np.float32]

SPRINGS = 4
"""Numbers of the springs: k [1/s^2], factors of restitution and friction, and q."""

SPARE = 0.6
"""How much farther than it would fly a sphere may be struck [radii]."""

# sqrt(k) h: a blow begins anywhere in a step, which is up to 5 % of its speed
_ANGLE = 0.4
# farthest that a sphere moves in a step, and deepest overlap [radii]
_FAR, _DEEP = 0.1, 0.2
# least restitution of a dashpot, and change of velocity [m/s] up to which a sphere is at rest
_LEAST, REST = 0.01, 0.02
# overlaps [those of the weight] beyond which a start is in the middle of a blow
_LOADED = 3.0


class _Pairs(NamedTuple):
    """Candidates of the springs: stiffness m k, dashpot, mu, and stretch; shapes (c,), (c, 3)."""

    stiffness: Array
    damping: Array
    friction: Array
    stretch: Array
    touched: Flags


class _Touch(NamedTuple):
    """Overlap of two bodies, normal towards a, and arms to the contact point; is_edge: no face."""

    overlap: float
    normal: Vector
    arm_a: float
    arm_b: float
    is_edge: bool


@compiled
def follow_springs(
    world: World,
    springs: Single,
    near: Candidates,
    before: Spheres,
    kicks: Array,
    dt: float,
    asleep: Flags,
    after_out: Spheres,
    islands_out: Islands,
) -> None:
    """Replace what the laws made of blows.

    Args:
        world: What does not move.
        springs: k, factors of restitution and friction, and q; shape (SPRINGS,).
        near: Candidates of the frame, looked for `SPARE` farther out.
        before: State at the start of the frame.
        kicks: How much the laws changed velocities, 0 in flight, shape (n,).
        dt: Length of the frame.
        asleep: Spheres that sleep after it, fixed here; shape (n,).
        after_out: State that the laws lead to; that of islands with blows is replaced.
        islands_out: Contacts are added.
    """
    count, stiffness = len(asleep), float(springs[0])
    is_struck = _struck(world, near, before.positions, kicks, stiffness)
    if not is_struck.any():
        return
    candidates, reached = linked_to(near, is_struck, asleep)  # what a blow may lead to
    members: Indices = np.flatnonzero(reached)
    inverse = world.inverse_mass.copy()
    for i in range(count):
        if asleep[i]:
            inverse[i] = 0.0
    made, is_lost = copy_spheres(before), np.zeros(count + 1, np.bool_)
    angles = np.zeros((count, 3))
    steps = max(1, math.ceil(math.sqrt(stiffness) * dt / _ANGLE))
    h, force, torque = dt / steps, np.zeros((count + 1, 3)), np.zeros((count + 1, 3))
    pairs = _pairs_of(world, candidates, springs, inverse, h)
    pull = np.empty((count, 3))
    for i in members:
        put(pull, i, (world.flight[i, 0], world.flight[i, 1], world.flight[i, 2]))
        if world.in_air:
            v, w = row(before.velocities, i), row(before.angular_velocities, i)
            put(pull, i, acceleration(v, w, flight_at(world.flight, i)))
    for step in range(steps + 1):
        for c in range(len(candidates.a)):
            _press(world, candidates, pairs, c, float(springs[3]), h, made, force, torque, is_lost)
        half = 0.5 if step in (0, steps) else 1.0
        drift = h if step < steps else 0.0
        _move(world, members, pull, force, torque, half * h, drift, made, angles, is_lost)
    for i in members:
        turn(made.quaternions, i, row(angles, i), 1.0)
    _mark_lost(world, members, before, made, dt, is_lost)
    for c in range(len(candidates.a)):
        a, b = candidates.a[c], candidates.b[c]
        if pairs.touched[c]:
            if b == count or asleep[b]:
                connect(islands_out, a, -1)
            elif asleep[a]:
                connect(islands_out, b, -1)
            else:
                connect(islands_out, a, b)
    _take(is_struck, is_lost, made, after_out, islands_out)


@compiled
def _struck(
    world: World, candidates: Candidates, positions: Array, kicks: Array, stiffness: float
) -> Flags:
    """Spheres that the laws kicked, or that are in the middle of a blow; shape (n,)."""
    found = kicks > REST
    least = (_LOADED * weight_of(world) + REST * math.sqrt(stiffness)) / stiffness
    for c in range(len(candidates.a)):
        touch = _touch(world, candidates, c, positions)
        if touch.overlap > least:
            found[candidates.a[c]] = True
    return found


@compiled
def _pairs_of(
    world: World, candidates: Candidates, springs: Single, inverse: Array, h: float
) -> _Pairs:
    size, stiffness = len(candidates.a), float(springs[0])
    pairs = _Pairs(
        stiffness=np.zeros(size),
        damping=np.zeros(size),
        friction=np.zeros(size),
        stretch=np.zeros((size, 3)),
        touched=np.zeros(size, np.bool_),
    )
    for c in range(size):
        a, b, plane = candidates.a[c], candidates.b[c], candidates.plane[c]
        given = given_law(world, plane)
        restitution, friction = world.restitution[a], world.friction[a]
        if given >= 0:
            restitution, friction = world.laws[given, SLOW], world.laws[given, SLIDE]
        elif plane >= 0:
            restitution *= world.laws[plane, SLOW]
            friction *= world.laws[plane, SLIDE]
        else:
            restitution *= world.restitution[b]
            friction *= world.friction[b]
        log = math.log(min(1.0, max(_LEAST, float(springs[1]) * restitution)))
        share = -log / math.sqrt(math.pi**2 + log**2)
        # velocities are known half a step before; the push of this half belongs to the dashpot
        rate = math.sqrt(stiffness)
        mass = 1.0 / (inverse[a] + inverse[b]) / (1.0 + share * rate * h)
        pairs.stiffness[c] = mass * stiffness
        pairs.damping[c] = 2.0 * share * mass * rate
        pairs.friction[c] = float(springs[2]) * friction
    return pairs


@in_place
def _is_apart(world: World, candidates: Candidates, c: int, positions: Array) -> bool:
    """Whether bodies do not touch, where few operations tell; most candidates never touch."""
    a, b, plane = candidates.a[c], candidates.b[c], candidates.plane[c]
    if plane >= 0:
        offset = minus(row(positions, a), row(world.point, plane))
        return dot(row(world.axes[plane], 2), offset) >= world.radius[a]
    offset, reach = minus(row(positions, a), row(positions, b)), world.radius[a] + world.radius[b]
    return dot(offset, offset) >= reach * reach


@in_place
def _touch(world: World, candidates: Candidates, c: int, positions: Array) -> _Touch:
    a, b, plane = candidates.a[c], candidates.b[c], candidates.plane[c]
    radius_a, radius_b = world.radius[a], world.radius[b]
    if plane < 0:
        offset = minus(row(positions, a), row(positions, b))
        distance = length(offset)
        overlap = radius_a + radius_b - distance
        normal = times(1.0 / max(distance, 1e-300), offset)
        half = 0.5 * overlap
        return _Touch(overlap, normal, radius_a - half, radius_b - half, False)
    local = offset_from_plane(world, plane, row(positions, a))
    distance = length(local)
    overlap = radius_a - distance
    if local[2] < 0 and not world.two_sided[plane]:
        overlap = radius_a + distance  # behind a half-space
    normal = from_plane(world.axes[plane], times(1.0 / max(distance, 1e-300), local))
    return _Touch(overlap, normal, radius_a - overlap, 0.0, not is_over_face(local))


@in_place
def _press(
    world: World,
    candidates: Candidates,
    pairs_out: _Pairs,
    c: int,
    ratio: float,
    h: float,
    made: Spheres,
    force_out: Array,
    torque_out: Array,
    lost_out: Flags,
) -> None:
    """Add force and torque of candidate c; its spheres are lost where springs do not hold."""
    pairs, a, b = pairs_out, candidates.a[c], candidates.b[c]
    if _is_apart(world, candidates, c, made.positions):
        put(pairs.stretch, c, (0.0, 0.0, 0.0))
        return
    touch = _touch(world, candidates, c, made.positions)
    if touch.overlap <= 0:
        put(pairs.stretch, c, (0.0, 0.0, 0.0))
        return
    pairs.touched[c] = True
    n, fixed = touch.normal, candidates.plane[c] >= 0
    radius = world.radius[a] if fixed else min(world.radius[a], world.radius[b])
    if touch.is_edge or touch.overlap > _DEEP * radius:
        lost_out[a] = True
        return
    speed = row(made.velocities, a)
    turns = times(touch.arm_a, row(made.angular_velocities, a))
    if not fixed:
        speed = minus(speed, row(made.velocities, b))
        turns = plus(turns, times(touch.arm_b, row(made.angular_velocities, b)))
    speed = minus(speed, cross(turns, n))
    k, damping = pairs.stiffness[c], pairs.damping[c]
    push = max(0.0, k * touch.overlap - damping * dot(speed, n))
    slip = across(speed, n)
    stretch = across(plus(row(pairs.stretch, c), times(h, slip)), n)
    grip = minus(times(-ratio * k, stretch), times(ratio * damping, slip))
    size, most = length(grip), pairs.friction[c] * push
    if size > most:
        grip = times(most / size, grip)
        stretch = times(-1.0 / (ratio * k), plus(grip, times(ratio * damping, slip)))
    put(pairs.stretch, c, stretch)
    total, twist = plus(times(push, n), grip), cross(grip, n)
    add_to(force_out, a, total)
    add_to(torque_out, a, times(touch.arm_a, twist))
    if not fixed:
        add_to(force_out, b, times(-1.0, total))
        add_to(torque_out, b, times(touch.arm_b, twist))


@in_place
def _move(
    world: World,
    members: Indices,
    pull: Array,
    force_out: Array,
    torque_out: Array,
    kick: float,
    drift: float,
    made_out: Spheres,
    angles_out: Array,
    lost_out: Flags,
) -> None:
    """Velocities by forces in the time `kick`, then positions in `drift`; forces are 0 then."""
    for i in members:
        change = plus(row(pull, i), times(world.inverse_mass[i], row(force_out, i)))
        add_to(made_out.velocities, i, times(kick, change))
        change = times(kick * world.inverse_inertia[i], row(torque_out, i))
        add_to(made_out.angular_velocities, i, change)
        way = times(drift, row(made_out.velocities, i))
        add_to(made_out.positions, i, way)
        add_to(angles_out, i, times(drift, row(made_out.angular_velocities, i)))
        if not length(way) <= _FAR * world.radius[i]:
            lost_out[i] = True
        put(force_out, i, (0.0, 0.0, 0.0))
        put(torque_out, i, (0.0, 0.0, 0.0))


@in_place
def _mark_lost(
    world: World, members: Indices, before: Spheres, made: Spheres, dt: float, lost_out: Flags
) -> None:
    """Mark spheres that left the room in which their contacts were looked for."""
    weight = weight_of(world)
    for i in members:
        reach = reach_of(length(row(before.velocities, i)), weight, dt)
        reach += (PAD + SPARE) * world.radius[i]
        gone = length(minus(row(made.positions, i), row(before.positions, i)))
        lost_out[i] |= not gone <= reach


@compiled
def _take(
    is_struck: Flags, is_lost: Flags, made: Spheres, after_out: Spheres, islands: Islands
) -> None:
    """Take what the springs made of islands in which something was struck and nothing is lost."""
    groups = groups_of(islands)
    for island in range(len(groups.grounded)):
        members = groups.members[groups.start[island] : groups.start[island + 1]]
        if is_struck[members].any() and not is_lost[members].any():
            for i in members:
                put(after_out.positions, i, row(made.positions, i))
                put(after_out.velocities, i, row(made.velocities, i))
                put(after_out.angular_velocities, i, row(made.angular_velocities, i))
                for k in range(4):
                    after_out.quaternions[i, k] = made.quaternions[i, k]
