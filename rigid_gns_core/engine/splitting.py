# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Into how many parts a body is split for its contacts, by moments of their normals.

A unit impulse at contact k changes the velocity at contact l of the same body by the block C_kl.
With n_k the normal into the body, c = n_k . n_l, l the arm, w the weight of a contact:

    normal:    C_kl = c / m,                          split_k = n_k . T n_k, T = sum of w n n^T
    friction: |C_kl| <= |c / m + l_k l_l / I|,        split_k = l_k S / I + n_k . N / m, over
                                                      1 / m + l_k^2 / I; S = sum of w l, N = of w n

The sum for friction is that of all |C_kl| over C_kk (Gershgorin): l_k l_l / I >= 1 / m for a ball,
so that no term is negative, and that bound is the larger one of `couplings`. That for normals is
of c^2, not of |c|: steps D^-1, D_kk = split_k / m, may pass the solution, but do not diverge,
since the largest eigenvalue of D^-1 A, that of the sum of w n n^T / (n . T n), stays below 2: at
most (1 + sqrt(3)) / 2 in a search over directions and weights. Contacts at right angles do not
damp each other, those in line halve each other.
"""

from __future__ import annotations

from .blocks import (
    ARM_A,
    ARM_B,
    Blocks,
    MOMENTUM,
    NX,
    ROLL,
    ROLL_SPLIT,
    RUB,
    STEP,
    STRENGTH,
    STRIDE,
)
from .large_law import vector_at
from ..kernels.jit import in_place
from ..kernels.lanes import (
    add_to_rows,
    choose,
    columns_of,
    gather,
    Lanes,
    larger,
    load,
    same,
    store,
    WIDTH,
)
from ..kernels.neighbours import Indices
from ..kernels.vector import dot

# largest momentum, the share of a step that the next one repeats: halves the iterations of piles
LARGEST_MOMENTUM = 0.5
# contacts with this share of the force of a body's strongest one count half
_FAINT = 0.01
_TINY = 1e-300


@in_place
def split_large(blocks_out: Blocks, pairs: int, count: int, bodies: int) -> None:
    """Split the bodies of an island anew.

    A contact of strength s counts 1.01 s / (s + 0.01 s_max) in a body whose strongest has s_max,
    so that contacts without force change nothing.

    Args:
        blocks_out: Steps and momentum are written.
        pairs: Number of blocks of two spheres, which are first.
        count: Of all blocks.
        bodies: How many there are.
    """
    blocks = blocks_out
    for m in range(bodies):
        i = blocks.own[m]
        blocks.strongest[i] = 1e-30
        store(blocks.moments, WIDTH * i, same(0.0))
        store(blocks.more_moments, WIDTH * i, same(0.0))
    for q in range(count):
        for lane in range(WIDTH):
            strength = blocks.values[q * STRIDE + STRENGTH + lane]
            a, b = blocks.a[q * WIDTH + lane], blocks.b[q * WIDTH + lane]
            blocks.strongest[a] = max(blocks.strongest[a], strength)
            blocks.strongest[b] = max(blocks.strongest[b], strength)
    for q in range(count):
        _weigh(blocks, q, blocks.a, 1.0, ARM_A)
        if q < pairs:
            _weigh(blocks, q, blocks.b, -1.0, ARM_B)
    for q in range(count):
        _split(blocks, q)


@in_place
def _weigh(blocks_out: Blocks, q: int, bodies: Indices, sign: float, arm: int) -> None:
    """Add the contacts of block q to the moments of their bodies a, or b."""
    blocks, v, at, place = blocks_out, blocks_out.values, q * STRIDE, q * WIDTH
    strength = load(v, at + STRENGTH)
    total = strength + _FAINT * gather(blocks.strongest, bodies, place)
    weight = (1.0 + _FAINT) * strength / total
    x, y, z = vector_at(v, at + NX)
    wx, wy, wz = weight * x, weight * y, weight * z
    rolling = choose(load(v, at + ROLL) > 0.0, weight, same(0.0))
    add_to_rows(blocks.moments, 0, bodies, place, (wx * x, wy * y, wz * z, rolling))
    add_to_rows(blocks.moments, 4, bodies, place, (wx * y, wy * z, wz * x, weight))
    way = sign * wx, sign * wy, sign * wz, weight * load(v, at + arm)
    add_to_rows(blocks.more_moments, 0, bodies, place, way)


@in_place
def _parts(
    blocks: Blocks, q: int, bodies: Indices, sign: float, arm: int
) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    """Parts of bodies a, or b, for normal impulses; over the mass; for friction; for rolling."""
    v, at, place = blocks.values, q * STRIDE, q * WIDTH
    x, y, z = vector_at(v, at + NX)
    xx, yy, zz, rolling = columns_of(blocks.moments, 0, bodies, place)
    xy, yz, zx, _ = columns_of(blocks.moments, 4, bodies, place)
    lx, ly, lz, arms = columns_of(blocks.more_moments, 0, bodies, place)
    inverse_mass, inverse_inertia = (
        columns_of(blocks.motion, 0, bodies, place)[3],
        columns_of(blocks.motion, 4, bodies, place)[3],
    )
    mixed = 2.0 * (xy * x * y + yz * y * z + zx * z * x)
    normal = larger(xx * x * x + yy * y * y + zz * z * z + mixed, same(1.0))
    own = load(v, at + arm)
    whole = sign * dot((lx, ly, lz), (x, y, z)) * inverse_mass + own * arms * inverse_inertia
    friction = larger(whole, inverse_mass + own * own * inverse_inertia)
    return normal, normal * inverse_mass, friction, larger(rolling, same(1.0))


@in_place
def _split(blocks_out: Blocks, q: int) -> None:
    """Set steps and momentum of block q; the latter is (1 - 1 / split) / 2."""
    v, at, one = blocks_out.values, q * STRIDE, same(1.0)
    normal_a, mass_a, friction_a, rolling = _parts(blocks_out, q, blocks_out.a, 1.0, ARM_A)
    normal_b, mass_b, friction_b, _ = _parts(blocks_out, q, blocks_out.b, -1.0, ARM_B)
    store(v, at + STEP, one / larger(mass_a + mass_b, same(_TINY)))
    store(v, at + RUB, one / larger(friction_a + friction_b, same(_TINY)))
    store(v, at + ROLL_SPLIT, one / rolling)
    store(v, at + MOMENTUM, LARGEST_MOMENTUM * (1.0 - one / larger(normal_a, normal_b)))
