# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A prediction beside its reference, of a record or a bag: what a report shows."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import UserError
from ..scenes.scene import Scene
from ..scenes.state import Array, Trajectory
from ..scoring import divergence
from ..scoring.error import check_comparable


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A prediction and what it is compared with.

    Args:
        title: What it is.
        scene: Surfaces and spheres of all trajectories.
        predicted: The prediction.
        reference: The reference, as long as the prediction; None where there is none.
        names: What to call the two.
        evaluation: What `scoring.evaluate.evaluate` returns, or its laws alone; of a bag
            with its counts and times.
        floors: Other simulations of the reference's start, by name: how far the teacher gets from
            itself.
        recording: Of a bag: times since the first prediction [s], shape (m,), and by name what was
            measured at them [ms], shape (m,).
        lost: Step from which a trajectory diverged, so that all were cut there; None: none did.
    """

    title: str
    scene: Scene
    predicted: Trajectory
    reference: Trajectory | None = None
    names: tuple[str, str] = ('predicted', 'reference')
    evaluation: dict[str, Any] = field(default_factory=dict)
    floors: dict[str, Trajectory] = field(default_factory=dict)
    recording: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    lost: int | None = None

    @property
    def sides(self) -> dict[str, Trajectory]:
        """Trajectories by their names, the prediction first."""
        sides = {self.names[0]: self.predicted}
        if self.reference is not None:
            sides[self.names[1]] = self.reference
        return sides

    def window(self, start: int, stop: int) -> Comparison:
        """Return steps `start` to `stop`, `stop` not included; numbers stay those of the whole."""
        return replace(
            self,
            predicted=self.predicted.window(start, stop),
            reference=None if self.reference is None else self.reference.window(start, stop),
            floors={name: floor.window(start, stop) for name, floor in self.floors.items()},
        )


def cut(comparison: Comparison) -> Comparison:
    """Only the part that all trajectories have, before any of them diverges.

    Raises:
        UserError: They differ in time step or spheres, or one diverges at its start.
    """
    everything = {**comparison.sides, **comparison.floors}
    end = min(map(len, everything.values()))
    comparison = comparison.window(0, end)
    everything = {**comparison.sides, **comparison.floors}
    for name, trajectory in everything.items():
        try:
            check_comparable(trajectory, comparison.predicted)
        except UserError as error:
            raise UserError(f'{name}: {error}') from error
    steps = [divergence(trajectory, comparison.scene) for trajectory in everything.values()]
    lost = min((step for step in steps if step is not None), default=None)
    if lost is None:
        return comparison
    if lost == 0:
        raise UserError('a trajectory diverges at its start, so there is nothing to show')
    return replace(comparison.window(0, lost), lost=lost)


def position_errors(predicted: Trajectory, reference: Trajectory) -> Array:
    """Distance of each sphere from its reference [m], shape (steps + 1, n)."""
    distances: Array = np.linalg.norm(predicted.positions - reference.positions, axis=2)
    return distances
