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

from .direct import MOST_CONTACTS
from ..kernels.jit import compiled
from ..kernels.lanes import skip_lines, WIDTH
from ..kernels.neighbours import Flags, Indices
from ..scenes.state import Array

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
