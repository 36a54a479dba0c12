# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Jumps of a track's velocity that no surface of the scene explains: a cue, a racket, a hand."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .ball_model import BallModel
from .ball_surfaces import AT_REST, BEGIN, END, facing, KIND, MOVES, normal_of, over
from .jit import entry, in_place, plain
from ..kernels.neighbours import Indices
from ..kernels.vector import dot, row, Vector
from ..scenes.state import Array

# steps from frame to frame of which the median is the velocity on each side, fewer at the ends:
# one frame that is off spoils two of them
_SIDE = 3
# a jump is larger than noise makes it [deviations of a step], and than this acceleration does over
# the time between the middles of both sides [g]: in the air, on a surface
_DEVIATIONS, _FLIGHT, _GLIDE = 8.0, 3.0, 0.5
# of frames that show a jump, the motion after it begins at the last with this part of the largest
_PLATEAU = 0.8
# a surface explains a jump within 60 degrees of its normal, of a ball at it: no farther than it
# moves in the frames on each side, and this [radii]; a ball this near is on it [radii]
_ALONG, _AT, _ON = 0.5, 0.3, 0.15


def kinks(model: BallModel, times: Array, positions: Array, noise: float) -> NDArray[np.int64]:
    """Frames at which a motion begins after a jump that no surface explains.

    Args:
        model: Surfaces, radius and gravity.
        times: Times [s], shape (m,).
        positions: Centres [m], shape (m, 3).
        noise: Standard deviation of a coordinate [m].
    """
    found = np.zeros(len(times), dtype=np.int64)
    count = find_kinks(model.ball, model.planes, plain(times), plain(positions), noise, found)
    return found[:count]


@in_place
def _median(a: float, b: float, c: float) -> float:
    return max(min(a, b), min(max(a, b), c))


@entry
def find_kinks(
    ball: Array, planes: Array, times: Array, positions: Array, noise: float, begins_out: Indices
) -> int:
    """As `kinks`, with `ball` and `planes` of `ball_path`; the number found."""
    m, found = len(times), 0
    if m < 4:
        return 0
    last = m - 2
    typical = float(np.median(times[1:] - times[:-1]))
    # velocity and duration of the steps around each frame, those at the ends repeated
    medians = np.zeros((m + 1, 4))
    for k in range(m + 1):
        for c in range(4):
            one, two, three = 0.0, 0.0, 0.0
            for side in range(_SIDE):
                step = min(max(k - side, 0), last)
                value = times[step + 1] - times[step]
                if c < 3:
                    value = (positions[step + 1, c] - positions[step, c]) / value
                one, two, three = two, three, value
            medians[k, c] = _median(one, two, three)
    pull = math.sqrt(ball[0, 0] ** 2 + ball[0, 1] ** 2 + ball[0, 2] ** 2)
    free = max(pull, 1.0) * _SIDE * typical
    sizes, large = np.zeros(m - 2), np.zeros(m - 2, dtype=np.bool_)
    for k in range(m - 2):
        for c in range(3):
            sizes[k] += (medians[k + _SIDE, c] - medians[k, c]) ** 2
        sizes[k] = math.sqrt(sizes[k])
        part = _GLIDE if _on_surface(ball, planes, positions, k + 1) else _FLIGHT
        # of three velocities the median is as noisy as the second shortest step makes it at most
        shortest = min(medians[k, 3], medians[k + _SIDE, 3])
        large[k] = sizes[k] > part * free + _DEVIATIONS * noise / shortest
    end = 0
    while end < m - 2:
        first = end
        end += 1
        if not large[first]:
            continue
        while end < m - 2 and large[end]:
            end += 1
        largest = first
        for k in range(first, end):
            if sizes[k] > sizes[largest]:
                largest = k
        x = (medians[largest + _SIDE, 0] - medians[largest, 0]) / sizes[largest]
        y = (medians[largest + _SIDE, 1] - medians[largest, 1]) / sizes[largest]
        z = (medians[largest + _SIDE, 2] - medians[largest, 2]) / sizes[largest]
        near = slice(max(first - _SIDE + 1, 0), end + _SIDE + 1)
        if not _explained(ball, planes, times[near], positions[near], (x, y, z)):
            begin = first
            for k in range(first, end):
                if sizes[k] >= _PLATEAU * sizes[largest]:
                    begin = k
            begins_out[found] = begin + 1
            found += 1
    return found


@in_place
def _on_surface(ball: Array, planes: Array, positions: Array, i: int) -> bool:
    for k in range(len(planes)):
        pull, height = 0.0, -ball[0, 7]
        if planes[k, KIND] != AT_REST:
            continue
        for c in range(3):
            pull += planes[k, 9 + c] * ball[0, c]
            height += planes[k, 9 + c] * (positions[i, c] - planes[k, c])
        if pull < 0.0 and abs(height) < _ON * ball[0, 7]:
            return True
    return False


@in_place
def _explained(ball: Array, planes: Array, times: Array, positions: Array, jump: Vector) -> bool:
    """Whether a surface explains a jump along a unit vector in some frames."""
    reach = 0.0
    for i in range(len(positions) - 1):
        step = 0.0
        for c in range(3):
            step += (positions[i + 1, c] - positions[i, c]) ** 2
        reach = max(reach, math.sqrt(step))
    near = reach + _AT * ball[0, 7]
    for k in range(len(planes)):
        if planes[k, KIND] != AT_REST:
            # its normal is another one in each frame
            for i in range(len(positions)):
                place = row(positions, i)
                off, normal, _ = facing(planes, k, place, times[i], ball[0, 7])
                there = abs(off) < near and dot(jump, normal) > _ALONG
                if there and planes[k, KIND] == MOVES:
                    now = planes[k, BEGIN] <= times[i] <= planes[k, END]
                    there = now and over(planes, k, place, times[i], reach)
                if there:
                    return True
            continue
        if dot(jump, normal_of(planes, k)) <= _ALONG:
            continue
        nearest, inside = math.inf, True
        for i in range(len(positions)):
            along = side = 0.0
            height = -ball[0, 7]
            for c in range(3):
                apart = positions[i, c] - planes[k, c]
                along += apart * planes[k, 3 + c]
                side += apart * planes[k, 6 + c]
                height += apart * planes[k, 9 + c]
            nearest = min(nearest, height)
            inside = inside and abs(along) <= planes[k, 12] + reach
            inside = inside and abs(side) <= planes[k, 13] + reach
        if inside and nearest < near:
            return True
    return False
