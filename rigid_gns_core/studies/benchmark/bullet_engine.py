# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bullet as a peer: the teacher without its own additions to Bullet."""

from __future__ import annotations

import numpy as np

from ...errors import UserError
from ...scenes.scene import Scene
from ...scenes.state import Array, State
from ...teacher.bullet import Teacher
from ...teacher.settings import TeacherSettings


class BulletSpheres(Teacher):
    """A live Bullet scene that is advanced frame by frame, with one loop in Python.

    Maximal coordinates, solver and bounce threshold are the teacher's; rolling friction is
    Bullet's own. Only positions are read, since reading velocities costs as much as a substep.

    Args:
        scene: Surfaces, sphere properties and materials.
        start: State at time 0.
        dt: Length of a frame [s].
        settings: Settings of Bullet, without the teacher's rolling friction.

    Raises:
            UserError: The settings have the teacher's rolling friction.
    """

    def __init__(self, scene: Scene, start: State, dt: float, settings: TeacherSettings) -> None:
        if settings.rolling_updates:
            raise UserError(
                f'rolling_updates is {settings.rolling_updates}, expected 0: the rolling friction '
                'of the teacher is Python and would slow Bullet'
            )
        super().__init__(scene, start, dt, settings)

    def advance(self) -> Array:
        """Advance by a frame; the centres after it [m], shape (n, 3)."""
        step, read, client = (
            self._bullet.stepSimulation,
            self._bullet.getBasePositionAndOrientation,
            self._client,
        )
        for _ in range(self.settings.substeps):
            step(physicsClientId=client)
        places = [read(body, physicsClientId=client)[0] for body in self._bodies]
        return np.array(places) * self._length
