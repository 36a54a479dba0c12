# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Moving state of the spheres that take part in a frame, and how finely it is solved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..kernels.jit import compiled, in_place
from ..kernels.neighbours import Flags, Indices
from ..kernels.vector import put, row
from ..scenes.state import Array


class Motion(NamedTuple):
    """Moving state of the spheres that take part, shapes (m, 3).

    awake: shape (m,); work: done by surfaces that move, so far in the frame, shape (m,).
    """

    positions: Array
    velocities: Array
    angular_velocities: Array
    awake: Flags
    work: Array


class Settings(NamedTuple):
    """How finely a frame is solved.

    substeps: K of a frame; iterations: M of the solver in a substep.
    """

    substeps: int
    iterations: int


@compiled
def new_motion(spheres: int) -> Motion:
    """Room for so many spheres, all awake."""
    vectors = np.empty((3, spheres, 3))
    return Motion(
        positions=vectors[0],
        velocities=vectors[1],
        angular_velocities=vectors[2],
        awake=np.ones(spheres, np.bool_),
        work=np.zeros(spheres),
    )


@compiled
def copy_motion(motion: Motion) -> Motion:
    """Motion in arrays of its own."""
    p, v, w = motion.positions, motion.velocities, motion.angular_velocities
    return Motion(
        positions=p.copy(),
        velocities=v.copy(),
        angular_velocities=w.copy(),
        awake=motion.awake,
        work=motion.work.copy(),
    )


@in_place
def restore_motion(motion: Motion, members: Indices, motion_out: Motion) -> None:
    """Copy the motion of some spheres."""
    for i in members:
        put(motion_out.positions, i, row(motion.positions, i))
        put(motion_out.velocities, i, row(motion.velocities, i))
        put(motion_out.angular_velocities, i, row(motion.angular_velocities, i))
        motion_out.work[i] = motion.work[i]
