# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bags of tracked poses with a known truth, as this project's tracker and recorder make them."""

from __future__ import annotations

from dataclasses import dataclass, replace
import json
from pathlib import Path

import numpy as np
from rigid_gns_core.bags.writer import BagWriter
from rigid_gns_core.data.recipe import DataRecipe
from rigid_gns_core.messages.poses import encode_string, PoseArrayCodec
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.state import Array, rotate_quaternions, Trajectory
from rigid_gns_core.teacher.bullet import simulate
from rigid_gns_core.teacher.settings import TeacherSettings

STAMP = 1_700_000_000_000_000_000
TOPIC = '/lab/tracked_poses'
# the teacher's frames [s]; every second is tracked (25 a second), every fifth is a model's step
FINE, TRACKED, STEP = 0.02, 2, 5
# materials of the lab, far from those that the GNS was trained on
TRUE = {'restitution': 0.64, 'friction': 0.3, 'rolling_friction': 0.06}
# materials that the simulator of the lab assumes: those that the GNS was trained on
BELIEVED = {'restitution': 0.7746, 'friction': 0.5, 'rolling_friction': 0.03}


@dataclass(frozen=True)
class Lab:
    """Bullet trajectories and how they are tracked.

    Args:
        trajectories: Number of trajectories.
        seconds: Length of each [s].
        seed: Seed of starts, noise and lost frames.
        spheres: Smallest and largest number of spheres.
        lost: Share of frames that are lost.
    """

    trajectories: int
    seconds: float
    seed: int
    spheres: tuple[int, int] = (30, 60)
    lost: float = 0.02

    @property
    def recipe(self) -> DataRecipe:
        """Recipe of boxes into which the spheres fall."""
        return DataRecipe(
            trajectories=self.trajectories,
            seed=self.seed,
            steps=round(self.seconds / FINE),
            dt=FINE,
            spheres=self.spheres,
            height=(1.0, 25.0),
            box_side=(16.0, 30.0),
            speed=(0.0, 8.0),
            spin=(0.0, 4.0),
            **TRUE,
        )

    def truth(self) -> list[tuple[Scene, Trajectory]]:
        """Scene and Bullet's trajectory, 50 frames a second, of each."""
        # substeps of 0.83 ms, as 120 in 0.1 s
        settings = TeacherSettings(substeps=24, rolling_updates=3)
        made = []
        for index in range(self.trajectories):
            scene, start = self.recipe.draw(index)
            made.append((scene, simulate(scene, start, self.recipe.steps, FINE, settings)))
        return made


def tracked(trajectory: Trajectory, noise: float, rng: np.random.Generator) -> Array:
    """Poses with noise of `noise` [m] in positions and noise / r [rad] in rotations, r = 1 m."""
    shape = trajectory.positions.shape
    places = trajectory.positions + rng.normal(0.0, noise, shape)
    turns = rotate_quaternions(trajectory.quaternions, rng.normal(0.0, noise, shape))
    return np.concatenate([places, turns], axis=-1)


def write_bag(
    folder: Path, scene: Scene, trajectory: Trajectory, noise: float, lost: float, seed: int
) -> Path:
    """Write a bag of tracked poses and a scene with the assumed materials; its folder."""
    rng = np.random.default_rng(seed)
    poses = tracked(trajectory, noise, rng)
    kept = rng.random(len(poses)) >= lost
    kept[[0, -1]] = True
    codec = PoseArrayCodec('world', trajectory.count)
    said = {
        'scene': replace(scene, **BELIEVED).to_mapping(),
        'model': 'laws',
        'topics': {'tracked': TOPIC},
    }
    with BagWriter(folder) as bag:
        bag.add_topic(TOPIC, 'geometry_msgs/msg/PoseArray', 'sensor_data')
        bag.add_topic('/lab/simulator/scene', 'std_msgs/msg/String', 'latched')
        bag.write('/lab/simulator/scene', encode_string(json.dumps(said)), STAMP)
        for index in range(0, len(poses), TRACKED):
            if kept[index]:
                stamp = STAMP + round(index * FINE * 1e9)
                bag.write(TOPIC, codec.encode(poses[index], stamp), stamp)
    return folder
