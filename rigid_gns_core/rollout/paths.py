# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Paths of rollouts between their steps: cubics, and two flights where a blow is in between."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..scenes.air import Air
from ..scenes.scene import Scene
from ..scenes.state import Array, State

if TYPE_CHECKING:
    from ..kernels.between_steps import Steps

_VACUUM = Air(density=0.0, drag_coefficient=0.0)


@dataclass(frozen=True)
class Paths:
    """Rollouts of one scene, and what is between their steps.

    Between two steps a cubic goes through both positions and velocities. Where the velocity
    changes more than in free flight there is a blow: the flight before it is continued, then the
    flight after it, from where they come nearest to each other.

    Args:
        positions: Centres at the steps [m], shape (s, steps + 1, n, 3).
        velocities: Of the instant [m/s], likewise.
        flights: Accelerations that free flight has at the steps [m/s^2], likewise.
        blows: Changes of velocity by blows in the steps [m/s], 0 where there is none, shape
            (s, steps, n, 3).
        dt: Time step [s].
        exact: Whether velocities are those of the instant; if not, paths are straight lines
            between steps, without blows.
    """

    positions: Array
    velocities: Array
    flights: Array
    blows: Array
    dt: float
    exact: bool

    @classmethod
    def of(cls, scene: Scene, states: State, dt: float, *, exact: bool) -> Paths:
        """Paths of rollouts, fields of shape (s, steps + 1, n, k); NaN from a divergence on."""
        positions, velocities = _plain(states.positions), _plain(states.velocities)
        samples, frames, count = positions.shape[:3]
        blows, flights = np.zeros((samples, frames - 1, count, 3)), np.zeros(positions.shape)
        if exact and count:
            # imported late: what only loads a model needs no compiler
            from ..kernels.between_steps import find_blows

            rows, weight = _flight(scene, count)
            spins = _plain(states.angular_velocities)
            find_blows(velocities, spins, rows, weight, dt, flights, blows)
        return cls(positions, velocities, flights, blows, dt, exact)

    @property
    def steps(self) -> int:
        """Number of steps."""
        return int(self.positions.shape[1]) - 1

    def part(self, chosen: slice) -> Paths:
        """Some of the rollouts."""
        names = ('positions', 'velocities', 'flights', 'blows')
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def moved(self, positions: Array, velocities: Array) -> Paths:
        """Paths with another motion added, shapes (s, steps + 1, n, 3)."""
        return replace(
            self, positions=self.positions + positions, velocities=self.velocities + velocities
        )

    def at(self, times: Array) -> tuple[Array, Array]:
        """Positions [m] and velocities [m/s] at times since the start [s], shapes (s, k, n, 3).

        Times are up to the last step, shape (k,).
        """
        nearest = np.rint(times / self.dt).astype(int)
        if (np.abs(times - nearest * self.dt) < 1e-9 * self.dt).all():
            return self.positions[:, nearest], self.velocities[:, nearest]
        from ..kernels.between_steps import find_states

        shape = len(self.positions), len(times), *self.positions.shape[2:]
        places, speeds = np.empty(shape), np.empty(shape)
        find_states(self.compiled, _plain(times), places, speeds)
        return places, speeds

    @cached_property
    def compiled(self) -> Steps:
        """As compiled code takes them."""
        from ..kernels.between_steps import Steps

        fields = self.positions, self.velocities, self.flights, self.blows
        return Steps(*fields, self.dt, self.exact)


@lru_cache(maxsize=64)
def _flight(scene: Scene, count: int) -> tuple[Array, float]:
    """Parameters of flight of the spheres, shape (n, 15), and gravity's size [m/s^2]."""
    radii, masses = scene.per_sphere('radius', count), scene.per_sphere('mass', count)
    rows = (scene.air or _VACUUM).flight(radii, masses, scene.gravity)
    return _plain(rows), float(np.linalg.norm(scene.gravity))


def _plain(values: Array) -> Array:
    """Array in the one layout that compiled code takes."""
    return np.require(values, np.float64, ['C', 'W'])
