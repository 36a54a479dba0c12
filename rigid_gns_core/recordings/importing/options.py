# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an import is asked for, and what it gives."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .units_and_axes import AXES
from ...data.records import Record
from ...data.tracks import Track
from ...errors import UserError
from ...scenes.scene import Scene


class ImportBagError(UserError):
    """A file holds nothing to import, or does not fit its scene."""


@dataclass(frozen=True)
class ImportOptions:
    """Options of the import.

    Args:
        topic: Topic of the tracked poses; None: that of the simulator, else .../tracked_poses.
        scene: Shipped name or YAML file; None: the scene that the simulator recorded.
        radius: Radius of all spheres [m]; None: that of the scene.
        model: Model whose time step the data get, for the scene's radius and gravity.
        dt: Time step [s]; None: that of the model.
        max_gap: Longest time between frames of a segment [s]; None: two missing frames, of the
            data or of the tracker, whichever is slower.
        min_steps: Least number of steps of a segment.
        match: Whether poses are associated with tracks, as they come in any order or are missing;
            always where the simulator that recorded them did so.
        scale: Metres in a unit of the file.
        up: Axis of the file that points up, of `AXES`; it becomes z.
        frame: Coordinate frame of the scene, into which the transforms of a bag move poses in
            others; None: poses are as they are.
        skip_bad: Whether bad tracks of a CSV file are left out; if not, they are refused.
    """

    topic: str | None = None
    scene: str | Path | None = None
    radius: float | None = None
    model: str = ''
    dt: float | None = None
    max_gap: float | None = None
    min_steps: int = 10
    match: bool = False
    scale: float = 1.0
    up: str = 'z'
    frame: str | None = None
    skip_bad: bool = False

    def __post_init__(self) -> None:
        for name in ('radius', 'dt', 'max_gap', 'scale'):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ImportBagError(f'{name} is {value}, expected a positive number')
        if self.up not in AXES:
            raise ImportBagError(f'up is {self.up!r}, expected one of {", ".join(AXES)}')
        if self.min_steps < 3:
            raise ImportBagError(
                f'min_steps is {self.min_steps}, expected at least 3, which training windows need'
            )


@dataclass(frozen=True)
class Imported:
    """Import of one file.

    Args:
        records: Trajectories at a time step.
        tracks: Poses as the tracker gave them.
        scene: Scene of all spheres.
        report: Counts, noise and warnings, for the user and for the recipe.
    """

    records: list[Record]
    tracks: list[Track]
    scene: Scene
    report: dict[str, Any]
