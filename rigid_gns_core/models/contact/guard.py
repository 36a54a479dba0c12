"""Energy guard: in no frame does the energy of an island rise, whatever the weights.

Energy is that of translation, rotation and height. The guard acts after the network, and reports
how often it had to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...scene import Scene
from ...state import Array, State
from .islands import Islands

# rises below this share of the island's energy are rounding
_ROUNDING = 1e-13


class Guard:
    """Holds the energy of islands down.

    Args:
        scene: Masses, radii, gravity.
        count: Number of spheres n.
    """

    def __init__(self, scene: Scene, count: int) -> None:
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

        An island in the air loses what it has too much from its inner motion: its linear and
        angular momentum, and thus its ballistic flight, stay. One that touches a surface loses
        speed; where that is not enough, because it was lifted, it stays where it was.

        Args:
            before: State at the frame's start.
            after: State at its end.
            islands: Of the frame's contacts.
        """
        self.frames += 1
        kinetic, height = self.energy(after)
        kinetic_before, height_before = self.energy(before)
        gain = islands.sum(kinetic + height - kinetic_before - height_before)
        size = islands.sum(kinetic + kinetic_before + np.abs(height - height_before))
        touched = np.zeros(islands.count, dtype=bool)
        touched[islands.label[islands.touched]] = True
        rising = np.flatnonzero(touched & (gain > _ROUNDING * size))
        if not len(rising):
            return after
        self.acted += len(rising)
        self.removed += float(gain[rising].sum())
        p, v, w = (after.positions.copy(), after.velocities.copy(), after.angular_velocities.copy())
        for island in rising:
            members = np.flatnonzero(islands.label == island)
            if not islands.grounded[island]:
                v[members], w[members] = self._calmed(
                    p[members], v[members], w[members], members, gain[island]
                )
                continue
            moving = kinetic[members].sum()
            v[members] *= np.sqrt(max(0.0, 1.0 - gain[island] / max(moving, 1e-300)))
            w[members] *= np.sqrt(max(0.0, 1.0 - gain[island] / max(moving, 1e-300)))
            if gain[island] > moving:
                p[members] = before.positions[members]
        return replace(after, positions=p, velocities=v, angular_velocities=w)

    def _calmed(
        self, p: Array, v: Array, w: Array, members: NDArray[np.int64], gain: float
    ) -> tuple[Array, Array]:
        """Velocities with `gain` [J] less in motion beyond that of one rigid body."""
        mass, inertia = self.mass[members], self.inertia[members]
        total = mass.sum()
        mean = mass @ v / total
        arm = p - mass @ p / total
        spin = (np.cross(arm, v - mean) * mass[:, None] + inertia[:, None] * w).sum(0)
        tensor = np.einsum('i,ij,ik->jk', mass, arm, arm)
        tensor = (np.trace(tensor) + inertia.sum()) * np.eye(3) - tensor
        turn = np.linalg.solve(tensor, spin)
        rigid = mean + np.cross(turn, arm)
        inner_v, inner_w = v - rigid, w - turn
        inner = 0.5 * (mass @ (inner_v**2).sum(1) + inertia @ (inner_w**2).sum(1))
        keep = np.sqrt(max(0.0, 1.0 - gain / max(inner, 1e-300)))
        return rigid + keep * inner_v, turn + keep * inner_w
