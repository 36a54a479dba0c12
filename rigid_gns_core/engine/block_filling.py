# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writes the contacts of a large island into blocks, and what was found of them back."""

from __future__ import annotations

from .blocks import (
    ALONG,
    APART,
    ARM_A,
    ARM_B,
    Blocks,
    FALL_X,
    FALL_Y,
    FALL_Z,
    FAST,
    FRICTION,
    GAP,
    GROWTH,
    INERTIA,
    LEVER,
    MIDDLE,
    NORMAL,
    NORMAL_0,
    NX,
    NY,
    NZ,
    ORBIT,
    PULL,
    QX,
    QY,
    QZ,
    REBOUND,
    ROLL,
    SLOW,
    SLOWEST,
    SPEED,
    SPINNING,
    STRIDE,
    TIME,
    TURN,
    TURNING,
    TX,
    TX_0,
    TY,
    TY_0,
    TZ,
    TZ_0,
    UNIT,
)
from .contact_law import Law
from .contacts import Contacts
from .impact import TOUCH
from .impulses import Bodies, Impulses
from .restitution import curve_of
from .world import given_law, gravity_of, GRIP, SLOPE, SPIN, weight_of, World
from ..kernels.jit import in_place
from ..kernels.lanes import choose, gather, Lanes, larger, load, same, store, WIDTH
from ..kernels.vector import across, length, minus, row
from ..scenes.state import Array

# residuals below this [g h], and this [approach speed], press no bodies together
_LEAST, _ROUNDING = 1e-9, 1e-13


@in_place
def fill(
    world: World,
    contacts: Contacts,
    law: Law,
    start: Impulses,
    accelerations: Array,
    nominal_h: float,
    bodies: Bodies,
    blocks_out: Blocks,
) -> tuple[int, int, int]:
    """Write the contacts of an island into blocks; returns how many there are, and bodies.

    Args:
        world: What does not move.
        contacts: Those of the island.
        law: Their coefficients.
        start: Impulses of the last substep.
        accelerations: Of the spheres in flight, shape (n, 3).
        nominal_h: Length of a regular substep, for thresholds of speed.
        bodies: Their free motion.
        blocks_out: Written, but for what iterations find.

    Returns:
        Number of blocks of two spheres, of all blocks, and of bodies.
    """
    size, pairs = len(contacts.a), 0
    for k in range(size):
        pairs += contacts.plane[k] < 0
    first = (pairs + WIDTH - 1) // WIDTH
    count = first + (size - pairs + WIDTH - 1) // WIDTH
    for place in range(pairs, first * WIDTH):
        _fill_up(world, place, blocks_out)
    for place in range(first * WIDTH + size - pairs, count * WIDTH):
        _fill_up(world, place, blocks_out)
    for block in range(count):
        blocks_out.rolls[block] = False
    for k in range(size):  # those of two spheres are first
        blocks_out.place[k] = k if k < pairs else k - pairs + first * WIDTH
    lanes = 0 if world.has_laws else pairs // WIDTH
    for block in range(lanes):
        _fill_block(world, contacts, law, start, nominal_h, block, blocks_out)
    for k in range(lanes * WIDTH, size):
        _fill_in(
            world, contacts, law, start, accelerations, nominal_h, bodies, k, blocks_out.place[k],
            blocks_out,
        )  # fmt: skip
    return first, count, _fill_bodies(world, contacts, bodies, blocks_out)


@in_place
def _fill_up(world: World, place: int, blocks_out: Blocks) -> None:
    """Write a contact of the fixed body and itself."""
    at, values = place // WIDTH * STRIDE + place % WIDTH, blocks_out.values
    blocks_out.a[place] = blocks_out.b[place] = len(world.restitution)
    for field in range(0, STRIDE, WIDTH):
        values[at + field] = 0.0
    values[at + NZ] = values[at + UNIT] = values[at + GAP] = 1.0


@in_place
def _fill_in(
    world: World,
    contacts: Contacts,
    law: Law,
    start: Impulses,
    accelerations: Array,
    nominal_h: float,
    bodies: Bodies,
    k: int,
    place: int,
    blocks_out: Blocks,
) -> None:
    """Write contact k."""
    block, v = place // WIDTH, blocks_out.values
    at = block * STRIDE + place % WIDTH
    a, plane, normal = contacts.a[k], contacts.plane[k], row(contacts.normal, k)
    blocks_out.a[place], blocks_out.b[place] = a, contacts.b[k]
    v[at + NX], v[at + NY], v[at + NZ] = normal
    v[at + ARM_A], v[at + ARM_B] = law.arm_a[k], law.arm_b[k]
    v[at + UNIT] = law.inverse_effective_mass[k]
    v[at + TURN] = law.rotation_a[k] + law.rotation_b[k]
    v[at + TURNING], v[at + TIME] = contacts.turning_speed[k], contacts.time[k]
    v[at + GAP], v[at + SPEED] = contacts.speculative_gap[k], contacts.approach_speed[k]
    v[at + PULL] = contacts.acceleration[k]
    gap = contacts.rest_gap[k] + contacts.speculative_gap[k]
    v[at + APART] = 1.0 if gap > TOUCH * world.radius[a] else 0.0
    slowest = _LEAST * weight_of(world) * nominal_h
    v[at + SLOWEST] = slowest + _ROUNDING * abs(contacts.approach_speed[k])
    fall = (0.0, 0.0, 0.0)  # of two spheres, which fall alike
    if plane >= 0:
        pull = row(accelerations, a) if world.in_air else gravity_of(world)
        fall = across(pull, normal)
    v[at + FALL_X], v[at + FALL_Y], v[at + FALL_Z] = fall
    v[at + SLOW], v[at + FRICTION] = law.restitution[k], law.friction[k]
    v[at + ROLL] = v[at + SPINNING] = law.rolling[k]
    v[at + INERTIA] = 1.0 / world.inverse_inertia[a]
    v[at + ORBIT] = law.arm_a[k] / world.inverse_mass[a]
    v[at + GROWTH], v[at + FAST], v[at + REBOUND] = 0.0, law.restitution[k], 0.0
    blocks_out.rolls[block] |= law.rolling[k] > 0
    given = given_law(world, plane)
    if world.has_laws:
        v[at + MIDDLE], v[at + ALONG], v[at + LEVER] = 1.0, 0.0, 0.0
    if given >= 0:
        v[at + SLOW], v[at + FAST], v[at + MIDDLE] = curve_of(world, given)
        v[at + REBOUND] = world.laws[given, GRIP]
        v[at + SPINNING] = world.laws[given, SPIN] * world.radius[a]
        v[at + GROWTH] = world.laws[given, SLOPE] * world.radius[a]
        velocity = row(bodies.free_velocity, a)
        if plane >= 0:
            velocity = minus(velocity, row(bodies.free_velocity, contacts.b[k]))
        v[at + ALONG] = length(across(velocity, normal))
        arm = law.arm_a[k]
        inertia = 1.0 / world.inverse_inertia[a] + arm * arm / world.inverse_mass[a]
        v[at + LEVER] = 0.5 * arm / inertia
    tangential = across(row(start.tangential, k), normal)  # the normal has turned since then
    v[at + NORMAL], (v[at + TX], v[at + TY], v[at + TZ]) = start.normal[k], tangential
    v[at + NORMAL_0], (v[at + TX_0], v[at + TY_0], v[at + TZ_0]) = start.normal[k], tangential
    v[at + QX], v[at + QY], v[at + QZ] = row(start.rolling, k)


@in_place
def _fill_block(
    world: World,
    contacts: Contacts,
    law: Law,
    start: Impulses,
    nominal_h: float,
    block: int,
    blocks_out: Blocks,
) -> None:
    """Write eight contacts of two spheres without contact laws at once, as `_fill_in` would."""
    v, at, k, zero = blocks_out.values, block * STRIDE, block * WIDTH, same(0.0)
    for lane in range(WIDTH):
        blocks_out.a[k + lane], blocks_out.b[k + lane] = contacts.a[k + lane], contacts.b[k + lane]
        for axis in range(3):
            field = at + axis * WIDTH + lane
            v[field + NX] = contacts.normal[k + lane, axis]
            v[field + TX] = start.tangential[k + lane, axis]
            v[field + QX] = start.rolling[k + lane, axis]
    arm, speed = load(law.arm_a, k), load(contacts.approach_speed, k)
    store(v, at + ARM_A, arm)
    store(v, at + ARM_B, load(law.arm_b, k))
    store(v, at + UNIT, load(law.inverse_effective_mass, k))
    store(v, at + TURN, load(law.rotation_a, k) + load(law.rotation_b, k))
    store(v, at + TURNING, load(contacts.turning_speed, k))
    store(v, at + TIME, load(contacts.time, k))
    speculative = load(contacts.speculative_gap, k)
    store(v, at + GAP, speculative)
    store(v, at + SPEED, speed)
    store(v, at + PULL, load(contacts.acceleration, k))
    apart = load(contacts.rest_gap, k) + speculative > TOUCH * gather(world.radius, contacts.a, k)
    store(v, at + APART, choose(apart, same(1.0), zero))
    slowest = _LEAST * weight_of(world) * nominal_h
    store(v, at + SLOWEST, slowest + _ROUNDING * larger(speed, -speed))
    restitution, rolling = load(law.restitution, k), load(law.rolling, k)
    store(v, at + SLOW, restitution)
    store(v, at + FAST, restitution)
    store(v, at + FRICTION, load(law.friction, k))
    store(v, at + ROLL, rolling)
    store(v, at + SPINNING, rolling)
    store(v, at + INERTIA, 1.0 / gather(world.inverse_inertia, contacts.a, k))
    store(v, at + ORBIT, arm / gather(world.inverse_mass, contacts.a, k))
    normal, force = _vector_at(v, at + NX), load(start.normal, k)
    tangential = across(_vector_at(v, at + TX), normal)  # the normal has turned since then
    store(v, at + NORMAL, force)
    store(v, at + NORMAL_0, force)
    for axis in range(3):
        store(v, at + FALL_X + axis * WIDTH, zero)  # both fall alike
        store(v, at + TX + axis * WIDTH, tangential[axis])
        store(v, at + TX_0 + axis * WIDTH, tangential[axis])
    store(v, at + GROWTH, zero)
    store(v, at + REBOUND, zero)


@in_place
def _vector_at(values: Array, x: int) -> tuple[Lanes, Lanes, Lanes]:
    return load(values, x), load(values, x + WIDTH), load(values, x + 2 * WIDTH)


@in_place
def _fill_bodies(world: World, contacts: Contacts, bodies: Bodies, blocks_out: Blocks) -> int:
    """Write the free motion of the bodies of an island; returns how many there are."""
    count, marked, fixed = 0, blocks_out.marked, len(world.restitution)
    marked[fixed] = False
    for k in range(len(contacts.a)):
        marked[contacts.a[k]] = marked[contacts.b[k]] = False
    for k in range(-1, len(contacts.a)):
        for side in range(2):
            i = fixed
            if k >= 0:
                i = contacts.a[k] if side == 0 else contacts.b[k]
            if marked[i]:
                continue
            marked[i] = True
            blocks_out.own[count] = i
            count += 1
            at, v = WIDTH * i, blocks_out.motion
            for axis in range(3):
                v[at + axis] = bodies.free_velocity[i, axis]
                v[at + 4 + axis] = bodies.free_angular_velocity[i, axis]
            v[at + 3], v[at + 7] = world.inverse_mass[i], world.inverse_inertia[i]
            store(blocks_out.new_motion, at, load(v, at))
    return count


@in_place
def take(blocks: Blocks, bodies: int, bodies_out: Bodies, impulses_out: Impulses) -> None:
    """Write impulses and motion of an island back; displacements are in `moments`."""
    for k in range(len(impulses_out.normal)):
        place, v = blocks.place[k], blocks.values
        at = place // WIDTH * STRIDE + place % WIDTH
        impulses_out.normal[k] = v[at + NORMAL]
        for axis in range(3):
            impulses_out.tangential[k, axis] = v[at + TX + axis * WIDTH]
            impulses_out.rolling[k, axis] = v[at + QX + axis * WIDTH]
    for m in range(bodies):
        i = blocks.own[m]
        for axis in range(3):
            bodies_out.velocity[i, axis] = blocks.motion[WIDTH * i + axis]
            bodies_out.angular_velocity[i, axis] = blocks.motion[WIDTH * i + 4 + axis]
            bodies_out.displacement[i, axis] = blocks.moments[WIDTH * i + axis]
