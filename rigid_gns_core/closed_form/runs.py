# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs of the checks with several contacts: few spheres of 1 m, and what is read from them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .bounces import Simulate
from .check import Check, check
from ..scenes.plane import Plane, Vector
from ..scenes.scene import Scene
from ..scenes.state import State, Trajectory

DT = 0.1
EXACT = 1e-6
"""Bound where a closed form holds without an approximation, relative to the speed."""
SAME = 1e-9
"""Bound of the difference of two runs that are the same but for rounding [r]."""
NEAR = 1e-3
"""Bound elsewhere, relative to the speed."""
AHEAD = 0.13
"""Time from the start to an impact [s]: within the second frame."""


def simulated(
    simulate: Simulate,
    surfaces: tuple[Plane, ...],
    positions: ArrayLike,
    velocities: ArrayLike | None = None,
    spins: ArrayLike | None = None,
    *,
    seconds: float,
    restitution: float = 1.0,
    friction: float = 0.0,
    **properties: Any,
) -> Trajectory:
    """Trajectory that begins at `positions` [m] and lasts at least `seconds`.

    Args:
        simulate: The engine.
        surfaces: Surfaces; those without materials of their own have the scene's.
        positions: Shape (n, 3).
        velocities: [m/s], shape (n, 3); None: at rest.
        spins: [rad/s], shape (n, 3); None: none.
        seconds: Duration.
        restitution: Of a pair, whether of two spheres or of a sphere and a surface.
        friction: Of a pair, likewise.
        properties: More of `Scene`; there is no rolling friction otherwise.
    """
    given = {'rolling_friction': 0.0} | properties
    scene = Scene(
        surfaces=surfaces,
        restitution=float(np.sqrt(restitution)),
        friction=float(np.sqrt(friction)),
        **given,
    )
    motion: dict[str, Any] = {'velocities': velocities, 'angular_velocities': spins}
    start = State(positions=np.asarray(positions, dtype=np.float64), **motion)
    return simulate(scene, start, frames(seconds), DT)


def frames(seconds: float) -> int:
    """Index of the first frame at least `seconds` after the start."""
    return int(np.ceil(seconds / DT - 1e-9))


def velocity_check(
    name: str, case: str, run: Trajectory, expected: ArrayLike, speed: float, bound: float
) -> Check:
    """Check the velocities [m/s] of the last frame, shape (n, 3): largest error over `speed`."""
    error = np.linalg.norm(run.velocities[-1] - np.asarray(expected), axis=-1).max() / speed
    return check(name, case, error, 0.0, bound)


def difference(one: Trajectory, other: Trajectory) -> float:
    """Largest distance of the spheres of two runs in any frame [m]."""
    return float(np.linalg.norm(one.positions - other.positions, axis=-1).max())


def plate(
    centre: ArrayLike,
    normal: ArrayLike = (0.0, 0.0, 1.0),
    direction: ArrayLike = (1.0, 0.0, 0.0),
    length_x: float = 20.0,
    length_y: float = 20.0,
) -> Plane:
    """Bounded plane with materials of the scene; lengths [m]."""
    return Plane(_vector(centre), _vector(normal), _vector(direction), length_x, length_y)


def _vector(value: ArrayLike) -> Vector:
    x, y, z = np.asarray(value, dtype=np.float64).tolist()
    return x, y, z
