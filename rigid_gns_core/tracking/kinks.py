# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Jumps of a track's velocity that no surface of the scene explains: a cue, a racket, a hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .ball_model import BallModel
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
    m = len(times)
    if m < 4:
        return np.zeros(0, dtype=np.int64)
    steps = np.diff(times)
    velocities = np.diff(positions, axis=0) / steps[:, None]
    ends = _SIDE - 1
    padded = np.concatenate([velocities[:1]] * ends + [velocities] + [velocities[-1:]] * ends)
    one, two, three = padded[:-2], padded[1:-1], padded[2:]
    highest, lowest = (
        np.maximum(np.maximum(one, two), three),
        np.minimum(np.minimum(one, two), three),
    )
    medians = one + two + three - highest - lowest  # of the steps that end at frame i + 1
    before, after = medians[: m - 2], medians[_SIDE : _SIDE + m - 2]
    jumps = after - before
    sizes = np.linalg.norm(jumps, axis=1)
    typical = float(np.median(steps))
    pull = float(np.linalg.norm(model.gravity))
    glides = _on_surface(model, positions)
    allowed = np.where(glides[1:-1], _GLIDE, _FLIGHT) * max(pull, 1.0) * _SIDE * typical
    large = sizes > allowed + _DEVIATIONS * noise / typical
    found = []
    edges = np.flatnonzero(np.diff(np.concatenate([[0], large.astype(int), [0]])))
    for first, end in edges.reshape(-1, 2):
        group = np.arange(first, end)
        largest = group[int(np.argmax(sizes[group]))]
        near = slice(max(first - _SIDE + 1, 0), end + _SIDE + 1)
        if not _explained(model, positions[near], jumps[largest] / sizes[largest]):
            found.append(group[sizes[group] >= _PLATEAU * sizes[largest]][-1] + 1)
    return np.array(found, dtype=np.int64)


def _on_surface(model: BallModel, positions: Array) -> NDArray[np.bool_]:
    on = np.zeros(len(positions), dtype=bool)
    for plane in model.planes:
        if plane[9:12] @ model.gravity < 0.0:
            height = (positions - plane[:3]) @ plane[9:12] - model.radius
            on |= np.abs(height) < _ON * model.radius
    return on


def _explained(model: BallModel, positions: Array, direction: Array) -> bool:
    reach = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).max())
    for plane in model.planes:
        local = (positions - plane[:3]) @ plane[3:12].reshape(3, 3).T
        nearest = float((local[:, 2] - model.radius).min())
        inside = (np.abs(local[:, :2]) <= plane[12:] + reach).all()
        if inside and direction @ plane[9:12] > _ALONG and nearest < reach + _AT * model.radius:
            return True
    return False
