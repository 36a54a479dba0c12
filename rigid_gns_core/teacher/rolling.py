# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rolling friction of spheres on surfaces, the same in every direction.

Bullet limits the torque along two fixed axes of a surface, so a sphere that rolls diagonally is
slowed by the square root of 2 too much and its path bends. Here the torque rho r N opposes the
rotation itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ..scenes.scene import Scene
from ..scenes.state import Array


@dataclass(frozen=True)
class Rolling:
    """Motion after rolling friction.

    Args:
        velocities: Linear velocities [m/s], shape (n, 3).
        angular_velocities: Angular velocities [rad/s], shape (n, 3).
        stopped: Spheres whose rolling came to an end, shape (n,).
    """

    velocities: Array
    angular_velocities: Array
    stopped: NDArray[np.bool_]


def resist_rolling(
    velocities: Array,
    angular_velocities: Array,
    radius: Array,
    normal: Array,
    impulse: Array,
    rolling_friction: Array,
    friction: Array,
    inertia: Array,
    slip_tolerance: float,
) -> Rolling:
    """Apply the rolling friction of one normal impulse on a surface to each sphere.

    The torque impulse rho r J opposes the rotation about axes in the surface, and another of that
    size the rotation about the normal; neither reverses it. A sphere that rolls without slip keeps
    doing so by static friction F. With I = i m r^2, and r dw = dv where it rolls:

        dv = -F / m,  r dw = -(rho J - F) / (i m),  F = min(rho / (1 + i), mu) J.

    Args:
        velocities: Linear velocities [m/s], shape (n, 3).
        angular_velocities: Angular velocities [rad/s], shape (n, 3).
        radius: Radii [m], shape (n,).
        normal: Unit normals of the surface at each sphere, shape (n, 3).
        impulse: Normal impulses per mass J / m [m/s], shape (n,).
        rolling_friction: rho, shape (n,).
        friction: mu of sphere and surface, shape (n,).
        inertia: i, shape (n,).
        slip_tolerance: Slip that counts as none [m/s], beside a thousandth of the rolling speed.
    """
    spin = np.sum(angular_velocities * normal, axis=-1, keepdims=True) * normal
    turn = angular_velocities - spin
    rolling = radius * np.linalg.norm(turn, axis=-1)
    # velocity that the centre has where the sphere rolls without slip
    rolled = radius[:, None] * np.cross(turn, normal)
    across = velocities - np.sum(velocities * normal, axis=-1, keepdims=True) * normal
    slip = np.linalg.norm(across - rolled, axis=-1)
    sticks = slip <= slip_tolerance + 1e-3 * rolling

    torque = rolling_friction * impulse / inertia  # change of r w
    holds = np.minimum(rolling_friction / (1.0 + inertia), friction)
    static = np.where(sticks, holds * impulse, 0.0)
    slowed = torque - static / inertia
    part = np.minimum(1.0, slowed / np.maximum(rolling, 1e-300))[:, None]
    spinning = radius * np.linalg.norm(spin, axis=-1)
    spin_part = np.minimum(1.0, torque / np.maximum(spinning, 1e-300))[:, None]
    # static friction takes the centre along by as much as r w loses, or less on a slippery surface
    along = np.minimum(static, rolling) / np.maximum(rolling, 1e-300)
    return Rolling(
        velocities=velocities - along[:, None] * rolled,
        angular_velocities=angular_velocities - part * turn - spin_part * spin,
        stopped=sticks & (part[:, 0] >= 1.0),
    )


class RollingFriction:
    """Rolling friction in a Bullet world whose first bodies are those of `scene` that are fixed.

    Spheres at rest are held by Bullet's own rolling friction, since updates at intervals cannot
    hold them. They are released once they roll, and before an impact, because Bullet's own acts
    between spheres too.

    Args:
        bullet: The pybullet module.
        client: Bullet's physics client.
        bodies: Bullet's numbers of the spheres, in order; may be filled later.
        scene: Surfaces and materials.
        radius: Radii in Bullet's units, shape (n,).
        mass: Masses in Bullet's units, shape (n,).
        substep: Time of one step of Bullet [s].
        gravity: Gravity in Bullet's units, shape (3,).
    """

    def __init__(
        self,
        bullet: ModuleType,
        client: int,
        bodies: list[int],
        scene: Scene,
        radius: Array,
        mass: Array,
        substep: float,
        gravity: Array,
    ) -> None:
        count = len(radius)
        self._bullet, self._client, self._bodies = bullet, client, bodies
        self._surfaces = len(scene.fixed_materials)
        self._radius, self._mass, self._substep = radius, mass, substep
        self._friction = scene.per_sphere('friction', count)
        self._inertia = scene.per_sphere('inertia_factor', count)
        self._surface_friction = scene.values_of('friction', scene.fixed_materials)
        fall = float(np.linalg.norm(gravity)) * substep
        self._slip_tolerance = 1e-3 * fall
        self._blow = 10.0 * fall
        self._held = np.zeros(count, dtype=bool)
        self._forces: dict[tuple[int, int], float] = {}
        self._normals: dict[tuple[int, int], tuple[float, float, float]] = {}
        self.rho = scene.per_sphere('rolling_friction', count)
        # Bullet's torque is (rolling_sphere * friction_surface) N; a sphere has one value for all
        surface = float(self._surface_friction.mean()) if self._surfaces else 0.0
        self.bullets_own = self.rho * radius / (surface or np.inf)

    def let_go(self, time: float) -> None:
        """Release spheres at rest that may be struck within `time` [s], or whose island may be."""
        held = np.flatnonzero(self._held)
        if not len(held):
            return
        bullet, client, bodies = self._bullet, self._client, self._bodies
        velocities = [bullet.getBaseVelocity(body, physicsClientId=client)[0] for body in bodies]
        way = np.linalg.norm(velocities, axis=-1)
        way = np.where(self._held | (way < self._blow), 0.0, way) * time
        if not way.any():
            return
        centres = np.array(
            [
                bullet.getBasePositionAndOrientation(body, physicsClientId=client)[0]
                for body in bodies
            ]
        )
        # a blow is passed on to neighbours at rest that are nearer than its path
        tree = cKDTree(centres)
        reach = np.minimum(way.max(), self._radius.max())
        pairs = tree.query_pairs(2.0 * self._radius.max() + way.max(), output_type='ndarray')
        a, b = pairs[:, 0], pairs[:, 1]
        gap = np.linalg.norm(centres[a] - centres[b], axis=-1)
        gap -= self._radius[a] + self._radius[b]
        both = self._held[a] & self._held[b]
        near = gap <= np.where(both, reach, way[a] + way[b])
        graph = coo_array((np.ones(near.sum()), (a[near], b[near])), shape=2 * (len(bodies),))
        _, island = connected_components(graph, directed=False)
        struck = held[np.isin(island[held], island[way > 0])]
        self._hold(struck, np.zeros(len(struck), dtype=bool))

    def collect(self) -> None:
        """Add the normal forces of surfaces on spheres in the last substep."""
        forces, surfaces = self._forces, self._surfaces
        for contact in self._bullet.getContactPoints(physicsClientId=self._client) or ():
            # contact: .., body A, body B, .., normal on B towards A, distance, normal force, ..
            force = contact[9]
            # a contact that has opened still shows the force that it had last
            if force > 0.0 >= contact[8] and (contact[1] < surfaces or contact[2] < surfaces):
                pair = contact[1], contact[2]
                forces[pair] = forces.get(pair, 0.0) + force
                self._normals[pair] = contact[7]

    def resist(self) -> None:
        """Apply the rolling friction of all impulses since the last call."""
        by_surface: dict[int, list[tuple[int, float, tuple[float, float, float]]]] = {}
        for (a, b), force in self._forces.items():
            x, y, z = self._normals[a, b]
            if b < self._surfaces:
                by_surface.setdefault(b, []).append((a - self._surfaces, force, (x, y, z)))
            else:
                by_surface.setdefault(a, []).append((b - self._surfaces, force, (-x, -y, -z)))
        self._forces.clear()
        for surface, contacts in by_surface.items():
            numbers, forces, normals = zip(*contacts, strict=True)
            spheres = np.array(numbers)
            impulse = np.array(forces) * self._substep / self._mass[spheres]
            self._resist_on(surface, spheres, impulse, np.array(normals))

    def _resist_on(
        self, surface: int, spheres: NDArray[np.intp], impulse: Array, normals: Array
    ) -> None:
        bullet, client = self._bullet, self._client
        velocities = np.array(
            [bullet.getBaseVelocity(self._bodies[i], physicsClientId=client) for i in spheres]
        )
        rho = self.rho[spheres]
        left = resist_rolling(
            velocities[:, 0],
            velocities[:, 1],
            self._radius[spheres],
            normals,
            impulse,
            rho,
            self._friction[spheres] * self._surface_friction[surface],
            self._inertia[spheres],
            self._slip_tolerance,
        )
        # held until it rolls faster than two updates could stop
        speed = self._radius[spheres] * np.linalg.norm(velocities[:, 1], axis=-1)
        held = self._held[spheres] & (speed <= 5.0 * rho * impulse)
        self._hold(spheres, held | left.stopped)
        for k in np.flatnonzero(~held):
            bullet.resetBaseVelocity(
                self._bodies[spheres[k]],
                left.velocities[k].tolist(),
                left.angular_velocities[k].tolist(),
                physicsClientId=client,
            )

    def _hold(self, spheres: NDArray[np.intp], hold: NDArray[np.bool_]) -> None:
        for sphere in spheres[hold != self._held[spheres]]:
            friction = 0.0 if self._held[sphere] else float(self.bullets_own[sphere])
            self._bullet.changeDynamics(
                self._bodies[sphere],
                -1,
                rollingFriction=friction,
                spinningFriction=friction,
                physicsClientId=self._client,
            )
        self._held[spheres] = hold
