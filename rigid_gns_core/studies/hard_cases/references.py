# Copyright 2026 rigid_gns maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The teacher beside a hard case: at three step sizes, and kept in a folder."""

from __future__ import annotations

from dataclasses import asdict, replace
import hashlib
import json
from pathlib import Path
import zipfile

import numpy as np

from .case import Case
from .checks import HORIZONS
from ...files.atomic_file import whole_file
from ...scenes.state import Trajectory
from ...teacher.bullet import simulate as bullet
from ...teacher.settings import TeacherError, TeacherSettings

_FORMAT = 1  # counts up where files in the cache no longer mean the same
_ARRAYS = ('positions', 'quaternions', 'velocities', 'angular_velocities')


class References:
    """The teacher's trajectories: at its substeps, at half and at twice as many.

    Args:
        settings: Of the first; the others differ in substeps alone.
        cache: Folder for the results; None: they are kept for the last scene only.
    """

    def __init__(self, settings: TeacherSettings, cache: Path | None = None) -> None:
        substeps = settings.substeps
        self._settings = [
            replace(settings, substeps=count)
            for count in (substeps, max(1, substeps // 2), 2 * substeps)
        ]
        self._cache = cache
        self._last: dict[str, Trajectory] = {}

    def of(self, case: Case, dt: float) -> list[Trajectory] | None:
        """Up to the last horizon, at time steps of `dt` [s]; None: Bullet refuses the case."""
        steps = min(case.steps, max(HORIZONS))
        runs: dict[str, Trajectory] = {}
        for settings in self._settings:
            key = _key(case, steps, dt, settings)
            path = None if self._cache is None else self._cache / f'{case.name}-{key[:16]}.npz'
            try:
                if key in self._last:
                    runs[key] = self._last[key]
                elif path is not None and path.is_file():
                    runs[key] = _load(path)
                else:
                    runs[key] = bullet(case.scene, case.start, steps, dt, settings)
                    if path is not None:
                        _save(path, runs[key])
            except TeacherError:
                return None
        self._last = runs
        return list(runs.values())


def _key(case: Case, steps: int, dt: float, settings: TeacherSettings) -> str:
    """Return what a trajectory of the teacher depends on, as a hash."""
    start = {name: getattr(case.start, name).tolist() for name in _ARRAYS}
    content = [_FORMAT, case.scene.to_mapping(), start, steps, dt, asdict(settings)]
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
