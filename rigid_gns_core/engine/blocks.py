# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts of a large island in memory: blocks of eight, so that each step is one of lanes.

A block has one row of eight numbers for each field, and the indices of its bodies. Contacts of
two spheres come first, then those of spheres and planes, each in their order. What is left of a
block is filled with contacts of the fixed body and itself, which never touch.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contact_law import Law
from .contacts import Contacts
from .direct import MOST_CONTACTS
from .impact import TOUCH
from .impulses import Bodies, Impulses
from .restitution import curve_of
from .world import given_law, gravity_of, GRIP, SLOPE, SPIN, weight_of, World
from ..kernels.jit import compiled, in_place
from ..kernels.lanes import load, skip_lines, store, WIDTH
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import across, length, minus, row
from ..scenes.state import Array

# residuals below this [g h], and this [approach speed], press no bodies together
_LEAST, _ROUNDING = 1e-9, 1e-13

# Where the row of each field begins in a block. Given: normal; arms; what a unit of impulse adds
# to separation velocity and slip; what the turn of the normal adds to the former.
NX, NY, NZ, ARM_A, ARM_B, UNIT, TURN, TURNING = range(0, 8 * WIDTH, WIDTH)
# On the free paths: time, gap, approach speed and acceleration, as in `Impact`; whether a gap
# stays open; least residual that presses; fall across the normal of a plane.
TIME, GAP, SPEED, PULL, APART, SLOWEST, FALL_X, FALL_Y, FALL_Z = range(
    8 * WIDTH, 17 * WIDTH, WIDTH
)
# Law: restitution; friction; resistance to rolling and spinning [lengths]; inertia of body a, and
# its mass times arm.
SLOW, FRICTION, ROLL, SPINNING, INERTIA, ORBIT = range(17 * WIDTH, 23 * WIDTH, WIDTH)
# Only with contact laws: the rest of the curve of restitution; tangential restitution; what of the
# resistance to rolling grows with the speed, that of the centre along the surface, and half the
# arm over the inertia of rolling.
FAST, MIDDLE, REBOUND, GROWTH, ALONG, LEVER = range(23 * WIDTH, 29 * WIDTH, WIDTH)
# Impulses, and those before the last step.
NORMAL, TX, TY, TZ, QX, QY, QZ, NORMAL_0, TX_0, TY_0, TZ_0 = range(29 * WIDTH, 40 * WIDTH, WIDTH)
# Of the free motion: separation velocity, slip; and the coupling at the start.
FREE, FREE_X, FREE_Y, FREE_Z, START = range(40 * WIDTH, 45 * WIDTH, WIDTH)
# Where the contact alone ends, as in `Target`, but its impulse times impulse_time; its slip there.
# `HIT` is 0, too, where a gap stays open.
HIT, BOUNCED, SEPARATION, FLIGHT, IMPULSE, LEVERAGE, REMAINING, SX, SY, SZ = range(
    45 * WIDTH, 55 * WIDTH, WIDTH
)
# Of an iteration: coupling that lasts, strength of the force, steps by unit residual and by unit
# slip and rolling, momentum, and square of the change.
LASTING, STRENGTH, STEP, RUB, ROLL_SPLIT, MOMENTUM, CHANGE = range(55 * WIDTH, 62 * WIDTH, WIDTH)
STRIDE = 62 * WIDTH


class Blocks(NamedTuple):
    """Contacts in blocks, and their bodies; b bodies, c contacts.

    values: fields, block by block, shape (blocks * `STRIDE`,); a, b: bodies, shape
    (8 blocks,); place: where each contact is, shape (c,); rolls: blocks with rolling friction; on:
    those that still change, shape (blocks,). Rows of eight numbers for each body, shape
    (8 b,): motion, new_motion: velocity, inverse mass, spin, inverse inertia at the start of
    a pass, and at its end; moments, more_moments: of the normals of its contacts, see `splitting`.
    strongest: force of the strongest contact, shape (b,); own: bodies of the island; marked:
    scratch, shape (b,).
    """

    values: Array
    a: Indices
    b: Indices
    place: Indices
    rolls: Flags
    on: Flags
    motion: Array
    new_motion: Array
    moments: Array
    more_moments: Array
    strongest: Array
    own: Indices
    marked: Flags


@compiled
def new_blocks(bodies: int, contacts: int) -> Blocks:
    """Room for so many, to be written; none where all islands are small."""
    blocks, placed = 0, 0
    if contacts > MOST_CONTACTS:
        blocks, placed = contacts // WIDTH + 2, contacts
    else:
        bodies = 0
    indices, rows = np.empty((2, blocks * WIDTH), np.int64), np.empty(4 * WIDTH * bodies + 8)
    flags, values, size = (
        np.empty((2, blocks), np.bool_),
        np.empty(blocks * STRIDE + 8),
        8 * bodies,
    )
    rows = rows[skip_lines(rows) :]
    return Blocks(
        values=values[skip_lines(values) :],
        a=indices[0],
        b=indices[1],
        place=np.empty(placed, np.int64),
        rolls=flags[0],
        on=flags[1],
        motion=rows[:size],
        new_motion=rows[size : 2 * size],
        moments=rows[2 * size : 3 * size],
        more_moments=rows[3 * size : 4 * size],
        strongest=np.empty(bodies),
        own=np.empty(bodies, np.int64),
        marked=np.empty(bodies, np.bool_),
    )


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
    one, other = 0, first * WIDTH
    for k in range(size):
        if contacts.plane[k] < 0:
            blocks_out.place[k] = one
            one += 1
        else:
            blocks_out.place[k] = other
            other += 1
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
