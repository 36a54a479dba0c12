# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Truth for tracking_filter.py: trajectories, and when spheres had contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rigid_gns_core.data.records import demo_record
from rigid_gns_core.scenes.plane import Plane
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Array, State, Trajectory
from rigid_gns_core.teacher.bullet import Teacher
from rigid_gns_core.teacher.settings import TeacherSettings

BALLS = 12  # of the table


@dataclass(frozen=True)
class Truth:
    """True trajectory of a scene.

    Args:
        name: Name in the table.
        scene: Surfaces and materials.
        trajectory: Trajectory without noise.
        radius: Radius [m].
    """

    name: str
    scene: Scene
    trajectory: Trajectory
    radius: float

    @property
    def struck(self) -> NDArray[np.bool_]:
        """Whether a contact acted between a frame and the next, shape (frames - 1, n)."""
        return self._pushed() > 0.05 * self._fall

    @property
    def bounced(self) -> NDArray[np.bool_]:
        """Whether a contact was more than a slow bounce, shape (frames - 1, n)."""
        return self._pushed() > 2.0 * self._fall + 0.3 * np.sqrt(9.81 * self.radius)

    @property
    def _fall(self) -> float:
        return float(np.linalg.norm(self.scene.gravity)) * self.trajectory.dt

    def _pushed(self) -> Array:
        velocities = self.trajectory.velocities
        fall = np.asarray(self.scene.gravity) * self.trajectory.dt
        return np.linalg.norm(np.diff(velocities, axis=0) - fall, axis=-1)


def box() -> Truth:
    """The shipped trajectory: 154 spheres of radius 1 m fall into a box, 10 Hz."""
    record = demo_record()
    return Truth('box of 154, r 1 m, 10 Hz', record.scene, record.trajectory.window(0, 301), 1.0)


def table(hertz: float, seconds: float = 2.5, seed: int = 0) -> Truth:
    """Balls of radius 20 mm thrown onto a table, from which some fall to the floor."""
    rng = np.random.default_rng(seed)
    top = Plane((0.0, 0.0, 0.76), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 2.74, 1.525)
    scene = Scene(
        surfaces=(top, Plane()),
        radius=0.02,
        mass=0.0027,
        restitution=0.95,
        friction=0.5,
        rolling_friction=0.02,
    )
    places = np.stack(
        [
            rng.uniform(-1.3, 1.3, BALLS),
            rng.uniform(-0.7, 0.7, BALLS),
            0.9 + 0.06 * rng.permutation(BALLS),
        ],
        axis=1,
    )
    speeds = rng.uniform(-1.0, 1.0, (BALLS, 3)) * [3.0, 1.0, 1.5]
    start = State(
        positions=places, velocities=speeds, angular_velocities=rng.normal(0, 25.0, (BALLS, 3))
    )
    dt = 1.0 / hertz
    states = [start]
    with Teacher(scene, start, dt, TeacherSettings(substeps=round(240 * dt / 0.01414))) as teacher:
        for _ in range(round(seconds / dt)):
            states.append(teacher.step())
    return Truth(f'table, r 20 mm, {hertz:g} Hz', scene, Trajectory.from_states(states, dt), 0.02)
