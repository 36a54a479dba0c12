# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The worlds: spheres of 1 m and 1 kg fall into a box; what an observer tracks of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from ..benchmark.lammps_engine import GranularSpheres
from ..benchmark.mujoco_engine import MujocoSettings, MujocoSpheres
from ...data.recipe import DataRecipe
from ...data.records import Record
from ...scenes.scene import Scene
from ...scenes.state import Array, quaternion_multiply, stacked, State, Trajectory
from ...teacher.bullet import simulate
from ...teacher.settings import TeacherSettings

FRAME = 0.1
"""A frame of the laws [s]."""
SAMPLES = 8
"""Samples of the tracker in a frame."""
# steps of MuJoCo in a sample; a contact of its soft world lasts a third of a frame
_STEPS = 12
_CONTACT = FRAME / 3.0


class _Spheres(Protocol):
    def state(self) -> State: ...

    def advance(self) -> Any: ...

    def close(self) -> None: ...


def _soft(scene: Scene, start: State, dt: float) -> _Spheres:
    stiffness = _CONTACT / np.pi / (dt / _STEPS)
    settings = MujocoSettings(substeps=_STEPS, stiffness=stiffness, iterations=20, tolerance=1e-6)
    return MujocoSpheres(scene, start, dt, settings)


def _advanced(make: Callable[[Scene, State, float], _Spheres]) -> Callable[..., Trajectory]:
    def run(scene: Scene, start: State, frames: int) -> Trajectory:
        dt = FRAME / SAMPLES
        spheres, states = make(scene, start, dt), [start]
        for _ in range(frames * SAMPLES):
            spheres.advance()
            states.append(spheres.state())
        spheres.close()
        return Trajectory(dt=dt, **vars(stacked(states)))

    return run


def _bullet(scene: Scene, start: State, frames: int) -> Trajectory:
    settings = TeacherSettings(substeps=24)  # in a sample
    return simulate(scene, start, frames * SAMPLES, FRAME / SAMPLES, settings)


WORLDS: dict[str, Callable[..., Trajectory]] = {
    'bullet': _bullet,
    'soft': _advanced(_soft),
    'granular': _advanced(GranularSpheres),
}
"""(scene, start, frames) -> states at the tracker's samples, by name of the world."""

RECIPE = DataRecipe(
    trajectories=1,
    seed=0,
    steps=50,
    spheres=(16, 40),
    height=(0.0, 12.0),
    box_side=(8.0, 14.0),
    restitution=0.7746,
    friction=0.5,
    speed=(0.0, 4.0),
    spin=(0.0, 3.0),
)
"""Scenes of the worlds: restitution of a pair 0.6, friction 0.25."""


@dataclass(frozen=True)
class Observed:
    """A trajectory of a world: what is true, and what a tracker saw, at its samples."""

    scene: Scene
    truth: Trajectory
    tracked: Trajectory

    def record(self, scene: Scene) -> Record:
        """What was tracked, with the materials of `scene`."""
        own = {name: getattr(scene, name) for name in MATERIALS}
        return Record(
            trajectory=self.tracked,
            scene=replace(self.scene, **own),
            seed=0,
            teacher={'engine': 'tracker'},
        )


MATERIALS = ('restitution', 'friction', 'rolling_friction')


def observe(world: str, seed: int, index: int, frames: int, noise: float) -> Observed:
    """Trajectory `index` of a set; it follows from (seed, index).

    Args:
        world: Name of the world.
        seed: Of the set.
        index: Which one.
        frames: Its length.
        noise: Standard deviation of positions [radii], and of rotations [rad].
    """
    recipe = replace(RECIPE, seed=seed, trajectories=index + 1)
    scene, start = recipe.draw(index)
    truth = WORLDS[world](scene, start, frames)
    rng = np.random.default_rng([seed, index, 3])
    positions = truth.positions + noise * rng.standard_normal(truth.positions.shape)
    turns = noise * rng.standard_normal(truth.positions.shape)
    quaternions = _turned(truth.quaternions, turns)
    return Observed(scene, truth, Trajectory.from_poses(positions, quaternions, truth.dt))


def _turned(quaternions: Array, small: Array) -> Array:
    """Rotations after others by small rotation vectors."""
    turns = np.concatenate([0.5 * small, np.ones((*small.shape[:-1], 1))], axis=-1)
    turned: Array = quaternion_multiply(turns, quaternions)
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    return turned
