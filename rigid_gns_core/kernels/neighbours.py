# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs of spheres within reach of each other, by hierarchical grids.

Cells double in size from level to level. A sphere is in the level whose cells are as wide as its
reach, and is compared with others of its own level and of coarser ones. So one fast sphere does
not widen the search of the others, and the cost grows with the number of spheres and of pairs.
Spheres lie in memory in the order of their cells, so that neighbours along x are in a row, of
which eight are compared at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import compiled, entry, in_place
from .lanes import bits, load, lowest_bit, WIDTH
from .vector import row, Vector
from ..scenes.state import Array

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

# with fewer spheres, all pairs are compared; so are those of a level of at most so many
_BRUTE, _FEW = 400, 16
# least number of cells along an axis: with fewer, the cells on both sides of one were the same
_LEAST = 4


class Grids(NamedTuple):
    """Spheres by level and cell; l levels, whose cells repeat along each axis.

    level_start: where each level begins in the order of spheres, shape (l + 1,); size: cell width,
    shape (l,); cells: numbers of cells along the axes, powers of two, or 0 where the level is
    searched whole, shape (l, 3); first: first cell of each level, shape (l,); start: where each
    cell begins in the order of spheres; members: spheres in this order, shape (n,); columns:
    coordinates and reaches likewise, and spheres infinitely far away after them, shape
    (4 (n + 8),).
    """

    level_start: Indices
    size: Array
    cells: Indices
    first: Indices
    start: Indices
    members: Indices
    columns: Array


@compiled
def counting_sort(values: Indices, kinds: int) -> tuple[Indices, Indices]:
    """Indices in the order of their values (0 to kinds - 1), and where each value begins."""
    start, place = np.zeros(kinds + 1, np.int64), np.empty(kinds, np.int64)
    order = np.empty(len(values), np.int64)
    _sort_by_counts(values, start, place, order)
    return order, start


@in_place
def _sort_by_counts(
    values: Indices, start_out: Indices, place_out: Indices, order_out: Indices
) -> None:
    for value in values:
        start_out[value + 1] += 1
    for kind in range(len(place_out)):
        place_out[kind] = start_out[kind]
        start_out[kind + 1] += start_out[kind]
    for i in range(len(values)):
        order_out[place_out[values[i]]] = i
        place_out[values[i]] += 1


@compiled
def _make_grids(positions: Array, extent: Array) -> Grids:
    """Sort spheres into grids.

    Args:
        positions: Centres, shape (n, 3).
        extent: How far from its centre each sphere may touch another, shape (n,).
    """
    count, levels = len(positions), 1
    least, level = max(extent.min(), 1e-9), np.zeros(count, np.int64)
    if count >= _BRUTE:
        for i in range(count):
            level[i] = max(0, math.ceil(math.log2(max(extent[i], least) / least) - 1e-9))
        levels = level.max() + 1
    _, level_start = counting_sort(level, levels)
    size, cells = np.empty(levels), np.zeros((levels, 3), np.int64)
    first, total = np.empty(levels, np.int64), 0
    for k in range(levels):
        size[k] = 2.0 * least * 2.0**k * (1.0 + 1e-9)
        own = level_start[k + 1] - level_start[k]
        if count >= _BRUTE and own > _FEW:
            _choose_cells(positions, level, k, size[k], own, cells[k])
        first[k] = total
        total += max(1, cells[k, 0] * cells[k, 1] * cells[k, 2])
    cell = np.empty(count, np.int64)
    for i in range(count):
        k = level[i]
        cell[i] = first[k]
        if cells[k, 0] > 0:
            x, y, z = _cell_of(row(positions, i), size[k])
            cell[i] += _row_of(cells, k, y, z) + (x & (cells[k, 0] - 1))
    members, start = counting_sort(cell, total)
    length = count + WIDTH
    columns = np.full(4 * length, np.inf)
    for s in range(count, length):
        columns[3 * length + s] = 0.0
    for s in range(count):
        for axis in range(3):
            columns[axis * length + s] = positions[members[s], axis]
        columns[3 * length + s] = extent[members[s]]
    return Grids(level_start, size, cells, first, start, members, columns)


@in_place
def _choose_cells(
    positions: Array, level: Indices, k: int, size: float, own: int, cells_out: Indices
) -> None:
    """Numbers of cells of level k: enough for its spheres, but not many more than these."""
    for axis in range(3):
        low, high = math.inf, -math.inf
        for i in range(len(level)):
            if level[i] == k:
                low, high = min(low, positions[i, axis]), max(high, positions[i, axis])
        cells_out[axis] = _LEAST
        while cells_out[axis] < own and cells_out[axis] * size < high - low + size:
            cells_out[axis] *= 2
    while cells_out[0] * cells_out[1] * cells_out[2] > max(_LEAST**3, 2 * own):
        longest = 0
        for axis in range(1, 3):
            if cells_out[axis] > cells_out[longest]:
                longest = axis
        cells_out[longest] //= 2


@in_place
def _cell_of(place: Vector, size: float) -> tuple[int, int, int]:
    return math.floor(place[0] / size), math.floor(place[1] / size), math.floor(place[2] / size)


@in_place
def _row_of(cells: Indices, level: int, y: int, z: int) -> int:
    """First cell of a row along x, within its level."""
    rows = (z & (cells[level, 2] - 1)) * cells[level, 1] + (y & (cells[level, 1] - 1))
    return rows * cells[level, 0]


@entry
def find_pairs(positions: Array, extent: Array, awake: Flags) -> tuple[Indices, Indices]:
    """Pairs i < j of spheres whose extents overlap, at least one of them awake; sorted.

    Args:
        positions: Centres, shape (n, 3).
        extent: How far from its centre each sphere may touch another, shape (n,).
        awake: Shape (n,).
    """
    count = len(positions)
    if count == 0:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    grids, near = _make_grids(positions, extent), np.empty(count, np.int64)
    pairs = np.empty((2, max(64, 8 * count)), np.int64)
    place, size = _append_pairs(grids, awake, 0, 0, near, pairs)
    while place < count:  # there was no room for those of the next sphere
        longer = np.empty((2, 2 * pairs.shape[1] + count), np.int64)
        for k in range(size):
            longer[0, k], longer[1, k] = pairs[0, k], pairs[1, k]
        pairs = longer
        place, size = _append_pairs(grids, awake, place, size, near, pairs)
    first, second = pairs[0, :size], pairs[1, :size]
    if count < _BRUTE:  # already sorted
        return first.copy(), second.copy()
    by_second, _ = counting_sort(second, count)
    by_first, _ = counting_sort(first[by_second], count)
    order = by_second[by_first]
    return first[order], second[order]


@in_place
def _append_pairs(
    grids: Grids, awake: Flags, place: int, size: int, near_out: Indices, pairs_out: Indices
) -> tuple[int, int]:
    """Append pairs of the spheres from `place` on, unless both spheres sleep.

    Returns the place of the first sphere for whose pairs there is no room, and how many pairs
    there are.
    """
    level = 0
    for s in range(place, len(grids.members)):
        while grids.level_start[level + 1] <= s:
            level += 1
        found, i = _find_near(grids, level, s, near_out), grids.members[s]
        if size + found > pairs_out.shape[1]:
            return s, size
        for q in range(found):
            j = grids.members[near_out[q]]
            if awake[i] or awake[j]:
                pairs_out[0, size], pairs_out[1, size] = min(i, j), max(i, j)
                size += 1
    return len(grids.members), size


@in_place
def _find_near(grids: Grids, level: int, s: int, near_out: Indices) -> int:
    """Find places of spheres within reach of that at place s, each pair once; how many."""
    columns, start, length, found = grids.columns, grids.start, len(grids.columns) // 4, 0
    place = columns[s], columns[length + s], columns[2 * length + s]
    for k in range(level, len(grids.size)):
        own, wide = k == level, grids.cells[k, 0]
        if wide == 0:
            first = s + 1 if own else grids.level_start[k]
            last = grids.level_start[k + 1]
            found = _find_in_row(columns, s, first, last, found, near_out)
            continue
        x, y, z = _cell_of(place, grids.size[k])
        # of its own level only what comes after it: others find the rest
        for step in range(4 if own else 0, 9):
            begin = grids.first[k] + _row_of(grids.cells, k, y + step % 3 - 1, z + step // 3 - 1)
            left = (x - 1) & (wide - 1)
            first, end = start[begin + left], left + 3
            if own and step == 4:
                left = x & (wide - 1)
                first, end = s + 1, left + 2
            last = start[begin + min(end, wide)]
            found = _find_in_row(columns, s, first, last, found, near_out)
            if end > wide:
                last = start[begin + end - wide]
                found = _find_in_row(columns, s, start[begin], last, found, near_out)
    return found


@in_place
def _find_in_row(
    columns: Array, s: int, first: int, last: int, found: int, near_out: Indices
) -> int:
    """Find spheres at places from first to last, the latter not included, within reach."""
    length = len(columns) // 4
    x, y, z = columns[s], columns[length + s], columns[2 * length + s]
    own = columns[3 * length + s]
    for begin in range(first, last, WIDTH):
        dx, dy = load(columns, begin) - x, load(columns, length + begin) - y
        dz = load(columns, 2 * length + begin) - z
        reach = load(columns, 3 * length + begin) + own
        mask = bits(dx * dx + dy * dy + dz * dz <= reach * reach)
        if last - begin < WIDTH:
            mask &= (1 << (last - begin)) - 1
        while mask > 0:
            near_out[found] = begin + lowest_bit(mask)
            found += 1
            mask &= mask - 1
    return found
