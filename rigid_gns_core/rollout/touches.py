# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What spheres touch in rollouts, and when: it tells the branches of a future apart."""

from __future__ import annotations

import numpy as np

from .paths import Paths, value
from ..scenes.plane import closest_points
from ..scenes.scene import Scene
from ..scenes.state import Array

# a blow is of a surface that is within this of touching [radii], and pushes within this angle of
# the way to the sphere; else another sphere gave it
_NEAR, _COSINE = 0.25, 0.3
# blows of one thing in steps that follow each other are one touch: it settles
_APART = 2.5

Touches = list[tuple[float, str]]


def touches_of(paths: Paths, scene: Scene, sphere: int) -> list[Touches]:
    """Time [s] and name of what a sphere touched, in each rollout; see `Branch.touched`."""
    found: list[Touches] = [[] for _ in range(len(paths.positions))]
    sample, step = np.nonzero(paths.struck[:, :, sphere])
    if not len(sample):
        return found
    where = (sample, step, np.full(len(sample), sphere))
    pieces = paths.pieces(where)
    places = value(pieces.coefficients[:, 0], pieces.split)
    radius = float(scene.per_sphere('radius', paths.positions.shape[2])[sphere])
    names = _names(scene, places, paths.blows[where], radius)
    times = step * paths.dt + pieces.split
    for row, time, name in zip(sample.tolist(), times.tolist(), names, strict=True):
        own = found[row]
        if own and own[-1][1] == name and time - own[-1][0] < _APART * paths.dt:
            continue
        own.append((time, name))
    return found


def _names(scene: Scene, places: Array, blows: Array, radius: float) -> list[str]:
    """Name of what each blow at a centre [m], shape (m, 3), came from."""
    surfaces = scene.surfaces
    if not surfaces:
        return ['sphere'] * len(places)
    points, _ = closest_points(surfaces, places)
    ways = places[:, None] - points
    lengths = np.linalg.norm(ways, axis=2)
    push = np.einsum('mki,mi->mk', ways, blows)
    push /= np.maximum(lengths * np.linalg.norm(blows, axis=1)[:, None], 1e-300)
    gaps = np.where(push > _COSINE, np.abs(lengths - radius), np.inf)
    nearest = gaps.argmin(axis=1)
    rows = np.arange(len(places))
    met = gaps[rows, nearest] <= _NEAR * radius
    axes = np.array([plane.axes[:2] for plane in surfaces])[nearest]
    ends = np.array([plane.half_lengths for plane in surfaces])[nearest]
    middles = np.array([plane.point for plane in surfaces])[nearest]
    along = np.einsum('mai,mi->ma', axes, places - middles)
    beyond = (np.abs(along) > ends).any(axis=1)
    return [
        (f'edge of surface {k}' if out else f'surface {k}') if touch else 'sphere'
        for k, touch, out in zip(nearest.tolist(), met.tolist(), beyond.tolist(), strict=True)
    ]
