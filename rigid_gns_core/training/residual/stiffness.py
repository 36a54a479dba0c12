# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stiffness of contacts from tracks: how fast overlaps push spheres apart.

Between samples of a sphere that overlaps others, a - g = k sum of m o n / m_i, with m the
effective mass of a contact, o its overlap and n its normal; k is the least-squares solution over
all of them. Damping acts against the motion, both into the contact and out of it, and so cancels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .frames import Track
from ...prediction.laws import UNITS
from ...scenes.state import Array

# tracks that are looked at, and overlaps [radii] from which on they are more than noise
_TRACKS, _DEEP = 20, 0.01
# fewest overlaps that tell it
_LEAST = 50


def stiffness_of(tracks: Sequence[Track]) -> float:
    """Stiffness of contacts per effective mass [1/s^2]; 0: contacts are too hard to be seen."""
    products, squares, count = 0.0, 0.0, 0
    for track in tracks[:_TRACKS]:
        pushes = _pushes(track)
        deep = np.linalg.norm(pushes, axis=-1) > 0
        h = UNITS.dt / track.samples
        found = np.diff(track.states.positions, 2, axis=0) / h**2 - np.asarray(track.scene.gravity)
        found, pushes = found[deep], pushes[deep]
        products += float((found * pushes).sum())
        squares += float((pushes**2).sum())
        count += len(found)
    return max(0.0, products / squares) if count >= _LEAST else 0.0


def _pushes(track: Track) -> Array:
    """Sum of m o n / m_i of each sphere at all samples but the ends; shape (m - 2, n, 3)."""
    positions = track.states.positions[1:-1]
    count = positions.shape[1]
    radius = track.scene.per_sphere('radius', count)
    mass = track.scene.per_sphere('mass', count)
    least = _DEEP * float(radius.mean())
    pushes = np.zeros_like(positions)
    share = mass[:, None] * mass / (mass[:, None] + mass) / mass[:, None]
    for k, centres in enumerate(positions):
        offsets = centres[:, None] - centres
        distance = np.linalg.norm(offsets, axis=-1) + 1e9 * np.eye(count)
        overlap = radius[:, None] + radius - distance
        weight = np.where(overlap > least, share * overlap / distance, 0.0)
        pushes[k] = (weight[:, :, None] * offsets).sum(axis=1)
    for plane in track.scene.surfaces:
        local = (positions - plane.point) @ plane.axes.T
        local[..., :2] -= np.clip(local[..., :2], -plane.half_lengths, plane.half_lengths)
        distance = np.linalg.norm(local, axis=-1)
        overlap = radius - distance
        weight = np.where(overlap > least, overlap / np.maximum(distance, 1e-9), 0.0)
        pushes += weight[..., None] * (local @ plane.axes)
    return pushes
