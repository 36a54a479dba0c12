# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Comparison of a prediction and its reference, from records or a bag."""

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
    """A prediction and its reference.

    Args:
        title: Headline.
        scene: Surfaces and spheres of all trajectories.
        predicted: The prediction.
        reference: The reference, of the same length; None: there is none.
        names: Names of prediction and reference.
        evaluation: Report of `scoring.evaluate.evaluate`, or its laws alone; for a bag with counts
            and timing, see `BagScore`.
        floors: Other simulations of the reference's start by name, for the floor of chaos.
        recording: For a bag, by quantity: log times since the first prediction [s], and values
            [ms], shape (m,) each.
        lost: Step at which a trajectory diverged, where all are cut; None: none diverged.
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
        """Prediction and reference by name."""
        sides = {self.names[0]: self.predicted}
        if self.reference is not None:
            sides[self.names[1]] = self.reference
        return sides

    def window(self, start: int, stop: int) -> Comparison:
        """Steps from `start` up to but without `stop`; the evaluation stays that of all steps."""
        return replace(
            self,
            predicted=self.predicted.window(start, stop),
            reference=None if self.reference is None else self.reference.window(start, stop),
            floors={name: floor.window(start, stop) for name, floor in self.floors.items()},
        )


def cut(comparison: Comparison) -> Comparison:
    """The steps that all trajectories have, before any of them diverges.

    Raises:
        UserError: Time steps or spheres differ, or a trajectory diverges at its start.
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
