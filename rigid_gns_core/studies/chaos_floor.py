# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The floor of chaos: errors of the teacher against itself, to which a model's are compared.

Errors in a chaotic scene have no absolute meaning: a start moved by 1e-6 m gives 22 m^2 after 400
steps. The floor of an error is the larger error of the teacher at half and at twice the substeps;
for ratios it is at least a quarter of a squared radius, for distances half a radius. A reference
with a large floor at short horizons has not converged, and is refined first (96 substeps or more
where there are few bounces).
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
"""Least floor of squared errors [r^2], half a radius squared."""
_LESS_IS_WORSE = ('predictability_time', 'predictable_to_end', 'rest_share')
_FORMAT = 2  # version of the files in the cache: 1 had slabs behind all plates
_ARRAYS = ('positions', 'quaternions', 'velocities', 'angular_velocities')

Values = Mapping[str, float | None]


def worst(errors: Sequence[Values]) -> dict[str, float | None]:
    """Worst of several errors by name: the largest, or the least of `_LESS_IS_WORSE`."""
    found = {}
    for name in {name: None for one in errors for name in one}:
        known = [value for one in errors if (value := one.get(name)) is not None]
        pick = min if name in _LESS_IS_WORSE else max
        found[name] = pick(known) if known else None
    return found


def least_floor(name: str, radius: ArrayLike) -> float | None:
    """Least floor of the errors of a metric; None: it has no ratio to a floor.

    Args:
        name: Name of the metric as in docs/metrics.md, also with a step at its end.
        radius: Radii of the spheres [m].
    """
    if name.startswith(('mse', 'chamfer')):
        return LEAST_FLOOR * float(np.mean(np.square(np.asarray(radius))))
    if name.startswith('position_error'):
        return float(np.sqrt(LEAST_FLOOR) * np.mean(np.asarray(radius)))
    return None


def over_floor(error: float | None, floor: float | None, least: float | None) -> float | None:
    """Ratio of an error to its floor, or to `least` if that is more; None: one is not known."""
    if error is None or floor is None or least is None:
        return None
    return error / max(floor, least)


def half_and_twice(settings: TeacherSettings) -> list[TeacherSettings]:
    """The settings at half and at twice the substeps."""
    substeps = settings.substeps
    return [replace(settings, substeps=count) for count in (max(1, substeps // 2), 2 * substeps)]


class References:
    """Trajectories of the teacher at its substeps, at half and at twice as many.

    Args:
        settings: Settings of the first; the others differ in substeps only.
        cache: Folder of cached results; None: only those of the last scene are kept, in memory.
    """

    def __init__(self, settings: TeacherSettings, cache: Path | None = None) -> None:
        self._settings = [settings, *half_and_twice(settings)]
        self._cache = cache
        self._last: dict[str, Trajectory] = {}

    def of(
        self, name: str, scene: Scene, start: State, steps: int, dt: float
    ) -> list[Trajectory] | None:
        """The trajectories of `steps` of `dt` [s]; None: Bullet does not support the scene.

        `name` begins the names of the cached files.
        """
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
    """Hash of all that a trajectory of the teacher depends on."""
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
