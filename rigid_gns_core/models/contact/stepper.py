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

"""Rolls a contact model out in the model's units: frames, rotations, energy guard, sleep."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
import torch

from .candidates import Candidates, find_candidates
from .guard import Guard
from .islands import Islands
from .memory import Memory
from .network import ContactNetwork
from .overlap import separate
from .sleep import Sleepers
from .step import frame, Motion
from .world import World
from ...gns.config import ContactConfig
from ...rollout.stepper import Stepper
from ...scenes.scene import Scene
from ...scenes.state import Array, rotate_quaternions, State


class ContactStepper(Stepper):
    """Rolls a contact model out in the model's units.

    Args:
        network: None: the law alone.
        config: K and M.
        scene: Surfaces and sphere properties.
        state: Start.
        dt: Length of a frame.
        guard: Hold the energy of every island down.
        sleep: Let islands at rest sleep.
        dtype: Of the arithmetic of contacts; states are kept in float64.
    """

    def __init__(
        self,
        network: ContactNetwork | None,
        config: ContactConfig,
        scene: Scene,
        state: State,
        dt: float,
        *,
        guard: bool = True,
        sleep: bool = True,
        dtype: torch.dtype = torch.float64,
    ) -> None:
        self.network, self.config, self.scene, self.dt = network, config, scene, dt
        self.state, self.dtype = state, dtype
        self.world = World.of(scene, len(state), dtype)
        self.radius = scene.per_sphere('radius', len(state))
        self.gravity = np.asarray(scene.gravity)
        self.guard = Guard(scene, len(state), dt) if guard else None
        weight = float(np.linalg.norm(self.gravity))
        self.sleepers = Sleepers(self.radius, weight, dt) if sleep else None
        self.memory: Memory | None = None
        self._begun = False

    @torch.inference_mode()
    def step(self) -> State:
        """Advance by dt.

        Raises:
            FloatingPointError: A value is not finite.
        """
        before = self.state if self._begun else self._separated(self.state)
        self._begun = True
        awake = np.ones(len(before), dtype=bool)
        if self.sleepers is not None:
            awake = self.sleepers.wake(
                lambda flags: self._candidates(before.positions, before.velocities, flags)
            )
        after, islands = self._advance(before, awake)
        if self.guard is not None:
            after = self.guard.hold(before, after, islands)
        if self.sleepers is not None:
            after = self.sleepers.settle(after, islands)
        self.state = after
        return after

    def _candidates(
        self,
        positions: Array,
        velocities: Array,
        awake: NDArray[np.bool_],
        before: Array | None = None,
    ) -> Candidates:
        scene, radius = self.scene, self.radius
        return find_candidates(
            positions, velocities, radius, scene.surfaces, self.gravity, self.dt, awake, before
        )

    def _separated(self, state: State) -> State:
        """Return the start without overlaps."""
        everyone = np.ones(len(state), dtype=bool)

        def neighbours(p: torch.Tensor, v: torch.Tensor) -> Candidates:
            return self._candidates(p.numpy(), v.numpy(), everyone)

        world = World.of(self.scene, len(state))
        positions = separate(world, torch.from_numpy(state.positions.copy()), neighbours)
        return replace(state, positions=positions.numpy())

    def _advance(self, before: State, awake: NDArray[np.bool_]) -> tuple[State, Islands]:
        count, dt = len(before), self.dt
        moving = awake[:, None]
        positions = before.positions + moving * (
            dt * before.velocities + 0.5 * dt**2 * self.gravity
        )
        velocities = before.velocities + moving * (dt * self.gravity)
        angular = before.angular_velocities
        result = None
        candidates = self._candidates(before.positions, before.velocities, awake)
        if len(candidates):
            known = [candidates]

            def neighbours(p: torch.Tensor, v: torch.Tensor) -> Candidates:
                if known:
                    return known.pop()
                place, speed = (values.numpy().astype(np.float64) for values in (p, v))
                return self._candidates(place, speed, awake, before.positions)

            p, v, w, a = (
                torch.from_numpy(np.asarray(values, dtype=np.float64)).to(self.dtype)
                for values in (before.positions, before.velocities, angular, moving)
            )
            start = Motion(p, v, w, a)
            result = frame(
                self.world,
                start,
                neighbours,
                dt,
                self.memory,
                self.config.substeps,
                self.config.rounds,
                self.network,
            )
        contacts = result.contacts if result else []
        islands = Islands.of(contacts, count)
        touched = islands.touched
        turns = np.broadcast_to(dt * angular, (1, count, 3))
        if result:
            # spheres without contact keep their exact parabolas
            end = result.motion
            positions[touched] = end.positions.numpy()[touched]
            velocities[touched] = end.velocities.numpy()[touched]
            angular = np.where(touched[:, None], end.angular_velocities.numpy(), angular)
            turns = result.turns.numpy()
        if not (np.isfinite(positions).all() and np.isfinite(velocities).all()):
            raise FloatingPointError('the rollout diverged: a predicted value is not finite')
        self.memory = self._remember(result.memory if result else None, awake)
        quaternions = before.quaternions
        for turn in turns:
            if turn.any():
                quaternions = rotate_quaternions(quaternions, np.asarray(turn, dtype=np.float64))
        after = State(
            positions=positions,
            quaternions=quaternions,
            velocities=velocities,
            angular_velocities=angular,
        )
        return after, islands

    def _remember(self, memory: Memory | None, awake: NDArray[np.bool_]) -> Memory:
        """Impulses of this frame, and those of sleepers from the frame they fell asleep in."""
        new = Memory.empty(self.world.gravity) if memory is None else memory
        if awake.all() or self.memory is None:
            return new
        bodies = self.world.count + len(self.world.point)
        kept = torch.from_numpy(~awake)[self.memory.key // bodies]
        old = self.memory.take(kept)
        return Memory.of([(new.key, new.impulses), (old.key, old.impulses)])
