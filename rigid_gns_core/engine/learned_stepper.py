# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rolls out the laws with a residual network: laws, springs, correction, guard, sleep."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .broad_phase import find_candidates
from .frame import advance
from .guard import limit_energy
from .islands import Islands
from .learned_contacts import (
    changes_by_laws,
    find_learned_contacts,
    LearnedContacts,
    no_learned_contacts,
)
from .learned_guard import limit_energy_of_soft, stores
from .learned_impulses import correct
from .learned_network import fade, LearnedNetwork, RangeCounts
from .motion import Settings
from .separation import separate
from .sleep import put_to_sleep, Sleepers
from .spheres import copy_spheres, is_finite, Spheres, store
from .springs import follow_springs, SPARE
from .stepper import EngineStepper
from .warm_start import WarmStart
from .world import World
from ..kernels.jit import compiled, entry
from ..kernels.neighbours import Flags
from ..rollout.stepper import Advance
from ..scenes.scene import Plane, Scene
from ..scenes.state import Array, State


class LearnedFrame(NamedTuple):
    """A frame: the laws' state at its end, the contacts of the network, and the corrected state.

    laws: with blows by springs, where the weights have them; warm_start: of the next frame; acted,
    removed: islands that the guard limited, and the energy that it took.
    """

    laws: Spheres
    contacts: LearnedContacts
    after: Spheres
    warm_start: WarmStart
    acted: int
    removed: float


@compiled
def _frame(
    world: World,
    network: LearnedNetwork,
    seen: Array,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    is_start: bool,
    stored_out: Array,
    range_out: Array,
    sleepers_out: Sleepers,
) -> LearnedFrame:
    if is_start:
        separate(world, dt, spheres.positions)
    after, warm_start, islands = advance(world, spheres, dt, warm_start, settings, sleepers_out)
    contacts, laws, acted, removed = no_learned_contacts(), after, 0, 0.0
    if network.strength[0] > 0 or network.springs[0] > 0:
        contacts, laws, acted, removed = _learned(
            world, network, seen, spheres, dt, guards, is_start, sleepers_out.asleep,
            stored_out, range_out, after, islands,
        )  # fmt: skip
    elif guards:
        acted, removed = limit_energy(world, spheres, islands, dt, after)
    if sleeps:
        put_to_sleep(world.radius[:-1], islands, dt, after, sleepers_out)
    return LearnedFrame(laws, contacts, after, warm_start, acted, removed)


@compiled
def _learned(
    world: World,
    network: LearnedNetwork,
    seen: Array,
    spheres: Spheres,
    dt: float,
    guards: bool,
    is_start: bool,
    asleep: Flags,
    stored_out: Array,
    range_out: Array,
    after_out: Spheres,
    islands_out: Islands,
) -> tuple[LearnedContacts, Spheres, int, float]:
    """Springs, network, and guard after a frame of the laws; as in `LearnedFrame`."""
    contacts, after, laws = no_learned_contacts(), after_out, after_out
    before = Spheres(
        positions=seen,
        quaternions=spheres.quaternions,
        velocities=spheres.velocities,
        angular_velocities=spheres.angular_velocities,
    )
    springs, stiffness = network.springs, float(network.stiffness[0])
    spare = SPARE if springs[0] > 0 else 0.0
    near = find_candidates(world, seen, before.velocities, dt, ~asleep, spare)
    if springs[0] > 0:
        kicks, _ = changes_by_laws(world, before, after, dt)
        follow_springs(world, springs, near, before, kicks, dt, asleep, after, islands_out)
    if network.strength[0] > 0:
        laws = copy_spheres(after)
        contacts = find_learned_contacts(world, near, before, after, dt, asleep, is_start)
        fade(network, contacts, range_out)
        correct(world, network, contacts, dt, after, islands_out)
    if is_start:  # nobody knows more of what its overlaps hold
        stored_out[:] = stores(world, seen, near, stiffness)
    acted, removed = 0, 0.0
    if guards:
        acted, removed = limit_energy_of_soft(
            world, spheres, islands_out, near, stiffness, dt, stored_out, after
        )
    return contacts, laws, acted, removed


@entry
def learned_frame(
    world: World,
    network: LearnedNetwork,
    seen: Array,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    is_start: bool,
    stored_out: Array,
    range_out: Array,
    sleepers_out: Sleepers,
) -> LearnedFrame:
    """One frame, with what the network saw, for its training.

    `seen` are the centres that the network sees: those before overlaps of a start were undone.
    """
    return _frame(
        world, network, seen, spheres, dt, warm_start, settings, guards, sleeps, is_start,
        stored_out, range_out, sleepers_out,
    )  # fmt: skip


@entry
def _advance_learned(
    world: World,
    network: LearnedNetwork,
    seen: Array,
    spheres: Spheres,
    dt: float,
    warm_start: WarmStart,
    settings: Settings,
    guards: bool,
    sleeps: bool,
    is_start: bool,
    stored_out: Array,
    range_out: Array,
    sleepers_out: Sleepers,
    frames_out: Spheres,
) -> tuple[int, WarmStart, int, float]:
    """As `stepper._advance`; `seen` as in `learned_frame`."""
    acted, removed = 0, 0.0
    for frame in range(len(frames_out.positions)):
        one = _frame(
            world, network, seen, spheres, dt, warm_start, settings, guards, sleeps,
            is_start and frame == 0, stored_out, range_out, sleepers_out,
        )  # fmt: skip
        warm_start, spheres = one.warm_start, one.after
        seen = spheres.positions
        if not is_finite(spheres):
            return frame, warm_start, acted, removed
        acted += one.acted
        removed += one.removed
        store(spheres, frame, frames_out)
    return len(frames_out.positions), warm_start, acted, removed


class LearnedStepper(EngineStepper):
    """Rolls out the laws with a residual network, in the model's units.

    Args:
        network: The weights.
        scene: Surfaces and sphere properties.
        state: Start.
        dt: Length of a frame.
        observed: Whether the start was observed, perhaps in the middle of a blow, or follows
            from an earlier frame.
        options: See `EngineStepper`.
    """

    def __init__(
        self,
        network: LearnedNetwork,
        scene: Scene,
        state: State,
        dt: float,
        *,
        observed: bool = True,
        **options: Any,
    ) -> None:
        super().__init__(scene, state, dt, **options)
        self.network, self.seen, self.observed = network, self.spheres.positions, observed
        self.stored, self._range = np.zeros(len(state)), np.zeros(len(RangeCounts._fields))

    @property
    def range_counts(self) -> RangeCounts:
        """How far the contacts of all frames so far were outside of the range of training."""
        return RangeCounts(*map(float, self._range))

    def advance(self, steps: int) -> Advance:
        """Advance by several dt; see `Stepper`."""
        self.seen = self.spheres.positions.copy()  # overlaps of a start are undone next
        return super().advance(steps)

    def frame(self) -> LearnedFrame:
        """Advance by dt, with what the network saw."""
        self.seen = self.spheres.positions.copy()
        one: LearnedFrame = learned_frame(**self._given)
        self.frames, self.spheres, self.warm_start = self.frames + 1, one.after, one.warm_start
        return one

    @property
    def _given(self) -> dict[str, Any]:
        return {
            'world': self.world,
            'network': self.network,
            'seen': self.seen,
            'spheres': self.spheres,
            'dt': self.dt,
            'warm_start': self.warm_start,
            'settings': self.settings,
            'guards': self.guards,
            'sleeps': self.sleeps,
            'is_start': self.frames == 0 and self.observed,
            'stored_out': self.stored,
            'range_out': self._range,
            'sleepers_out': self.sleepers,
        }

    def _advance(self, frames_out: Spheres) -> tuple[int, WarmStart, int, float]:
        return _advance_learned(**self._given, frames_out=frames_out)


def warm_up(network: LearnedNetwork) -> None:
    """Compile what is not compiled yet, or read it from the disk, before it is needed."""
    scene = Scene(surfaces=(Plane(),))
    start = State(positions=np.array([[0.0, 0.0, 1.2], [0.0, 0.5, 3.0]]))
    LearnedStepper(network, scene, start, 0.1, substeps=1, rounds=1).step()
