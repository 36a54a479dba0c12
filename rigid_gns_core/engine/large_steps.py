# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The steps of an iteration of a large island, eight contacts at once; formulas as in `steps`."""

from __future__ import annotations

import math

from .blocks import (
    ALONG,
    ARM_A,
    ARM_B,
    Blocks,
    CHANGE,
    FREE,
    FREE_X,
    FRICTION,
    GROWTH,
    INERTIA,
    LEVER,
    MOMENTUM,
    NORMAL,
    NORMAL_0,
    NX,
    ORBIT,
    QX,
    ROLL,
    ROLL_SPLIT,
    RUB,
    SEPARATION,
    SPINNING,
    STEP,
    STRIDE,
    SX,
    TURN,
    TURNING,
    TX,
    TX_0,
    UNIT,
)
from .large_law import acts, put_vector, vector_at, whole_impulse
from ..kernels.jit import in_place
from ..kernels.lanes import (
    add_to_rows,
    choose,
    columns_of,
    Lanes,
    larger,
    load,
    Mask,
    same,
    smaller,
    store,
    WIDTH,
)
from ..kernels.vector import across, cross, dot, minus, plus, times
from ..scenes.state import Array

LaneVector = tuple[Lanes, Lanes, Lanes]
_TINY = 1e-300


@in_place
def push(
    rows_out: Array, blocks: Blocks, q: int, impulse: LaneVector, mass_a: Lanes, mass_b: Lanes,
    pairs: int,
) -> None:  # fmt: skip
    """Add impulses over masses to rows of bodies a, and take them from those of spheres b."""
    zero = same(0.0)
    x, y, z = times(mass_a, impulse)
    add_to_rows(rows_out, 0, blocks.a, q * WIDTH, (x, y, z, zero))
    if q < pairs:
        x, y, z = times(-mass_b, impulse)
        add_to_rows(rows_out, 0, blocks.b, q * WIDTH, (x, y, z, zero))


@in_place
def _turn(
    blocks_out: Blocks, q: int, torque: LaneVector, roll: LaneVector, turn_a: Lanes,
    turn_b: Lanes, pairs: int,
) -> None:  # fmt: skip
    """Take torques of friction, n x J, from the spins, and add those of rolling friction to a."""
    v, at, zero = blocks_out.values, q * STRIDE, same(0.0)
    x, y, z = times(turn_a, minus(roll, times(load(v, at + ARM_A), torque)))
    add_to_rows(blocks_out.new_motion, 4, blocks_out.a, q * WIDTH, (x, y, z, zero))
    if q < pairs:
        x, y, z = times(-load(v, at + ARM_B) * turn_b, torque)
        add_to_rows(blocks_out.new_motion, 4, blocks_out.b, q * WIDTH, (x, y, z, zero))


@in_place
def _slip(
    v: Array, at: int, moving: LaneVector, spin_a: LaneVector, spin_b: LaneVector
) -> LaneVector:
    """Tangential velocity of surface a on surface b, see `impulses.slip_velocity`."""
    normal = vector_at(v, at + NX)
    turning = plus(times(load(v, at + ARM_A), spin_a), times(load(v, at + ARM_B), spin_b))
    return minus(across(moving, normal), cross(turning, normal))


@in_place
def begin(blocks_out: Blocks, q: int, pairs: int) -> None:
    """Find the free motion of block q, and start from the impulses of the last substep."""
    blocks, v, at, place = blocks_out, blocks_out.values, q * STRIDE, q * WIDTH
    vax, vay, vaz, mass_a = columns_of(blocks.motion, 0, blocks.a, place)
    vbx, vby, vbz, mass_b = columns_of(blocks.motion, 0, blocks.b, place)
    wax, way, waz, turn_a = columns_of(blocks.motion, 4, blocks.a, place)
    wbx, wby, wbz, turn_b = columns_of(blocks.motion, 4, blocks.b, place)
    normal, moving = vector_at(v, at + NX), minus((vax, vay, vaz), (vbx, vby, vbz))
    store(v, at + FREE, dot(normal, moving) + load(v, at + TURNING))
    put_vector(v, at + FREE_X, _slip(v, at, moving, (wax, way, waz), (wbx, wby, wbz)))
    push(blocks.new_motion, blocks, q, whole_impulse(v, at), mass_a, mass_b, pairs)
    torque = cross(normal, vector_at(v, at + TX))
    _turn(blocks, q, torque, vector_at(v, at + QX), turn_a, turn_b, pairs)


@in_place
def press(blocks_out: Blocks, q: int, pairs: int) -> None:
    """Step normal impulses of block q: they push, and never pull."""
    v, at, place, zero = blocks_out.values, q * STRIDE, q * WIDTH, same(0.0)
    ax, ay, az, mass_a = columns_of(blocks_out.motion, 0, blocks_out.a, place)
    bx, by, bz, mass_b = columns_of(blocks_out.motion, 0, blocks_out.b, place)
    old, normal, moving = (
        load(v, at + NORMAL),
        vector_at(v, at + NX),
        minus((ax, ay, az), (bx, by, bz)),
    )
    residual = load(v, at + SEPARATION) - (dot(normal, moving) + load(v, at + TURNING))
    more = load(v, at + MOMENTUM) * (old - load(v, at + NORMAL_0)) + residual * load(v, at + STEP)
    new = choose(acts(v, at, old, residual), larger(old + more, zero), zero)
    step = new - old
    store(v, at + NORMAL_0, old)
    store(v, at + NORMAL, new)
    change = step * load(v, at + UNIT)
    store(v, at + CHANGE, change * change)
    push(blocks_out.new_motion, blocks_out, q, times(step, normal), mass_a, mass_b, pairs)


@in_place
def _clip(vector: LaneVector, most: Lanes) -> LaneVector:
    """Vectors, shortened where they are longer than `most`."""
    size = math.sqrt(dot(vector, vector))
    share = choose(size > most, most / larger(size, same(_TINY)), same(1.0))
    return times(share, vector)


@in_place
def rub(blocks_out: Blocks, q: int, pairs: int, curved: bool) -> None:
    """Step rolling friction of block q, and then friction, which sees what that changed."""
    blocks, v, at, place = blocks_out, blocks_out.values, q * STRIDE, q * WIDTH
    vax, vay, vaz, mass_a = columns_of(blocks.motion, 0, blocks.a, place)
    vbx, vby, vbz, mass_b = columns_of(blocks.motion, 0, blocks.b, place)
    wax, way, waz, turn_a = columns_of(blocks.motion, 4, blocks.a, place)
    wbx, wby, wbz, turn_b = columns_of(blocks.motion, 4, blocks.b, place)
    zero, normal, force = same(0.0), vector_at(v, at + NX), load(v, at + NORMAL)
    velocity, spin, spin_b = (vax, vay, vaz), (wax, way, waz), (wbx, wby, wbz)
    moving, rolled = minus(velocity, (vbx, vby, vbz)), (zero, zero, zero)
    old, most = vector_at(v, at + TX), load(v, at + FRICTION) * force
    mobility, rest = load(v, at + RUB), vector_at(v, at + SX)
    if blocks.rolls[q]:
        slip = minus(_slip(v, at, moving, spin, spin_b), rest)
        sticking = minus(old, times(mobility, slip))
        sticks = dot(sticking, sticking) <= most * most
        rolling = spin
        if q >= pairs:  # on a surface that may move
            velocity, rolling = moving, minus(spin, spin_b)
        rolled = _step_rolling(v, at, velocity, rolling, sticks, curved)
        spin = plus(spin, times(turn_a, rolled))
    slip = minus(_slip(v, at, moving, spin, spin_b), rest)
    repeated = times(load(v, at + MOMENTUM), minus(old, vector_at(v, at + TX_0)))
    new = _clip(plus(old, minus(repeated, times(mobility, slip))), most)
    step = minus(new, old)
    put_vector(v, at + TX_0, old)
    put_vector(v, at + TX, new)
    turned = load(v, at + UNIT) + load(v, at + TURN)
    change = dot(step, step) * turned * turned
    store(v, at + CHANGE, larger(change, load(v, at + CHANGE)))
    push(blocks.new_motion, blocks, q, step, mass_a, mass_b, pairs)
    _turn(blocks, q, cross(normal, step), rolled, turn_a, turn_b, pairs)


@in_place
def _step_rolling(
    v: Array, at: int, velocity: LaneVector, spin: LaneVector, sticks: Mask, curved: bool
) -> LaneVector:
    """Step the angular impulses of rolling friction, see `steps`; returns the step."""
    normal, old, force = vector_at(v, at + NX), vector_at(v, at + QX), load(v, at + NORMAL)
    resists = load(v, at + ROLL) > 0.0
    about = times(load(v, at + INERTIA), spin)
    orbit = times(choose(sticks, load(v, at + ORBIT), same(0.0)), cross(normal, velocity))
    target = times(load(v, at + ROLL_SPLIT), plus(about, orbit))
    new = minus(old, target)
    limit, most = load(v, at + ROLL) * force, load(v, at + SPINNING) * force
    if curved:
        growth = load(v, at + GROWTH) * force
        limit = (limit + growth * load(v, at + ALONG)) / (1.0 + growth * load(v, at + LEVER))
    about_normal = dot(new, normal)
    flat = _clip(minus(new, times(about_normal, normal)), limit)
    held = larger(smaller(about_normal, most), -most)
    new = plus(flat, times(held, normal))
    step = minus(new, old)
    step = (
        choose(resists, step[0], same(0.0)),
        choose(resists, step[1], same(0.0)),
        choose(resists, step[2], same(0.0)),
    )
    put_vector(v, at + QX, plus(old, step))
    return step
