# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs of spheres within reach of each other, by a hierarchical grid.

Cells double in size from level to level. A sphere is in the level whose cells are as wide as its
reach, and is compared with others of its own level and of coarser ones. So one fast sphere does
not widen the search of the others, and the cost grows with the number of spheres and of pairs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .jit import compiled, entry, in_place
from .lanes import bits, load, lowest_bit, WIDTH
from .vector import dot, minus, row, Vector
from ..scenes.state import Array

Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

# with fewer spheres, all pairs are compared
_BRUTE = 400
# levels of at most so many spheres are searched whole, not cell by cell
_FEW = 16


class Grid(NamedTuple):
    """Spheres by level and cell; cells are hashed into buckets.

    level, cell: of each sphere, shapes (n,) and (n, 3); size: cell width of each level; members:
    spheres sorted by bucket, shape (n,); start: where each bucket begins, shape (buckets + 1,);
    by_level: spheres sorted by level, shape (n,); level_start: where each level begins there.
    """

    level: Indices
    cell: Indices
    size: Array
    members: Indices
    start: Indices
    by_level: Indices
    level_start: Indices


@in_place
def _bucket(level: int, x: int, y: int, z: int, mask: int) -> int:
    return (x * 73856093 ^ y * 19349663 ^ z * 83492791 ^ level * 40503) & mask


@compiled
def counting_sort(values: Indices, kinds: int) -> tuple[Indices, Indices]:
    """Indices in the order of their values (0 to kinds - 1), and where each value begins."""
    start = np.zeros(kinds + 1, np.int64)
    for value in values:
        start[value + 1] += 1
    for kind in range(kinds):
        start[kind + 1] += start[kind]
    order = np.empty(len(values), np.int64)
    place = start[:-1].copy()
    for i in range(len(values)):
        order[place[values[i]]] = i
        place[values[i]] += 1
    return order, start


@compiled
def make_grid(positions: Array, extent: Array) -> Grid:
    """Sort spheres into grids.

    Args:
        positions: Centres, shape (n, 3).
        extent: How far from its centre each sphere may touch another, shape (n,).
    """
    count = len(positions)
    least = max(extent.min(), 1e-9)
    level = np.empty(count, np.int64)
    for i in range(count):
        level[i] = max(0, math.ceil(math.log2(max(extent[i], least) / least) - 1e-9))
    levels = level.max() + 1
    size = np.empty(levels)
    for k in range(levels):
        size[k] = 2.0 * least * 2.0**k * (1.0 + 1e-9)
    mask = 1
    while mask < 2 * count:
        mask *= 2
    mask -= 1
    cell = np.empty((count, 3), np.int64)
    bucket = np.empty(count, np.int64)
    for i in range(count):
        for axis in range(3):
            cell[i, axis] = math.floor(positions[i, axis] / size[level[i]])
        bucket[i] = _bucket(level[i], cell[i, 0], cell[i, 1], cell[i, 2], mask)
    members, start = counting_sort(bucket, mask + 1)
    by_level, level_start = counting_sort(level, levels)
    return Grid(level, cell, size, members, start, by_level, level_start)


@entry
def find_pairs(positions: Array, extent: Array, awake: Flags) -> tuple[Indices, Indices]:
    """Pairs i < j of spheres whose extents overlap, at least one of them awake; sorted.

    Args:
        positions: Centres, shape (n, 3).
        extent: How far from its centre each sphere may touch another, shape (n,).
        awake: Shape (n,).
    """
    count = len(positions)
    if count < _BRUTE:
        return _every_pair(positions, extent, awake)
    grid, near = make_grid(positions, extent), np.empty(count, np.int64)
    pairs, size = np.empty((8 * count, 2), np.int64), 0
    # what a cell holds in a row of memory
    places, cells = positions[grid.members], grid.cell[grid.members]
    reaches, levels = extent[grid.members], grid.level[grid.members]
    for i in range(count):
        found = _near_in_cells(grid, positions, extent, places, cells, reaches, levels, i, near)
        pairs = _with_room(pairs, size + found)
        size = _append(awake, i, near, found, size, pairs)
    return _sorted(pairs[:size], count)


@compiled
def _every_pair(positions: Array, extent: Array, awake: Flags) -> tuple[Indices, Indices]:
    """Pairs as of `find_pairs`, by comparing all, which is faster for few spheres."""
    count, size = len(positions), 0
    near, pairs = np.empty(count, np.int64), np.empty((max(64, 8 * count), 2), np.int64)
    # coordinates and extents in rows, with spheres infinitely far away after the last one
    length = count + WIDTH
    columns = np.full(4 * length, np.inf)
    for i in range(count):
        for axis in range(3):
            columns[axis * length + i] = positions[i, axis]
        columns[3 * length + i] = extent[i]
    columns[3 * length + count :] = 0.0
    for i in range(count):
        found = _near_among_all(columns, count, i, near)
        pairs = _with_room(pairs, size + found)
        size = _append(awake, i, near, found, size, pairs)
    return pairs[:size, 0].copy(), pairs[:size, 1].copy()


@compiled
def _with_room(pairs: Indices, size: int) -> Indices:
    """The same pairs, in more memory where there is none for so many."""
    if size <= len(pairs):
        return pairs
    longer = np.empty((2 * size, 2), np.int64)
    for k in range(len(pairs)):
        longer[k, 0], longer[k, 1] = pairs[k, 0], pairs[k, 1]
    return longer


@in_place
def _append(awake: Flags, i: int, near: Indices, found: int, size: int, pairs_out: Indices) -> int:
    """Append pairs of sphere i, unless both spheres sleep; returns how many pairs there are."""
    for k in range(found):
        j = near[k]
        if awake[i] or awake[j]:
            pairs_out[size, 0], pairs_out[size, 1] = min(i, j), max(i, j)
            size += 1
    return size


@in_place
def _near_among_all(columns: Array, count: int, i: int, near_out: Indices) -> int:
    """Find the spheres after i within reach, by comparing all; returns how many there are."""
    length, found = count + WIDTH, 0
    x, y, z = columns[i], columns[length + i], columns[2 * length + i]
    own = columns[3 * length + i]
    for first in range(i + 1, count, WIDTH):
        dx, dy = load(columns, first) - x, load(columns, length + first) - y
        dz = load(columns, 2 * length + first) - z
        reach = load(columns, 3 * length + first) + own
        mask = bits(dx * dx + dy * dy + dz * dz <= reach * reach)
        while mask > 0:
            near_out[found] = first + lowest_bit(mask)
            found += 1
            mask &= mask - 1
    return found


@in_place
def _near_in_cells(
    grid: Grid,
    positions: Array,
    extent: Array,
    places: Array,
    cells: Indices,
    reaches: Array,
    levels: Indices,
    i: int,
    near_out: Indices,
) -> int:
    """Find spheres within reach of sphere i, each pair once; returns how many there are.

    Args:
        grid: Of the spheres.
        positions: Centres, shape (n, 3).
        extent: Shape (n,).
        places: Centres in the order of the grid's members.
        cells: Cells, likewise.
        reaches: Extents, likewise.
        levels: Levels, likewise.
        i: Which sphere.
        near_out: Written.
    """
    found, place, reach, mask = 0, row(positions, i), extent[i], len(grid.start) - 2
    for level in range(grid.level[i], len(grid.size)):
        first, last = grid.level_start[level], grid.level_start[level + 1]
        own = level == grid.level[i]
        if last - first <= _FEW:
            for k in range(first, last):
                j = grid.by_level[k]
                if (j > i or not own) and _within(place, reach, row(positions, j), extent[j]):
                    near_out[found] = j
                    found += 1
            continue
        cx = math.floor(place[0] / grid.size[level])
        cy = math.floor(place[1] / grid.size[level])
        cz = math.floor(place[2] / grid.size[level])
        # of its own level only the cells from its own on: the others find it
        for step in range(13 if own else 0, 27):
            x, y, z = cx + step // 9 - 1, cy + step // 3 % 3 - 1, cz + step % 3 - 1
            bucket = _bucket(level, x, y, z, mask)
            for k in range(grid.start[bucket], grid.start[bucket + 1]):
                if (
                    cells[k, 0] == x
                    and cells[k, 1] == y
                    and cells[k, 2] == z
                    and levels[k] == level
                    and _within(place, reach, row(places, k), reaches[k])
                ):
                    j = grid.members[k]
                    if step != 13 or j > i or not own:
                        near_out[found] = j
                        found += 1
    return found


@in_place
def _within(one: Vector, reach: float, other: Vector, other_reach: float) -> bool:
    offset, sum_of_both = minus(one, other), reach + other_reach
    return dot(offset, offset) <= sum_of_both * sum_of_both


@compiled
def _sorted(pairs: Indices, count: int) -> tuple[Indices, Indices]:
    """Pairs sorted by the first sphere, then by the second."""
    order, start = counting_sort(pairs[:, 0], count)
    first, second = pairs[:, 0][order], pairs[:, 1][order]
    for i in range(count):
        second[start[i] : start[i + 1]].sort()
    return first, second
