# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Spheres and rectangles as a picture, on the CPU: exact outlines, sunlight, shadows.

A rectangle is an array of shape (4, 3): a corner [m], its two sides over their squared lengths
[1/m], and its unit normal. A view is one of shape (4, 3): the eye [m], and right, up, forwards.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from ...scenes.state import Array

Numbers = NDArray[np.int64]

# what a pixel shows: the number of a sphere, or -2 - the number of a rectangle, or
NOTHING = -1
SUN, SKY = 0.66, 0.36
DARK_TONE = 0.5  # of the second tone of a sphere, by which one sees it turn
LINE = 0.012  # half the width of a line, of the distance of lines


@numba.njit(cache=True, inline='always')
def _dot(rows: Array, row: int, x: float, y: float, z: float) -> float:
    return float(rows[row, 0] * x + rows[row, 1] * y + rows[row, 2] * z)


@numba.njit(cache=True)
def cast_spheres(
    depth: Array, shown: Numbers, view: Array, slope: float, centres: Array, radii: Array
) -> None:
    """Find the nearest sphere of each pixel.

    Args:
        depth: Distance forwards [m], filled, shape (height, width); infinite where nothing is.
        shown: What each pixel shows, filled, shape (height, width).
        view: Of the camera, shape (4, 3).
        slope: Half the height of the picture over its distance.
        centres: Of the spheres [m], shape (n, 3).
        radii: Of the spheres [m], shape (n,).
    """
    height, width = depth.shape
    pixel = 2.0 * slope / height
    for index in range(len(radii)):
        r = radii[index]
        away = centres[index] - view[0]
        x = _dot(view, 1, away[0], away[1], away[2])
        y = _dot(view, 2, away[0], away[1], away[2])
        z = _dot(view, 3, away[0], away[1], away[2])
        if z <= 1.01 * r:
            continue
        # the cube around the sphere holds it, so its outline lies within these
        left = min((x - r) / (z - r), (x - r) / (z + r))
        right = max((x + r) / (z - r), (x + r) / (z + r))
        bottom = min((y - r) / (z - r), (y - r) / (z + r))
        top = max((y + r) / (z - r), (y + r) / (z + r))
        first_column = max(0, int(left / pixel + 0.5 * width))
        last_column = min(width - 1, int(right / pixel + 0.5 * width) + 1)
        first_row = max(0, int(0.5 * height - top / pixel))
        last_row = min(height - 1, int(0.5 * height - bottom / pixel) + 1)
        beyond = x * x + y * y + z * z - r * r
        for row in range(first_row, last_row + 1):
            v = (0.5 * height - row - 0.5) * pixel
            for column in range(first_column, last_column + 1):
                u = (column + 0.5 - 0.5 * width) * pixel
                a = u * u + v * v + 1.0
                b = u * x + v * y + z
                inside = b * b - a * beyond
                if inside >= 0.0:
                    distance = (b - np.sqrt(inside)) / a
                    if 0.0 < distance < depth[row, column]:
                        depth[row, column] = distance
                        shown[row, column] = index


@numba.njit(cache=True)
def cast_quads(depth: Array, shown: Numbers, view: Array, slope: float, quads: Array) -> None:
    """Rectangles where they are nearer than spheres; seen from the front only.

    Args:
        depth: As `cast_spheres` left it.
        shown: The same.
        view: Of the camera, shape (4, 3).
        slope: Half the height of the picture over its distance.
        quads: Rectangles, shape (m, 4, 3).
    """
    height, width = depth.shape
    pixel = 2.0 * slope / height
    for index in range(len(quads)):
        quad = quads[index]
        away = view[0] - quad[0]
        above = _dot(quad, 3, away[0], away[1], away[2])
        if above <= 0.0:
            continue
        for row in range(height):
            v = (0.5 * height - row - 0.5) * pixel
            for column in range(width):
                u = (column + 0.5 - 0.5 * width) * pixel
                x = u * view[1, 0] + v * view[2, 0] + view[3, 0]
                y = u * view[1, 1] + v * view[2, 1] + view[3, 1]
                z = u * view[1, 2] + v * view[2, 2] + view[3, 2]
                fall = -_dot(quad, 3, x, y, z)
                if fall <= 0.0 or above >= fall * depth[row, column]:
                    continue
                t = above / fall
                x, y, z = away[0] + t * x, away[1] + t * y, away[2] + t * z
                if 0.0 <= _dot(quad, 1, x, y, z) <= 1.0 and 0.0 <= _dot(quad, 2, x, y, z) <= 1.0:
                    depth[row, column] = t
                    shown[row, column] = -2 - index


@numba.njit(cache=True)
def shadow_grid(lit: Array, cell: float) -> tuple[Array, Numbers, Numbers, Numbers]:
    """Spheres by the cell that the middle of their shadow is in.

    Args:
        lit: Middles: two coordinates across the light, one towards the sun [m], shape (n, 3).
        cell: Side of a cell [m].

    Returns:
        Least corner [m], shape (2,); numbers of cells, shape (2,); the `first` sphere of each
        cell, and the one `following` each sphere; -1 where there is none.
    """
    low = np.array([lit[:, 0].min(), lit[:, 1].min()])
    high = np.array([lit[:, 0].max(), lit[:, 1].max()])
    count = ((high - low) / cell).astype(np.int64) + 1
    first = np.full(count[0] * count[1], -1)
    following = np.full(len(lit), -1)
    for index in range(len(lit)):
        place = int((lit[index, 0] - low[0]) / cell) * count[1]
        place += int((lit[index, 1] - low[1]) / cell)
        following[index] = first[place]
        first[place] = index
    return low, count, first, following


@numba.njit(cache=True)
def sunlight(
    px: float,
    py: float,
    pz: float,
    sun: Array,
    lit: Array,
    radii: Array,
    grid: tuple[Array, Numbers, Numbers, Numbers],
    cell: float,
    slabs: Array,
) -> float:
    """Part of the sun that a point [m] sees, 0 to 1; outlines of shadows are a little soft.

    Args:
        px: x of the point.
        py: y of it.
        pz: z of it.
        sun: Rows: two across the light, and towards the sun, shape (3, 3).
        lit: Middles of the spheres in these directions [m], shape (n, 3).
        radii: Of the spheres [m], shape (n,).
        grid: What `shadow_grid` returns.
        cell: Side of its cells [m], at least 1.3 times the largest radius.
        slabs: Rectangles that throw shadows, shape (k, 4, 3).
    """
    for index in range(len(slabs)):
        slab = slabs[index]
        fall = _dot(slab, 3, sun[2, 0], sun[2, 1], sun[2, 2])
        if fall == 0.0:
            continue
        x, y, z = px - slab[0, 0], py - slab[0, 1], pz - slab[0, 2]
        reach = -_dot(slab, 3, x, y, z) / fall
        if reach > 0.01 * cell:
            x, y, z = x + reach * sun[2, 0], y + reach * sun[2, 1], z + reach * sun[2, 2]
            if 0.0 <= _dot(slab, 1, x, y, z) <= 1.0 and 0.0 <= _dot(slab, 2, x, y, z) <= 1.0:
                return 0.0
    low, count, first, following = grid
    x, y, z = _dot(sun, 0, px, py, pz), _dot(sun, 1, px, py, pz), _dot(sun, 2, px, py, pz)
    light = 1.0
    column, row = int(np.floor((x - low[0]) / cell)), int(np.floor((y - low[1]) / cell))
    for i in range(max(0, column - 1), min(count[0], column + 2)):
        for j in range(max(0, row - 1), min(count[1], row + 2)):
            index = first[i * count[1] + j]
            while index >= 0:
                r = radii[index]
                ahead = lit[index, 2] - z
                if ahead > 0.02 * r:
                    soft = min(0.25 * r, 0.01 * r + 0.02 * ahead)
                    off = np.sqrt((lit[index, 0] - x) ** 2 + (lit[index, 1] - y) ** 2)
                    light = min(light, max(0.0, (off - r + soft) / (2.0 * soft)))
                index = following[index]
    return light


@numba.njit(cache=True)
def shade(
    image: Array,
    depth: Array,
    shown: Numbers,
    view: Array,
    slope: float,
    centres: Array,
    turns: Array,
    radii: Array,
    colours: Array,
    quads: Array,
    paints: Array,
    line: float,
    slabs: Array,
    sun: Array,
    up: Array,
) -> None:
    """Colours of all pixels in linear light, 0 to 1.

    Args:
        image: Filled, shape (height, width, 3); pixels that show nothing stay as they are.
        depth: As `cast_quads` left it.
        shown: The same.
        view: Of the camera, shape (4, 3).
        slope: Half the height of the picture over its distance.
        centres: Of the spheres [m], shape (n, 3).
        turns: Rotations of the spheres as transposed matrices, shape (n, 3, 3).
        radii: Of the spheres [m], shape (n,).
        colours: Of the spheres, shape (n, 3).
        quads: Rectangles, shape (m, 4, 3).
        paints: Of the rectangles, shape (m, 3).
        line: Distance of the lines on rectangles [m].
        slabs: Rectangles that throw shadows, shape (k, 4, 3).
        sun: Rows: two across the light, and towards the sun, shape (3, 3).
        up: Unit vector upwards, shape (1, 3).
    """
    height, width = depth.shape
    pixel = 2.0 * slope / height
    largest = radii.max()
    cell = 1.4 * largest
    lit = centres @ np.ascontiguousarray(sun.T)
    grid = shadow_grid(lit, cell)
    for row in range(height):
        v = (0.5 * height - row - 0.5) * pixel
        for column in range(width):
            index, t = shown[row, column], depth[row, column]
            if index == NOTHING:
                continue
            u = (column + 0.5 - 0.5 * width) * pixel
            px = view[0, 0] + t * (u * view[1, 0] + v * view[2, 0] + view[3, 0])
            py = view[0, 1] + t * (u * view[1, 1] + v * view[2, 1] + view[3, 1])
            pz = view[0, 2] + t * (u * view[1, 2] + v * view[2, 2] + view[3, 2])
            if index >= 0:
                r = radii[index]
                nx = (px - centres[index, 0]) / r
                ny = (py - centres[index, 1]) / r
                nz = (pz - centres[index, 2]) / r
                turn = turns[index]
                side = _dot(turn, 0, nx, ny, nz) * _dot(turn, 1, nx, ny, nz)
                side *= _dot(turn, 2, nx, ny, nz)
                tone = 1.0 if side > 0.0 else DARK_TONE
            else:
                quad = quads[-2 - index]
                nx, ny, nz = quad[3, 0], quad[3, 1], quad[3, 2]
                x, y, z = px - quad[0, 0], py - quad[0, 1], pz - quad[0, 2]
                # a side over its squared length: once over its length is the unit vector
                near = (
                    _dot(quad, 1, x, y, z)
                    / np.sqrt(_dot(quad, 1, quad[1, 0], quad[1, 1], quad[1, 2]))
                    % line
                )
                far = (
                    _dot(quad, 2, x, y, z)
                    / np.sqrt(_dot(quad, 2, quad[2, 0], quad[2, 1], quad[2, 2]))
                    % line
                )
                on_line = min(near, far, line - near, line - far) < LINE * line
                tone = 0.78 if on_line else 1.0
            light = SKY * (0.65 + 0.35 * _dot(up, 0, nx, ny, nz))
            facing = _dot(sun, 2, nx, ny, nz)
            if facing > 0.0:
                lift = 1e-3 * largest
                x, y, z = px + lift * nx, py + lift * ny, pz + lift * nz
                light += SUN * facing * sunlight(x, y, z, sun, lit, radii, grid, cell, slabs)
            for part in range(3):
                paint = colours[index, part] if index >= 0 else paints[-2 - index, part]
                image[row, column, part] = min(1.0, light * tone * paint)
