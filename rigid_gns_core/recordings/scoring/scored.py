# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the scores of a bag are, and are of."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...scenes.scene import Scene
from ...scenes.state import Trajectory


@dataclass(frozen=True)
class Scored:
    """A bag that was scored.

    Args:
        report: What `scoring.evaluate.evaluate` returns, and `recording` (what was compared),
            `frames` (counts), `horizon_errors` and `future_errors` (by time since a start, of
            predictions and of whole futures, see `HorizonErrors.report`), `timing` (of messages
            and of model steps) and `notes` (sentences that a reader of the numbers needs).
        scene: Surfaces and spheres.
        predicted: Poses at equal times.
        tracked: Poses at the same times.
    """

    report: dict[str, Any]
    scene: Scene
    predicted: Trajectory
    tracked: Trajectory

    @property
    def title(self) -> str:
        """Bag, spheres and model, for people."""
        what = self.report['recording']
        name = Path(what['bag']).resolve().name
        return f'{name}: {self.predicted.count} spheres, model {what["model"]}'
