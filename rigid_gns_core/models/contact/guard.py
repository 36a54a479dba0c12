# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Energy guard: in no frame does the energy of an island rise, whatever the weights.

Energy is that of translation, rotation and height. The guard acts after the network, and reports
how often it had to.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .islands import Islands
from ...scenes.scene import Scene
from ...scenes.state import Array, State

# rises below this share of the island's energy are rounding
_ROUNDING = 1e-13


class Guard:
    """Holds the energy of islands down.

    Args:
        scene: Masses, radii, gravity.
        count: Number of spheres n.
        dt: Length of a frame.
    """

    def __init__(self, scene: Scene, count: int, dt: float) -> None:
        self.dt = dt
        self.mass = scene.per_sphere('mass', count)
        self.inertia = 0.4 * self.mass * scene.per_sphere('radius', count) ** 2
        self.gravity = np.asarray(scene.gravity)
        self.frames = 0
        self.acted = 0
        self.removed = 0.0

    def energy(self, state: State) -> tuple[Array, Array]:
        """Kinetic and potential energy of each sphere [J], shape (n,) each."""
        kinetic = 0.5 * self.mass * np.sum(state.velocities**2, axis=1)
        kinetic += 0.5 * self.inertia * np.sum(state.angular_velocities**2, axis=1)
        return kinetic, -self.mass * (state.positions @ self.gravity)

    def hold(self, before: State, after: State, islands: Islands) -> State:
        """State after a frame, with the energy of no island above what it was.

        An island in the air gets the linear and angular momentum of its ballistic flight, and
        loses what energy it has too much from its inner motion, so that they stay. One that
        touches a surface loses speed; where that is not enough, because it was lifted, it stays
        where it was.

        Args:
            before: State at the frame's start.
            after: State at its end.
            islands: Of the frame's contacts.
        """
        self.frames += 1
        touched = np.zeros(islands.count, dtype=bool)
        touched[islands.label[islands.touched]] = True
        p, v, w = (
            after.positions.copy(),
            after.velocities.copy(),
            after.angular_velocities.copy(),
        )
        for island in np.flatnonzero(touched & ~islands.grounded):
            members = np.flatnonzero(islands.label == island)
            v[members], w[members] = self._with_momenta(before, after, members)
        after = replace(after, velocities=v.copy(), angular_velocities=w.copy())
        kinetic, height = self.energy(after)
        kinetic_before, height_before = self.energy(before)
        gain = islands.sum(kinetic + height - kinetic_before - height_before)
        size = islands.sum(kinetic + kinetic_before + np.abs(height - height_before))
        rising = np.flatnonzero(touched & (gain > _ROUNDING * size))
        self.acted += len(rising)
        self.removed += float(gain[rising].sum())
        for island in rising:
            members = np.flatnonzero(islands.label == island)
            if not islands.grounded[island]:
                own = _Rigid.of(
                    self.mass[members], self.inertia[members], p[members], v[members], w[members]
                )
                v[members], w[members] = own.calmed(v[members], w[members], gain[island])
                continue
            moving = kinetic[members].sum()
            slower = np.sqrt(max(0.0, 1.0 - gain[island] / max(moving, 1e-300)))
            v[members] *= slower
            w[members] *= slower
            if gain[island] > moving:
                p[members] = before.positions[members]
        return replace(after, positions=p, velocities=v, angular_velocities=w)

    def _with_momenta(
        self, before: State, after: State, members: NDArray[np.int64]
    ) -> tuple[Array, Array]:
        """Velocities of a free island with the momenta it must have.

        Impulses at different times within a frame, and push-out, keep the linear momentum but
        leave the angular one to a few per cent of what they exchange.
        """
        mass, inertia = self.mass[members], self.inertia[members]
        rigid = [
            _Rigid.of(
                mass,
                inertia,
                state.positions[members],
                state.velocities[members],
                state.angular_velocities[members],
            )
            for state in (before, after)
        ]
        turn = np.linalg.solve(rigid[1].tensor, rigid[0].spin - rigid[1].spin)
        push = rigid[0].mean + self.gravity * self.dt - rigid[1].mean
        v = after.velocities[members] + push + np.cross(turn, rigid[1].arm)
        return v, after.angular_velocities[members] + turn


@dataclass(frozen=True)
class _Rigid:
    """An island as one body.

    mass, inertia: of its spheres, shape (m,); mean: velocity of the centre of mass, shape (3,);
    arm: places about it, shape (m, 3); spin: angular momentum about it, shape (3,); tensor: of
    inertia, shape (3, 3).
    """

    mass: Array
    inertia: Array
    mean: Array
    arm: Array
    spin: Array
    tensor: Array

    @classmethod
    def of(cls, mass: Array, inertia: Array, p: Array, v: Array, w: Array) -> _Rigid:
        """Of the spheres of an island; places, velocities and spins have shape (m, 3)."""
        mean = mass @ v / mass.sum()
        arm = p - mass @ p / mass.sum()
        spin = (np.cross(arm, v - mean) * mass[:, None] + inertia[:, None] * w).sum(0)
        tensor = np.einsum('i,ij,ik->jk', mass, arm, arm)
        tensor = (np.trace(tensor) + inertia.sum()) * np.eye(3) - tensor
        return cls(mass, inertia, mean, arm, spin, tensor)

    def calmed(self, v: Array, w: Array, gain: float) -> tuple[Array, Array]:
        """Velocities with `gain` [J] less in motion beyond a rigid body's, shape (m, 3)."""
        turn = np.linalg.solve(self.tensor, self.spin)
        rigid = self.mean + np.cross(turn, self.arm)
        inner_v, inner_w = v - rigid, w - turn
        inner = 0.5 * (self.mass @ (inner_v**2).sum(1) + self.inertia @ (inner_w**2).sum(1))
        keep = np.sqrt(max(0.0, 1.0 - gain / max(inner, 1e-300)))
        return rigid + keep * inner_v, turn + keep * inner_w
