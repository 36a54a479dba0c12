# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Obstacles that are solids of revolution as quadrangles; boxes are plates, and drawn as those."""

from __future__ import annotations

import numpy as np

from ..scenes.obstacle import Obstacle, Profile
from ..scenes.state import Array

# sides around the axis, and of a quarter of a rounding
_AROUND, _ROUND = 16, 3


def quads_of(obstacle: Obstacle) -> Array:
    """Corners [m], counter-clockwise seen from outside, shape (quadrangles, 4, 3)."""
    profile = obstacle.parts[0][1]
    if profile is None:
        raise ValueError(f'a {obstacle.shape} is no solid of revolution')
    outline = _outline(profile)
    angles = 2.0 * np.pi * np.arange(_AROUND + 1) / _AROUND
    across = np.stack([np.cos(angles), np.sin(angles)], axis=1) @ obstacle.axes[:2]
    rings = outline[:, 0, None, None] * across + outline[:, 1, None, None] * obstacle.axes[2]
    corners = [rings[:-1, :-1], rings[:-1, 1:], rings[1:, 1:], rings[1:, :-1]]
    quads: Array = np.stack(corners, axis=2).reshape(-1, 4, 3) + np.asarray(obstacle.point)
    return quads


def _outline(profile: Profile) -> Array:
    """Section as points (distance from the axis, height) [m], anticlockwise, shape (m, 2)."""
    inner, outer, half, rounding = profile[:4]
    corners = [(outer, -half), (outer, half)]
    if inner:
        corners += [(inner, half), (inner, -half)]
    points = [[0.0, -half - rounding]] if not inner else []
    for quarter, (s, z) in enumerate(corners):
        turns = 0.5 * np.pi * (quarter - 1 + np.arange(_ROUND + 1) / _ROUND)
        arc = [s + rounding * np.cos(turns), z + rounding * np.sin(turns)]
        points += np.stack(arc, axis=1).tolist()
    points.append(points[0] if inner else [0.0, half + rounding])
    outline: Array = np.array(points)
    apart = np.linalg.norm(np.diff(outline, axis=0), axis=1) > 1e-9 * (outer + half + rounding)
    kept: Array = outline[np.append(apart, True)]
    return kept
