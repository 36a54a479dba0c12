# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bullet as a model of fitted scenes: no air, and one restitution and friction per surface."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
import weakref

import numpy as np

from ...rollout.simulator import Simulator
from ...rollout.stepper import Stepper
from ...scenes.contact_law import ContactLaw
from ...scenes.scene import Scene
from ...scenes.similarity import ModelUnits
from ...scenes.state import State
from ...teacher.bullet import load_pybullet, Teacher
from ...teacher.settings import TeacherSettings

# approach speed and rolling speed at which values that change with speed are taken [m/s]
_SPEED = 1.0
# a frame of spheres of 1 m [s]: 7 ms for a table tennis ball, in steps of 0.14 ms
_FRAME, _SUBSTEPS = 0.05, 48


def bullet_scene(scene: Scene, count: int) -> Scene:
    """The scene with what Bullet knows of it: materials instead of contact laws, and no air.

    Restitution and friction of a pair are products in Bullet: those of the spheres are square
    roots of what holds for two of them, and 1 where there is but one.

    Args:
        scene: A fitted scene.
        count: Number of spheres.
    """
    own = {name: scene.per_sphere(name, count) for name in ('restitution', 'friction')}
    pair = scene.sphere_contact
    if count == 1:
        own = {name: np.ones(1) for name in own}
    elif pair is not None:
        own['restitution'] = np.full(count, np.sqrt(float(pair.curve.at(_SPEED))))
        own['friction'] = np.full(count, np.sqrt(pair.friction))
    planes, rolling = [], scene.rolling_friction
    for plane in scene.surfaces:
        law = plane.contact
        if law is None:
            planes.append(plane)
            continue
        restitution = min(float(law.curve.at(_SPEED)) / max(own['restitution'].mean(), 1e-9), 1.0)
        friction = law.friction / max(float(own['friction'].mean()), 1e-9)
        planes.append(replace(plane, contact=None, restitution=restitution, friction=friction))
        if np.dot(plane.normal, scene.up) > 0.7:  # rolling is on what carries
            rolling = _rolling(law)
    return replace(
        scene,
        surfaces=tuple(planes),
        restitution=tuple(own['restitution'].tolist()),
        friction=tuple(own['friction'].tolist()),
        rolling_friction=rolling,
        air=None,
        sphere_contact=None,
        tracker=None,
    )


def _rolling(law: ContactLaw) -> float:
    return law.rolling_friction + law.rolling_friction_slope * _SPEED


class BulletSimulator(Simulator):
    """Bullet with the teacher's settings.

    Raises:
        ModuleNotFoundError: pybullet is not installed.
    """

    kind = 'bullet'
    velocities = 'given'

    def __init__(self) -> None:
        load_pybullet()
        card: dict[str, Any] = {'kind': self.kind, 'frame': _FRAME, 'substeps': _SUBSTEPS}
        super().__init__(card, 'bullet', ModelUnits(radius=1.0, gravity=9.81, dt=_FRAME))

    def check(self, scene: Scene, count: int, *, stacklevel: int = 2) -> None:
        """Accept every scene: what Bullet has not is left out, see `bullet_scene`."""

    def stepper(self, scene: Scene, state: State) -> Stepper:
        """Stepper that starts from `state`; scene and state are in the model's units."""
        return _BulletStepper(scene, state, self.units.dt)


class _BulletStepper(Stepper):
    """Bullet from a state on."""

    def __init__(self, scene: Scene, state: State, dt: float) -> None:
        settings = TeacherSettings(substeps=_SUBSTEPS)
        self._teacher = Teacher(bullet_scene(scene, len(state)), state, dt, settings)
        weakref.finalize(self, self._teacher.close)  # Bullet has a bounded number of clients

    def step(self) -> State:
        return self._teacher.step()
