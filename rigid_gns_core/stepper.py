"""What a rollout asks of a model: states one after the other, in the model's units."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .state import State


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
        """The state one model step later.

        Raises:
            FloatingPointError: The rollout diverged.
        """

    def advance(self, steps: int) -> Advance:
        """The states of the next `steps` steps, at least one; the same as `step` gives."""
        states, error = [], ''
        for _ in range(steps):
            try:
                states.append(self.step())
            except FloatingPointError as diverged:
                error = str(diverged)
                break
        return Advance(stacked(states), error)


def stacked(states: Sequence[State]) -> State:
    """States one after the other as one: fields of shape (steps, n, k), of none (0, 0, k)."""
    if not states:
        return State.unchecked(*(np.zeros((0, 0, k)) for k in (3, 4, 3, 3)))
    names = ('positions', 'quaternions', 'velocities', 'angular_velocities')
    return State.unchecked(*(np.stack([getattr(s, name) for s in states]) for name in names))


def state_at(states: State, step: int) -> State:
    """One of states that are stacked."""
    return State.unchecked(
        states.positions[step],
        states.quaternions[step],
        states.velocities[step],
        states.angular_velocities[step],
    )
