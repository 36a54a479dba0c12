# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stretches of tracked poses as trajectories at the time step of a model."""

from __future__ import annotations

from collections import Counter

import numpy as np

from .options import ImportBagError
from ..resample import resample
from ..tracked_frames import Segment
from ...errors import UserError
from ...forecasts.forecaster import scene_of
from ...prediction.load import load_simulator
from ...scenes.placement import depths
from ...scenes.scene import Scene
from ...scenes.state import Trajectory
from ...tracking.pose_noise import PoseNoise

SLOWEST = 2.0
"""Largest interval between tracked frames [time steps of the data]."""

# a centre further behind a surface does not fit the scene [radii]
_BEHIND = 0.2


def native_dt(scene: Scene, model: str) -> float:
    """Time step of a model in a scene [s]."""
    return load_simulator(model).native_dt(scene)


def fitting_scene(part: Segment, scene: Scene, noise: PoseNoise, where: str) -> Scene:
    """The scene for the spheres of a segment.

    Raises:
        ImportBagError: It is of another number of spheres, or spheres lie behind its surfaces.
    """
    count = part.poses.shape[1]
    if part.ids is not None:
        try:
            scene = scene_of(scene, part.ids)
        except UserError as error:
            raise ImportBagError(f'{where}: {error}') from error
    if scene.sphere_count not in (None, count):
        raise ImportBagError(
            f'{where} has stretches with {count} spheres, but the scene has properties of '
            f'{scene.sphere_count}; give a --scene with one number for all, or bags of '
            f'{scene.sphere_count} spheres'
        )
    radius = scene.per_sphere('radius', count)
    allowed = _BEHIND * radius + 5.0 * noise.position
    for place, deep in depths(scene, part.poses[..., :3].reshape(-1, 3)):
        depth = deep.reshape(part.poses.shape[:2])
        if (depth > allowed).any():
            frame, sphere = np.unravel_index(int((depth - allowed).argmax()), depth.shape)
            raise ImportBagError(
                f'{where}: the centre of sphere {sphere} is {depth[frame, sphere]:.3g} m {place} '
                f'of the scene at {part.times[frame]:.3g} s, expected in front of or outside it; '
                'are positions in metres, z up, and is it the right --scene?'
            )
    return scene


def resampled(
    part: Segment, scene: Scene, dt: float, noise: PoseNoise, counts: Counter[str]
) -> Trajectory:
    """Poses of a segment at a time step; what each comes from is added to `counts`."""
    times = part.times
    steps = int(np.floor(times[-1] / dt + 1e-6))
    resampled = resample(
        times,
        part.poses[..., :3],
        part.poses[..., 3:],
        np.minimum(dt * np.arange(steps + 1), times[-1]),
        scene=scene,
        noise=noise.position,
    )
    counts.update(resampled.counts)
    return Trajectory.from_poses(resampled.positions, resampled.quaternions, dt)
