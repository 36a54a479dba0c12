# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a rollout asks of a model: one state after another, in the model's units."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from ..scenes.state import stacked, State


class Advance(NamedTuple):
    """States of consecutive steps.

    states: fields of shape (steps, n, k), only those before it diverged; error: why it did, or ''.
    """

    states: State
    error: str


class Stepper(ABC):
    """Advances a state in the model's units."""

    @abstractmethod
    def step(self) -> State:
        """State one step of the model later.

        Raises:
            FloatingPointError: The rollout diverged.
        """

    def advance(self, steps: int) -> Advance:
        """States of the next `steps` steps, at least one; those that `step` returns."""
        states, error = [], ''
        for _ in range(steps):
            try:
                states.append(self.step())
            except FloatingPointError as diverged:
                error = str(diverged)
                break
        return Advance(stacked(states), error)


def state_at(states: State, step: int) -> State:
    """State at one step of stacked states."""
    return State.unchecked(
        states.positions[step],
        states.quaternions[step],
        states.velocities[step],
        states.angular_velocities[step],
    )
