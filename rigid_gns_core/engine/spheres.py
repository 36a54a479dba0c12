# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Moving state of all spheres."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags
from ..kernels.vector import put, row
from ..scenes.state import Array


class Spheres(NamedTuple):
    """Moving state of all spheres: shapes (n, 3), quaternions (x, y, z, w) (n, 4)."""

    positions: Array
    quaternions: Array
    velocities: Array
    angular_velocities: Array


@compiled
def copy_spheres(spheres: Spheres) -> Spheres:
    """Spheres in arrays of their own."""
    return Spheres(
        positions=spheres.positions.copy(),
        quaternions=spheres.quaternions.copy(),
        velocities=spheres.velocities.copy(),
        angular_velocities=spheres.angular_velocities.copy(),
    )


@compiled
def part_of(spheres: Spheres, k: int) -> Spheres:
    """View of one of several states in arrays of one more axis."""
    return Spheres(
        positions=spheres.positions[k],
        quaternions=spheres.quaternions[k],
        velocities=spheres.velocities[k],
        angular_velocities=spheres.angular_velocities[k],
    )


@in_place
def view_of(spheres: Spheres, k: int) -> Spheres:
    """As `part_of`, for functions that count no references."""
    return Spheres(
        positions=spheres.positions[k],
        quaternions=spheres.quaternions[k],
        velocities=spheres.velocities[k],
        angular_velocities=spheres.angular_velocities[k],
    )


@in_place
def is_finite(spheres: Spheres) -> bool:
    """Whether all values are finite."""
    for i in range(len(spheres.positions)):
        for k in range(3):
            moving = spheres.velocities[i, k] + spheres.angular_velocities[i, k]
            if not np.isfinite(spheres.positions[i, k] + moving):
                return False
        for k in range(4):
            if not np.isfinite(spheres.quaternions[i, k]):
                return False
    return True


@in_place
def store(spheres: Spheres, frame: int, frames_out: Spheres) -> None:
    """Write a state into one frame of `frames_out`, shapes (frames, n, k)."""
    for i in range(len(spheres.positions)):
        for k in range(3):
            frames_out.positions[frame, i, k] = spheres.positions[i, k]
            frames_out.velocities[frame, i, k] = spheres.velocities[i, k]
            frames_out.angular_velocities[frame, i, k] = spheres.angular_velocities[i, k]
        for k in range(4):
            frames_out.quaternions[frame, i, k] = spheres.quaternions[i, k]


@in_place
def replace_others(spheres: Spheres, kept: Flags, spheres_out: Spheres) -> None:
    """Write the states of all but some spheres, shape (n,), into those of others."""
    for i in range(len(kept)):
        if not kept[i]:
            put(spheres_out.positions, i, row(spheres.positions, i))
            put(spheres_out.velocities, i, row(spheres.velocities, i))
            put(spheres_out.angular_velocities, i, row(spheres.angular_velocities, i))
            for part in range(4):
                spheres_out.quaternions[i, part] = spheres.quaternions[i, part]
