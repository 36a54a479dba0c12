# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Planes whose motion is planned, for each substep: a twist that changes at a constant rate.

In a substep a plane starts with the twist of its plan and accelerates so that it ends where the
plan has it. So places have no jumps, a twist that changes at a constant rate is exact, and no
knot of a plan need lie on a substep.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .world import COLUMNS, World
from ..scenes.plane import Plane
from ..scenes.planned_motion import cross
from ..scenes.state import Array, quaternion_multiply, rotation_between, rotation_matrices

_INVERSE = np.array([-1.0, -1.0, -1.0, 1.0])


def with_plans(
    world: World, planes: Sequence[Plane], *, first: int, substeps: int, frame: int
) -> World:
    """World with the motion of its planes from one substep on, for so many; itself without plans.

    Args:
        world: Of the scene.
        planes: The surfaces of its scene, in its units.
        first: Number of the first substep.
        substeps: How many follow.
        frame: Substeps of a frame.
    """
    if not world.moving or all(plane.plan is None for plane in planes):
        return world
    h = world.twists.step
    # what is found at the end of the last frame is in the substep after it
    size = substeps + 1
    path = np.zeros((size, len(world.point), len(COLUMNS)))
    for index, plane in enumerate(planes):
        if plane.plan is not None:
            path[:, index] = motion_rows(plane, h, first, size, frame)
    return world._replace(twists=world.twists._replace(path=path, first=first))


def motion_rows(plane: Plane, h: float, first: int, size: int, frame: int) -> Array:
    """Rows of a plane at the start of each substep, shape (size, columns); see `World`.

    The first one may be before time 0.
    """
    assert plane.plan is not None
    times = h * np.arange(first, first + size + frame + 1, dtype=np.float64)
    origin = plane.plan.at(np.zeros(1))
    found = plane.plan.at(times)
    back = origin.quaternions * _INVERSE
    turns = rotation_matrices(
        quaternion_multiply(found.quaternions, np.repeat(back, len(times), axis=0))
    )
    arm = turns @ (np.asarray(plane.point) - origin.positions[0])
    point, spin = found.positions + arm, found.angular_velocities
    velocity = found.velocities + cross(spin, arm)
    speed, rate = (np.linalg.norm(values, axis=1) for values in (velocity, spin))
    ways = np.diff(point, axis=0)
    chords = rotation_between(found.quaternions[:-1], found.quaternions[1:])
    # a twist may jump within a substep: the chords count, too
    speed = np.maximum(speed[:-1], np.linalg.norm(ways, axis=1) / h)
    rate = np.maximum(rate[:-1], np.linalg.norm(chords, axis=1) / h)
    kept = slice(size)
    most = [
        np.lib.stride_tricks.sliding_window_view(values, frame + 1).max(axis=1)[kept]
        for values in (speed, rate)
    ]
    return np.concatenate(
        [
            point[kept],
            velocity[kept],
            spin[kept],
            2.0 / h**2 * (ways - h * velocity[:-1])[kept],
            2.0 / h**2 * (chords - h * spin[:-1])[kept],
            (plane.axes @ turns.transpose(0, 2, 1)).reshape(-1, 9)[kept],
            (turns @ np.asarray(plane.surface_velocity))[kept],
            np.stack(most, axis=1),
            np.ones((size, 1)),
        ],
        axis=1,
    )
