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

"""Islands at rest sleep: they cost nothing and do not creep. What may touch them wakes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .candidates import Candidates
from .islands import Islands
from ...scenes.state import Array, State

Flags = NDArray[np.bool_]

# a sphere is quiet below this speed [sqrt(g r)], also at its surface ..
_SPEED = 1.6e-3
# .. for so many frames, in which it ends within this part of what it could go at that speed
_FRAMES = 5
_DRIFT = 0.2


class Sleepers:
    """Which spheres sleep.

    Args:
        radius: Radii, shape (n,).
        gravity: Size of gravity; 0: nothing sleeps.
        dt: Length of a frame.
    """

    def __init__(self, radius: Array, gravity: float, dt: float) -> None:
        self.radius = radius
        self.limit = _SPEED * np.sqrt(gravity * radius)
        self.drift = _DRIFT * self.limit * _FRAMES * dt
        self.asleep: Flags = np.zeros(len(radius), dtype=bool)
        self.island = np.full(len(radius), -1)
        self._next_island = 0
        self._quiet = np.zeros(len(radius), dtype=np.int64)
        self._place = np.zeros((len(radius), 3))

    def wake(self, candidates: Callable[[Flags], Candidates]) -> Flags:
        """Spheres awake in the frame to come, shape (n,).

        A sleeper wakes with all its island where a sphere that is awake might touch it.
        """
        while self.asleep.any():
            awake = ~self.asleep
            if not awake.any():
                break
            found = candidates(awake)
            pairs = np.concatenate([found.first, found.second])
            touched = np.unique(self.island[pairs[self.asleep[pairs]]])
            if not len(touched):
                break
            self.asleep &= ~np.isin(self.island, touched)
        return ~self.asleep

    def settle(self, state: State, islands: Islands) -> State:
        """Put islands to sleep that have been quiet; they get no velocity."""
        fastest = np.maximum(
            np.linalg.norm(state.velocities, axis=1),
            self.radius * np.linalg.norm(state.angular_velocities, axis=1),
        )
        quiet = fastest < self.limit
        begins = quiet & (self._quiet == 0)
        self._place[begins] = state.positions[begins]
        self._quiet = np.where(quiet, self._quiet + 1, 0)
        long = self._quiet > _FRAMES
        stays = np.linalg.norm(state.positions - self._place, axis=1) < self.drift
        self._quiet[long & ~stays] = 0
        ready = islands.all((long & stays & islands.touched) | self.asleep) & islands.grounded
        falls_asleep = ready[islands.label] & ~self.asleep
        if not falls_asleep.any():
            return state
        self.asleep |= falls_asleep
        self.island[falls_asleep] = self._next_island + islands.label[falls_asleep]
        self._next_island += islands.count
        still = ~falls_asleep[:, None]
        return replace(
            state,
            velocities=state.velocities * still,
            angular_velocities=state.angular_velocities * still,
        )
