# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulation in progress, in the units of the world."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import time

import numpy as np

from .outcome import Outcome, Recording
from .stepper import Advance, state_at, Stepper
from ..scenes.similarity import Similarity
from ..scenes.state import State

# time that a block of steps takes [s]: Ctrl-C is heard between blocks
_BLOCK = 0.1


class Rollout:
    """A simulation in progress: `state` is the present one, `step` advances it by `dt` [s].

    `stepper` is that of the model, in its units; `done`, where it is set, is called with the
    number of steps after each advance.
    """

    def __init__(self, stepper: Stepper, similarity: Similarity, state: State, dt: float) -> None:
        self.stepper = stepper
        self.similarity = similarity
        self.state = state
        self.dt = dt
        self.steps = 0
        self.done: Callable[[int], object] | None = None

    def step(self) -> State:
        """Advance by `dt` and return the new state.

        `Simulator.velocities` says what its velocities are.

        Raises:
            FloatingPointError: The rollout diverged; `state` is the last finite one.
        """
        state = self.similarity.to_world(self.stepper.step())
        self._moved(state, 1)
        return state

    def advance(self, steps: int) -> Advance:
        """Advance by several dt at once, or to where it diverges; the same states as by `step`."""
        states, error = self.stepper.advance(steps)
        if len(states):
            states = self.similarity.to_world(states)
            self._moved(state_at(states, -1), len(states))
        return Advance(states, error)

    def _moved(self, state: State, steps: int) -> None:
        self.state = state
        self.steps += steps
        if self.done is not None:
            self.done(steps)

    def blocks(self, steps: int, seconds: float, first: int = 1) -> Iterator[Advance]:
        """Advance by `steps` dt, or to where it diverges, in blocks of about `seconds` each.

        For callers that have something to do at times, but not after every step. `first` steps are
        known to take less.
        """
        block, left, error = first, steps, ''
        while left and not error:
            begun = time.perf_counter()
            states, error = self.advance(min(block, left))
            spent = time.perf_counter() - begun
            if spent < seconds / 8:
                block *= 8
            elif spent < seconds / 2:
                block *= 2
            elif spent > 2 * seconds:  # a flight has ended in a pile
                block = max(1, block // 2)
            left -= len(states)
            yield Advance(states, error)

    def run(self, steps: int) -> Outcome:
        """Advance `steps` times, or to where it diverges."""
        recording = Recording(self.state, self.dt, steps)
        for states, error in self.blocks(steps, _BLOCK):
            recording.add(states, error)
        return recording.outcome


def steps_of(horizon: float, dt: float) -> int:
    """Least number of model steps of `dt` [s] that reach `horizon` [s]."""
    return int(np.ceil(horizon / dt - 1e-9))
