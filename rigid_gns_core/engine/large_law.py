# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the contacts of a large island end by their law, eight at once.

The law is that of `contact_law.target_of`, in the same formulas. Flights that it follows one by
one, or counts by logarithms, are few: such a contact is left to that function.
"""

from __future__ import annotations

import math

from .blocks import (
    APART,
    Blocks,
    BOUNCED,
    FALL_X,
    FAST,
    FLIGHT,
    FREE,
    FREE_X,
    GAP,
    HIT,
    IMPULSE,
    LASTING,
    LEVERAGE,
    MIDDLE,
    NORMAL,
    NX,
    PULL,
    REBOUND,
    REMAINING,
    SEPARATION,
    SLOW,
    SLOWEST,
    SPEED,
    START,
    STRENGTH,
    STRIDE,
    SX,
    TIME,
    TURNING,
    TX,
    UNIT,
)
from .contact_law import NO_BOUNCE, ROUNDING, target_of
from .world import THRESHOLD_TIME
from ..kernels.jit import in_place
from ..kernels.lanes import (
    bits,
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
from ..kernels.vector import dot, minus, plus, times
from ..scenes.state import Array


@in_place
def vector_at(values: Array, x: int) -> tuple[Lanes, Lanes, Lanes]:
    """Eight vectors, whose fields follow each other."""
    return load(values, x), load(values, x + WIDTH), load(values, x + 2 * WIDTH)


@in_place
def put_vector(values: Array, x: int, vector: tuple[Lanes, Lanes, Lanes]) -> None:
    """Write eight vectors."""
    store(values, x, vector[0])
    store(values, x + WIDTH, vector[1])
    store(values, x + 2 * WIDTH, vector[2])


@in_place
def separation_of(blocks: Blocks, q: int) -> Lanes:
    """Rate at which the gaps of block q open, see `impulses.separation_velocity`."""
    v, at = blocks.values, q * STRIDE
    ax, ay, az, _ = columns_of(blocks.motion, 0, blocks.a, q * WIDTH)
    bx, by, bz, _ = columns_of(blocks.motion, 0, blocks.b, q * WIDTH)
    moving = minus((ax, ay, az), (bx, by, bz))
    return dot(vector_at(v, at + NX), moving) + load(v, at + TURNING)


@in_place
def find_start_coupling(blocks: Blocks, q: int) -> None:
    """Find the coupling by the impulses of the start, of block q."""
    v, at = blocks.values, q * STRIDE
    own = load(v, at + NORMAL) * load(v, at + UNIT)
    store(v, at + START, separation_of(blocks, q) - load(v, at + FREE) - own)


@in_place
def find_targets_of(blocks: Blocks, q: int, h: float, curved: bool) -> None:
    """Find where the contacts of block q alone end, their slip there, and their strength.

    Args:
        blocks: Written.
        q: Which.
        h: Length of the substep.
        curved: Whether there are contact laws.
    """
    v, at, zero = blocks.values, q * STRIDE, same(0.0)
    separation, normal, unit = separation_of(blocks, q), load(v, at + NORMAL), load(v, at + UNIT)
    lasting = zero
    if h > 0:
        # what acted at the start too is a force that lasts through the substep, the rest a blow
        coupling = separation - load(v, at + FREE) - normal * unit
        start = load(v, at + START)
        least = choose(coupling > 0.0, smaller(start, coupling), larger(start, coupling))
        lasting = choose(start * coupling > 0.0, least, zero) * (1.0 / h)
    store(v, at + LASTING, lasting)
    _find_targets(v, at, h, lasting, curved)
    flight = load(v, at + FLIGHT)
    fall = vector_at(v, at + FALL_X)
    slip = times(flight, fall)
    if curved:
        blow = minus(vector_at(v, at + FREE_X), times(load(v, at + REMAINING), fall))
        share = load(v, at + BOUNCED) * load(v, at + REBOUND)
        slip = minus(slip, times(share, blow))
    put_vector(v, at + SX, slip)
    if h > 0:  # a gap that stays open takes a force that presses the bodies together
        open_still = (lasting >= 0.0) & (load(v, at + APART) > 0.0)
        store(v, at + HIT, choose(open_still, zero, load(v, at + HIT)))
    residual = load(v, at + SEPARATION) - separation
    strength = normal * unit + larger(residual, -residual)
    store(v, at + STRENGTH, choose(acts(v, at, normal, residual), strength, zero))


@in_place
def acts(v: Array, at: int, normal: Lanes, residual: Lanes) -> Mask:
    """Which contacts of a block carry force, or are to."""
    presses = (normal > 0.0) | (residual > load(v, at + SLOWEST))
    return (load(v, at + HIT) > 0.0) & presses


@in_place
def _find_targets(v: Array, at: int, h: float, lasting: Lanes, curved: bool) -> None:
    """Write where each contact alone ends, see `target_of`."""
    zero, time, e = same(0.0), load(v, at + TIME), load(v, at + SLOW)
    pull = load(v, at + PULL) + lasting
    fall, before = -pull, larger(time, zero)
    gap = load(v, at + GAP) + 0.5 * lasting * before * before
    closing = load(v, at + SPEED) - lasting * before
    square = closing * closing + 2.0 * fall * gap
    root, falls = math.sqrt(larger(square, zero)), fall > 0.0
    down = larger(fall, zero)
    touches = (before <= 0.0) & (gap <= 0.0) & (gap >= 0.0)
    rests = touches & (closing >= -THRESHOLD_TIME * down - ROUNDING)
    nears = closing > 0.0
    way = choose(nears, 2.0 * gap, root - closing)
    meets = (nears | falls) & (square >= 0.0)
    later = way / choose(nears, closing + root, choose(falls, fall, same(1.0)))
    meets = meets & (before + later <= h)
    later = choose(meets & ~rests, larger(later, -before), zero)
    leaves = touches & ~(rests | meets)
    held = rests | leaves
    closing = closing - pull * later
    closing = choose(held, closing, larger(closing, zero))
    remaining = larger(h - before - later, zero)
    late = (before - time) * closing
    fallen = closing * remaining + 0.5 * fall * remaining * remaining
    speed = choose(leaves, -closing, e * closing)
    flies = leaves | (fall <= 0.0)
    bounces = (closing > THRESHOLD_TIME * fall) & (e > NO_BOUNCE) & ~flies
    longest, lost = 2.0 * speed, remaining * fall  # flights end within the substep?
    bounced = flies | (bounces & (lost < longest))
    flight = choose(bounced, remaining, zero)
    separation = choose(bounced, speed - fall * flight, zero)
    height = choose(bounced, speed * flight - 0.5 * fall * flight * flight, zero)
    late = choose(bounced, late * (1.0 + e), late)
    impulse = separation + closing + fall * remaining
    store(v, at + HIT, choose(touches | meets, same(1.0), zero))
    store(v, at + BOUNCED, choose(bounced & ~leaves, same(1.0), zero))
    store(v, at + SEPARATION, choose(leaves, smaller(separation, zero), separation))
    store(v, at + FLIGHT, flight)
    store(v, at + IMPULSE, impulse)
    store(v, at + LEVERAGE, height + fallen + late)
    store(v, at + REMAINING, remaining)
    several: Mask = bounces & (lost >= longest) & (lost * (1.0 - e) < longest)
    if curved:
        fast = load(v, at + FAST)
        several = several | (fast < e) | (fast > e)
    left = bits(several)
    lane = 0
    while left > 0:
        if left & 1:
            _find_target(v, at + lane, h, curved)
        left >>= 1
        lane += 1


@in_place
def _find_target(v: Array, at: int, h: float, curved: bool) -> None:
    """Write where one contact alone ends."""
    middle = v[at + MIDDLE] if curved else 1.0
    target = target_of(
        slow=v[at + SLOW],
        fast=v[at + FAST],
        middle=middle,
        h=h,
        time=v[at + TIME],
        gap=v[at + GAP],
        approach_speed=v[at + SPEED],
        acceleration=v[at + PULL],
        coupling=v[at + LASTING],
    )
    v[at + HIT] = 1.0 if target.active else 0.0
    v[at + BOUNCED] = 1.0 if target.bounced else 0.0
    v[at + SEPARATION], v[at + FLIGHT] = target.separation_velocity, target.flight_time
    v[at + IMPULSE] = target.impulse
    v[at + LEVERAGE] = target.impulse_time * max(target.impulse, 1e-9)
    v[at + REMAINING] = target.remaining


@in_place
def displace(blocks: Blocks, q: int) -> tuple[Lanes, Lanes, Lanes]:
    """Products of impulse and time of the contacts of block q, see `displace_by_blows`."""
    v, at = blocks.values, q * STRIDE
    normal, remaining = load(v, at + NORMAL), load(v, at + REMAINING)
    alone = load(v, at + IMPULSE)
    share = smaller(normal, alone / load(v, at + UNIT)) / larger(normal, same(1e-30))
    time = share * (load(v, at + LEVERAGE) / larger(alone, same(1e-9)))
    time = time + (1.0 - share) * 0.5 * remaining
    return times(time, whole_impulse(v, at))


@in_place
def whole_impulse(v: Array, at: int) -> tuple[Lanes, Lanes, Lanes]:
    """Normal and friction impulse of the contacts of a block."""
    from_normal = times(load(v, at + NORMAL), vector_at(v, at + NX))
    return plus(from_normal, vector_at(v, at + TX))
