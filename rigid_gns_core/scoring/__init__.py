# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of a trajectory: physical laws, which need no reference, and errors against a reference.

The definitions, with their formulas and choices, are in docs/metrics.md.
"""

from __future__ import annotations

import numpy as np

from .error import chamfer, error_metrics, horizon_metrics, HORIZONS, position_mse
from .motion import (
    angular_momentum,
    divergence,
    Energy,
    energy,
    energy_gain,
    horizontal_momentum_drift,
    linear_momentum,
    time_to_rest,
    vertical_spin_drift,
)
from .penetration import (
    lost_behind,
    passed_through,
    Penetration,
    sphere_penetration,
    surface_penetration,
)
from ..errors import UserError
from ..scenes.scene import Scene
from ..scenes.state import Trajectory

__all__ = [
    'HORIZONS',
    'Energy',
    'Penetration',
    'angular_momentum',
    'chamfer',
    'divergence',
    'energy',
    'energy_gain',
    'error_metrics',
    'horizon_metrics',
    'law_metrics',
    'linear_momentum',
    'lost_behind',
    'passed_through',
    'position_mse',
    'sphere_penetration',
    'surface_penetration',
    'time_to_rest',
]

LAW_KEYS = (
    'energy_gain',
    'energy_gain_with_rotation',
    'depth_static',
    'depth_ground',
    'depth_sphere',
    'intersections_sphere',
    'intersections_ground',
    'intersections_static',
    'passed_through',
    'rotational_energy',
    'energy_left',
    'horizontal_momentum_drift',
    'vertical_spin_drift',
    'final_speed',
    'final_speed_max',
    'time_to_rest',
)


def law_metrics(trajectory: Trajectory, scene: Scene) -> dict[str, float]:
    """How far a trajectory breaks, or keeps, the laws of physics; no reference is needed.

    Args:
        trajectory: Spheres over time.
        scene: Surfaces and sphere properties; surfaces that change place are not scored.

    Returns:
        The values named in `LAW_KEYS`. All are infinite where the trajectory diverged, since
        scores of the part before would flatter it.

    Raises:
        UserError: There are no spheres, or a property has another number of spheres.
    """
    if trajectory.count == 0:
        raise UserError('the trajectory has no spheres, so there is nothing to score; give one')
    if divergence(trajectory, scene) is not None:
        return dict.fromkeys(LAW_KEYS, float('inf'))
    scene = scene.of_fixed_surfaces()
    radius = scene.per_sphere('radius', trajectory.count)
    positions = trajectory.positions
    energies = energy(trajectory, scene)
    static = tuple(s for index, s in enumerate(scene.surfaces) if index != scene.ground)
    ground = () if scene.ground is None else (scene.surfaces[scene.ground],)
    spheres = sphere_penetration(positions, radius)
    on_ground = surface_penetration(positions, radius, ground, limit=np.inf)
    on_static = surface_penetration(positions, radius, static)
    through = passed_through(positions, scene.surfaces)
    speed = np.linalg.norm(trajectory.velocities[-1], axis=1)
    start = energies.with_rotation[0]
    return {
        'energy_gain': energy_gain(energies.total),
        'energy_gain_with_rotation': energy_gain(energies.with_rotation),
        'depth_static': on_static.depth,
        'depth_ground': on_ground.depth,
        'depth_sphere': spheres.depth,
        'intersections_sphere': spheres.percentage,
        'intersections_ground': on_ground.percentage,
        'intersections_static': on_static.percentage,
        'passed_through': 100.0 * float(np.mean(through)),
        'rotational_energy': float(energies.rotational.mean()),
        'energy_left': float(energies.with_rotation[-1] / start) if start > 0 else float('inf'),
        'horizontal_momentum_drift': horizontal_momentum_drift(trajectory, scene),
        'vertical_spin_drift': vertical_spin_drift(trajectory, scene),
        'final_speed': float(speed.mean()),
        'final_speed_max': float(speed.max()),
        'time_to_rest': time_to_rest(trajectory, scene),
    }
