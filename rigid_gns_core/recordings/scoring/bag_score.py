# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The scores of a bag."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...scenes.scene import Scene
from ...scenes.state import Trajectory


@dataclass(frozen=True)
class BagScore:
    """Scores of a bag, and the trajectories that were compared.

    Args:
        report: The report of `scoring.evaluate.evaluate`, with `recording` (what was compared),
            `frames` (counts), `horizon_errors` and `future_errors` (by time since a start, of
            predictions and of predicted trajectories, see `HorizonErrors.report`), `timing` (of
            messages and model steps) and `notes` (sentences).
        scene: Surfaces and spheres.
        predicted: Predicted poses at equal intervals.
        tracked: Tracked poses at the same times.
    """

    report: dict[str, Any]
    scene: Scene
    predicted: Trajectory
    tracked: Trajectory

    @property
    def title(self) -> str:
        """Headline: bag, number of spheres and model."""
        what = self.report['recording']
        name = Path(what['bag']).resolve().name
        count = self.predicted.count
        return f'{name}: {count} sphere{"s" if count != 1 else ""}, model {what["model"]}'
