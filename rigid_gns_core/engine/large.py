# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Impulses of a large island, iteratively, with blocks of eight contacts as lanes.

All contacts step at once: they see the velocities at the start of a pass, and write those at its
end. After a blow, only blocks around bodies that still change are iterated further.
"""

from __future__ import annotations

import math

from .block_filling import fill, take
from .blocks import Blocks, CHANGE, NORMAL, NORMAL_0, STRIDE, TX, TX_0
from .contact_law import Law
from .contacts import Contacts
from .impulses import Bodies, Impulses
from .large_law import displace, find_start_coupling, find_targets_of, put_vector, vector_at
from .large_steps import begin, press, push, rub
from .splitting import split_large
from .world import UNIT_GRAVITY, World
from ..kernels.jit import in_place
from ..kernels.lanes import columns_of, load, same, store, WIDTH
from ..scenes.state import Array

# islands whose last iteration changed a contact by more than this [g h] have not converged, as
# after a blow; they get at most so many more, around bodies whose contacts change by more than
# that [g h]
_UNCONVERGED, _EXTRA_ITERATIONS, _CONVERGED = 3.0, 12, 0.3
# contacts are compared with their law, and bodies split anew, in the first iterations, and then in
# every so many
_FIRST, _EVERY = 2, 4


@in_place
def solve_large(
    world: World,
    contacts: Contacts,
    law: Law,
    start: Impulses,
    accelerations: Array,
    h: float,
    nominal_h: float,
    iterations: int,
    blocks_out: Blocks,
    bodies_out: Bodies,
    impulses_out: Impulses,
) -> float:
    """Solve an island; returns the speed by which the last step changed a contact most.

    Args:
        world: What does not move.
        contacts: Those of the island.
        law: Their coefficients.
        start: Impulses of the last substep.
        accelerations: Of the spheres in flight, shape (n, 3).
        h: Length of the substep; 0 for a correction of collisions that the last one missed.
        nominal_h: Length of a regular substep, for thresholds of speed.
        iterations: Iterations, unless more are needed.
        blocks_out: Scratch.
        bodies_out: Changes of their bodies are written.
        impulses_out: Written.
    """
    blocks, curved = blocks_out, world.has_laws
    pairs, count, bodies = fill(
        world, contacts, law, start, accelerations, nominal_h, bodies_out, blocks
    )
    for q in range(count):
        begin(blocks, q, pairs)
    _end_pass(blocks, bodies)
    for q in range(count):
        find_start_coupling(blocks, q)
        blocks.on[q] = True
    for iteration in range(iterations):
        if iteration < _FIRST or iteration % _EVERY == 0:
            for q in range(count):
                find_targets_of(blocks, q, h, curved)
            split_large(blocks, pairs, count, bodies)
        for q in range(count):
            press(blocks, q, pairs)
        _end_pass(blocks, bodies)
        for q in range(count):
            rub(blocks, q, pairs, curved)
        _end_pass(blocks, bodies)
    fall = UNIT_GRAVITY * nominal_h
    if _change(blocks, count) > _UNCONVERGED * fall:
        for extra in range(_EXTRA_ITERATIONS):
            if not _choose_blocks(
                blocks, count, bodies, len(world.restitution), _CONVERGED * fall
            ):
                break
            for q in range(count):
                if blocks.on[q]:
                    if extra % _EVERY == 0:
                        find_targets_of(blocks, q, h, curved)
                    press(blocks, q, pairs)
            _end_pass_of_blocks(blocks, count)
            for q in range(count):
                if blocks.on[q]:
                    rub(blocks, q, pairs, curved)
            _end_pass_of_blocks(blocks, count)
    for m in range(bodies):
        store(blocks.moments, WIDTH * blocks.own[m], same(0.0))
    for q in range(count):
        mass_a = columns_of(blocks.motion, 0, blocks.a, q * WIDTH)[3]
        mass_b = columns_of(blocks.motion, 0, blocks.b, q * WIDTH)[3]
        push(blocks.moments, blocks, q, displace(blocks, q), mass_a, mass_b, pairs)
    take(blocks, bodies, bodies_out, impulses_out)
    return _change(blocks, count)


@in_place
def _end_pass(blocks_out: Blocks, bodies: int) -> None:
    """Let all velocities be those of the end of a pass."""
    for m in range(bodies):
        _update(blocks_out, blocks_out.own[m])


@in_place
def _end_pass_of_blocks(blocks_out: Blocks, count: int) -> None:
    """Let velocities around blocks that still change be those of the end of a pass."""
    for q in range(count):
        if blocks_out.on[q]:
            last = -1  # contacts are sorted by body a
            for place in range(q * WIDTH, q * WIDTH + WIDTH):
                if blocks_out.a[place] != last:
                    last = blocks_out.a[place]
                    _update(blocks_out, last)
                _update(blocks_out, blocks_out.b[place])


@in_place
def _update(blocks_out: Blocks, i: int) -> None:
    store(blocks_out.motion, WIDTH * i, load(blocks_out.new_motion, WIDTH * i))


@in_place
def _change(blocks: Blocks, count: int) -> float:
    """Largest speed by which the last step changed a contact."""
    largest = 0.0
    for q in range(count):
        for lane in range(WIDTH):
            largest = max(largest, blocks.values[q * STRIDE + CHANGE + lane])
    return math.sqrt(largest)


@in_place
def _choose_blocks(
    blocks_out: Blocks, count: int, bodies: int, spheres: int, tolerance: float
) -> bool:
    """Choose the blocks around bodies whose contacts changed by more; whether there are any."""
    blocks, moved, found = blocks_out, blocks_out.marked, False
    for m in range(bodies):
        moved[blocks.own[m]] = False
    for q in range(count):
        for lane in range(WIDTH):
            if blocks.values[q * STRIDE + CHANGE + lane] > tolerance * tolerance:
                a, b = blocks.a[q * WIDTH + lane], blocks.b[q * WIDTH + lane]
                moved[a], moved[b], found = True, b < spheres, True
    for q in range(count):
        was, now = blocks.on[q], False
        for place in range(q * WIDTH, q * WIDTH + WIDTH):
            now |= moved[blocks.a[place]] | moved[blocks.b[place]]
        blocks.on[q] = now
        if was and not now:
            _rest(blocks.values, q * STRIDE)
    return found


@in_place
def _rest(values: Array, at: int) -> None:
    """Let a block have no last step: no momentum, and no change."""
    store(values, at + NORMAL_0, load(values, at + NORMAL))
    put_vector(values, at + TX_0, vector_at(values, at + TX))
    store(values, at + CHANGE, same(0.0))
