# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Result of a rollout: its trajectory, and why it ended early, if it did."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..scenes.state import State, Trajectory


class Outcome(NamedTuple):
    """A trajectory, NaN from where it diverged; `error` says why and where, or is ''."""

    trajectory: Trajectory
    error: str


class Recording:
    """Collects the states of a rollout, from its start.

    Args:
        start: State at step 0.
        dt: Time step [s].
        steps: Steps that are expected after it.
    """

    def __init__(self, start: State, dt: float, steps: int) -> None:
        self.dt = dt
        self.steps = steps
        self.done = 0
        self.error = ''
        self._arrays = {}
        for name, value in vars(start).items():
            self._arrays[name] = np.full((steps + 1, *value.shape), np.nan)
            self._arrays[name][0] = value

    def add(self, states: State, error: str) -> None:
        """Append stacked states, possibly none; `error` is why no more follow, or ''."""
        self.error = error
        if count := len(states):
            for name, values in vars(states).items():
                self._arrays[name][self.done + 1 : self.done + 1 + count] = values
            self.done += count

    @property
    def outcome(self) -> Outcome:
        """Trajectory so far, NaN in the steps that are missing."""
        where = f' (step {self.done + 1} of {self.steps})' if self.error else ''
        return Outcome(Trajectory(dt=self.dt, **self._arrays), self.error + where)
