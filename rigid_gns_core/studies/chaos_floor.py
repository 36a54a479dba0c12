# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The floor of chaos: the teacher against itself, beside which errors of a model are read.

A chaotic scene has no absolute error: a start moved by 1e-6 m gives 22 m^2 after 400 steps. The
floor of an error is the teacher against itself at half and at twice the substeps, the larger of
the two; a ratio to it takes no less than a quarter of a squared radius, for distances half a
radius.
A reference whose floor at short horizons is not small has not converged, and is refined first
(96 substeps or more where there are few bounces).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
import hashlib
import json
from pathlib import Path
import zipfile

import numpy as np
from numpy.typing import ArrayLike

from ..files.atomic_file import whole_file
from ..scenes.scene import Scene
from ..scenes.state import State, Trajectory
from ..teacher.bullet import simulate as bullet
from ..teacher.settings import TeacherError, TeacherSettings

LEAST_FLOOR = 0.25
"""Squared errors below this [r^2], half a radius, are not told apart."""
_LESS_IS_WORSE = ('predictability_time', 'predictable_to_end', 'rest_share')
_FORMAT = 1  # counts up where files in the cache no longer mean the same
_ARRAYS = ('positions', 'quaternions', 'velocities', 'angular_velocities')

Values = Mapping[str, float | None]


def worst(errors: Sequence[Values]) -> dict[str, float | None]:
    """Return the worst of several errors by name: the largest, but of `_LESS_IS_WORSE`."""
    found = {}
    for name in {name: None for one in errors for name in one}:
        known = [value for one in errors if (value := one.get(name)) is not None]
        pick = min if name in _LESS_IS_WORSE else max
        found[name] = pick(known) if known else None
    return found


def least_floor(name: str, radius: ArrayLike) -> float | None:
    """Below it errors of this name are not told apart; None: they have no ratio to a floor.

    Args:
        name: As in docs/metrics.md; with a step at its end it has the unit of the first.
        radius: Of the spheres [m].
    """
    if name.startswith(('mse', 'chamfer')):
        return LEAST_FLOOR * float(np.mean(np.square(np.asarray(radius))))
    if name.startswith('position_error'):
        return float(np.sqrt(LEAST_FLOOR) * np.mean(np.asarray(radius)))
    return None


def over_floor(error: float | None, floor: float | None, least: float | None) -> float | None:
    """Ratio of an error to its floor, which is no less than `least`; None: one is not known."""
    if error is None or floor is None or least is None:
        return None
    return error / max(floor, least)


def half_and_twice(settings: TeacherSettings) -> list[TeacherSettings]:
    """Return the same settings at half and at twice the substeps."""
    substeps = settings.substeps
    return [replace(settings, substeps=count) for count in (max(1, substeps // 2), 2 * substeps)]


class References:
    """The teacher's trajectories: at its substeps, at half and at twice as many.

    Args:
        settings: Of the first; the others differ in substeps alone.
        cache: Folder for the results; None: they are kept for the last scene only.
    """

    def __init__(self, settings: TeacherSettings, cache: Path | None = None) -> None:
        self._settings = [settings, *half_and_twice(settings)]
        self._cache = cache
        self._last: dict[str, Trajectory] = {}

    def of(
        self, name: str, scene: Scene, start: State, steps: int, dt: float
    ) -> list[Trajectory] | None:
        """Return steps of `dt` [s] from a start; `name` begins the files. None: Bullet refuses."""
        runs: dict[str, Trajectory] = {}
        for settings in self._settings:
            key = _key(scene, start, steps, dt, settings)
            path = None if self._cache is None else self._cache / f'{name}-{key[:16]}.npz'
            try:
                if key in self._last:
                    runs[key] = self._last[key]
                elif path is not None and path.is_file():
                    runs[key] = _load(path)
                else:
                    runs[key] = bullet(scene, start, steps, dt, settings)
                    if path is not None:
                        _save(path, runs[key])
            except TeacherError:
                return None
        self._last = runs
        return list(runs.values())


def _key(scene: Scene, start: State, steps: int, dt: float, settings: TeacherSettings) -> str:
    """Return what a trajectory of the teacher depends on, as a hash."""
    given = {name: getattr(start, name).tolist() for name in _ARRAYS}
    content = [_FORMAT, scene.to_mapping(), given, steps, dt, asdict(settings)]
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _save(path: Path, trajectory: Trajectory) -> None:
    with whole_file(path) as partial, partial.open('wb') as file:
        arrays = {name: getattr(trajectory, name) for name in _ARRAYS}
        np.savez_compressed(file, dt=np.array(trajectory.dt), **arrays)


def _load(path: Path) -> Trajectory:
    try:
        with np.load(path) as file:
            return Trajectory(dt=float(file['dt']), **{name: file[name] for name in _ARRAYS})
    except (zipfile.BadZipFile, KeyError, ValueError, EOFError) as error:
        raise OSError(f'{path}: damaged, delete it: {error}') from error
