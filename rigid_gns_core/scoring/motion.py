# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Energy, momentum, rest and divergence of a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scenes.scene import Scene
from ..scenes.state import Array, Trajectory


@dataclass(frozen=True)
class Energy:
    """Energy of all spheres together at each time, each array of shape (steps + 1,).

    Args:
        kinetic: Of translation, sum of 1/2 m v.v [J]; m with the added mass of air.
        potential: Sum of m g h [J]; h is the height of the centre above the ground, m less the air
            that the sphere displaces.
        rotational: Sum of 1/2 I w.w [J], I = i m r^2.
    """

    kinetic: Array
    potential: Array
    rotational: Array

    @property
    def total(self) -> Array:
        """The thesis' total energy: kinetic + potential [J]."""
        return self.kinetic + self.potential

    @property
    def with_rotation(self) -> Array:
        """Kinetic + potential + rotational [J], the quantity that physics conserves."""
        return self.total + self.rotational


def energy(trajectory: Trajectory, scene: Scene) -> Energy:
    """Energy over time, thesis section 3.3, and of rotation.

    Heights are above the scene's ground, so h = z in the thesis' box. Without a ground they are
    above the lowest point of any sphere at the start, so that no sphere starts below zero.
    """
    mass = scene.per_sphere('mass', trajectory.count)
    inertia, moving, heavy = _inertia(trajectory, scene), mass, mass
    if scene.air is not None:
        radius = scene.per_sphere('radius', trajectory.count)
        moving = scene.air.effective_mass(radius, mass)
        heavy = mass - scene.air.displaced_mass(radius)
    heights = trajectory.positions @ scene.up
    if scene.ground is not None:
        datum = float(np.asarray(scene.surfaces[scene.ground].point) @ scene.up)
    else:
        radius = scene.per_sphere('radius', trajectory.count)
        datum = float(np.min(heights[0] - radius))
    v, w = trajectory.velocities, trajectory.angular_velocities
    return Energy(
        kinetic=0.5 * np.einsum('knc,knc,n->k', v, v, moving),
        potential=float(np.linalg.norm(scene.gravity)) * ((heights - datum) @ heavy),
        rotational=0.5 * np.einsum('knc,knc,n->k', w, w, inertia),
    )


def energy_gain(total: Array) -> float:
    """Normalised cumulative energy gain of the thesis: sum of max(0, E[k+1] - E[k]) over E[0].

    Where E[0] is not positive there is nothing to normalise by: 0 if energy never rises, else inf.

    Args:
        total: Energy of all spheres at each time [J], shape (steps + 1,).
    """
    gain = float(np.maximum(np.diff(total), 0.0).sum())
    if gain == 0.0:
        return 0.0
    return gain / float(total[0]) if total[0] > 0 else float('inf')


def linear_momentum(trajectory: Trajectory, scene: Scene) -> Array:
    """Linear momentum of all spheres [kg m/s], shape (steps + 1, 3)."""
    mass = scene.per_sphere('mass', trajectory.count)
    momentum: Array = np.einsum('knc,n->kc', trajectory.velocities, mass)
    return momentum


def angular_momentum(trajectory: Trajectory, scene: Scene) -> Array:
    """Angular momentum of all spheres, orbits and spins [kg m^2/s], shape (steps + 1, 3).

    About the mean of the centres at the start.
    """
    mass = scene.per_sphere('mass', trajectory.count)
    arm = trajectory.positions - trajectory.positions[0].mean(axis=0)
    orbit = np.cross(arm, trajectory.velocities)
    spin = np.einsum('knc,n->kc', trajectory.angular_velocities, _inertia(trajectory, scene))
    total: Array = np.einsum('knc,n->kc', orbit, mass) + spin
    return total


def horizontal_momentum_drift(trajectory: Trajectory, scene: Scene) -> float:
    """Largest change of the total momentum across gravity since the start, relative.

    Over the largest sum of m |v| of the rollout; 0 where nothing moves. It is a law (0) only where
    no surface pushes sideways; elsewhere compare it with the reference's.
    """
    momentum = linear_momentum(trajectory, scene)
    change = momentum - momentum[0]
    change = change - np.outer(change @ scene.up, scene.up)
    mass = scene.per_sphere('mass', trajectory.count)
    scale = (np.linalg.norm(trajectory.velocities, axis=2) @ mass).max()
    return float(np.linalg.norm(change, axis=1).max() / scale) if scale > 0 else 0.0


def vertical_spin_drift(trajectory: Trajectory, scene: Scene) -> float:
    """Largest change of the total angular momentum about the vertical since the start, relative.

    Over the largest sum of m |p - c| |v| + I |w| of the rollout, c the mean centre at the start; 0
    where nothing moves. Gravity has no torque about the vertical, so it is a law (0) where no
    surface acts; elsewhere compare it with the reference's.
    """
    vertical = angular_momentum(trajectory, scene) @ scene.up
    arm = np.linalg.norm(trajectory.positions - trajectory.positions[0].mean(axis=0), axis=2)
    speed = np.linalg.norm(trajectory.velocities, axis=2)
    spin = np.linalg.norm(trajectory.angular_velocities, axis=2)
    mass = scene.per_sphere('mass', trajectory.count)
    scale = ((arm * speed) @ mass + spin @ _inertia(trajectory, scene)).max()
    return float(np.abs(vertical - vertical[0]).max() / scale) if scale > 0 else 0.0


def rest_speed(scene: Scene) -> float:
    """Speed below which a sphere is at rest [m/s]: 0.01 sqrt(g r), 0.031 m/s for r = 1 m.

    It scales as motion does (dynamic similarity). Without gravity: 0.01 r per second.
    """
    radius = float(np.mean(scene.radius))
    gravity = float(np.linalg.norm(scene.gravity))
    return 0.01 * (float(np.sqrt(gravity * radius)) if gravity > 0 else radius)


def time_to_rest(trajectory: Trajectory, scene: Scene) -> float:
    """First time after which none is faster than `rest_speed` [s]; inf where there is none."""
    speeds = np.linalg.norm(trajectory.velocities, axis=2)
    moving = (speeds > rest_speed(scene)).any(axis=1)
    if not moving.any():
        return 0.0
    last = len(moving) - 1 - int(np.argmax(moving[::-1]))
    return float('inf') if last == trajectory.steps else (last + 1) * trajectory.dt


def divergence(trajectory: Trajectory, scene: Scene) -> int | None:
    """First step at which a trajectory has diverged, or None.

    Diverged: a value is not finite, or a sphere is more than 1e6 radii from its start, or its
    velocity or spin exceeds 1e6 radii (rad) per time step.
    """
    limit, radius = 1e6, scene.per_sphere('radius', trajectory.count)[:, None]
    # written so that NaN, for which every comparison is false, counts as out of range
    inside = (np.abs(trajectory.positions - trajectory.positions[0]) <= limit * radius).all((1, 2))
    inside &= (np.abs(trajectory.velocities) * trajectory.dt <= limit * radius).all((1, 2))
    inside &= (np.abs(trajectory.angular_velocities) * trajectory.dt <= limit).all((1, 2))
    inside &= np.isfinite(trajectory.quaternions).all((1, 2))
    return None if inside.all() else int(np.argmin(inside))


def _inertia(trajectory: Trajectory, scene: Scene) -> Array:
    mass = scene.per_sphere('mass', trajectory.count)
    factor = scene.per_sphere('inertia_factor', trajectory.count)
    return factor * mass * scene.per_sphere('radius', trajectory.count) ** 2
