# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Trajectories in HDF5: one file each, with scene, seed and teacher; see docs/data_format.md."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from importlib import resources
import json
from pathlib import Path
import re
from typing import Any, Literal

import numpy as np
import yaml

from .checked_hdf5 import DatasetError as DatasetError
from .checked_hdf5 import read_checked, storable, write_checked
from .recipe import DataRecipe, recipe_hash
from .tracks import TRACKS_NAME
from ..files.atomic_file import whole_file
from ..files.config import ConfigError, from_mapping, load_yaml
from ..files.strict_json import parse_json
from ..scenes.scene import Scene
from ..scenes.state import Array, as_unit, Trajectory

FORMAT_VERSION = 1
SAME_STEP = 1e-3
"""Relative difference up to which a time step counts as a part of another one."""
RECIPE_NAME = 'recipe.yaml'

Contents = Literal['full', 'poses']

_KIND, _REMEDY = 'trajectory', 'generate it again'

# name: (last dimension, unit, dtype in a full file). Positions keep float64: at 100 m a float32
# would put 1e-4 m/s of noise into velocities by differences, more than a resting sphere has.
_ARRAYS: dict[str, tuple[int, str, str]] = {
    'positions': (3, 'm', 'f8'),
    'quaternions': (4, 'x y z w', 'f4'),
    'velocities': (3, 'm/s', 'f4'),
    'angular_velocities': (3, 'rad/s', 'f4'),
}
_POSES = ('positions', 'quaternions')


@dataclass(frozen=True, kw_only=True)
class Record:
    """A trajectory with all that is needed to make it again.

    Args:
        trajectory: The states.
        scene: Surfaces, sphere properties, materials, gravity.
        seed: Seed of the set, or of the scene's start.
        teacher: Engine, its version and its settings.
        name: Name of the scene or of the file.
        index: Which trajectory of the set; (seed, index) fixes the start.
        recipe: `recipe_hash` of the set's recipe; empty outside of a set.
    """

    trajectory: Trajectory
    scene: Scene
    seed: int
    teacher: dict[str, Any] = field(default_factory=dict)
    name: str = ''
    index: int = 0
    recipe: str = ''

    def at_steps_of(self, dt: float) -> Trajectory:
        """The trajectory at steps of `dt` [s], where its own are a whole part of that; or all."""
        part = round(dt / self.trajectory.dt)
        if not 2 <= part <= self.trajectory.steps:
            return self.trajectory
        found = self.trajectory.every(part)
        return replace(found, dt=dt) if abs(found.dt - dt) <= SAME_STEP * dt else self.trajectory


def write_record(path: str | Path, record: Record, contents: Contents = 'full') -> Path:
    """Write one file, whole or not at all.

    Args:
        path: File to write; one that exists is replaced.
        record: What to write. Positions are kept as float64, the rest as float32.
        contents: 'poses' keeps positions and quaternions alone, as float32: half the size.

    Raises:
        DatasetError: The trajectory diverged.
    """
    path, trajectory = Path(path), record.trajectory
    if (bad := trajectory.diverged_at) is not None:
        raise DatasetError(
            f'{record.name or path}: step {bad} is not finite; a record must be finite throughout'
        )
    with write_checked(path, _KIND) as file:
        file.attrs['format_version'] = FORMAT_VERSION
        file.attrs['contents'] = contents
        file.attrs['dt'] = trajectory.dt
        file.attrs['scene'] = json.dumps(record.scene.to_mapping())
        file.attrs['teacher'] = json.dumps(record.teacher)
        for name in ('seed', 'name', 'index', 'recipe'):
            value = getattr(record, name)
            file.attrs[name] = storable(value) if isinstance(value, str) else value
        for name in _POSES if contents == 'poses' else _ARRAYS:
            last, unit, dtype = _ARRAYS[name]
            array = getattr(trajectory, name)
            stored = file.create_dataset(
                name,
                data=array,
                dtype='f4' if contents == 'poses' else dtype,
                chunks=(min(64, len(array)), max(1, trajectory.count), last),
                compression='gzip',
                shuffle=True,
            )
            stored.attrs['unit'] = unit
            file.flush()  # in this order: left to HDF5 it depends on when objects are freed
    return path


def read_record(path: str | Path) -> Record:
    """Read one file; its checksum is compared first.

    Raises:
        DatasetError: The file is absent, damaged, or of a version this program does not know.
    """
    with read_checked(Path(path), _KIND, FORMAT_VERSION, _REMEDY) as file:
        attributes: dict[str, Any] = dict(file.attrs)
        arrays = {str(name): np.asarray(file[name], dtype=np.float64) for name in file}
        return _assemble(attributes, arrays)


def read_records(path: str | Path) -> list[Record]:
    """Records of one file, or of all files of a folder.

    Raises:
        DatasetError: A file is damaged, or the folder lacks some.
    """
    return list(Dataset(path)) if Path(path).is_dir() else [read_record(path)]


def demo_record() -> Record:
    """Record that the package ships: 154 spheres in the 60 x 60 m box.

    Raises:
        DatasetError: The installation lacks it.
    """
    shipped = resources.files('rigid_gns_core') / 'data' / 'box_154.h5'
    with resources.as_file(shipped) as path:
        if not path.is_file():
            raise DatasetError(
                f'{path}: the demonstration record is absent; reinstall the package, or make it '
                'as docs/data_format.md says'
            )
        return read_record(path)


class Dataset:
    """Records of a folder that `rigid-gns generate` made; each is read when it is asked for.

    Args:
        folder: Holds recipe.yaml and one file per trajectory.
        partial: Accept that trajectories are missing.

    Raises:
        DatasetError: No data set, or not all trajectories are there; the missing ones are listed.
    """

    def __init__(self, folder: str | Path, *, partial: bool = False) -> None:
        self.folder = Path(folder)
        self.recipe = read_recipe(self.folder)
        present = present_records(self.folder)
        self.missing = tuple(sorted(set(range(self.recipe.trajectories)) - set(present)))
        self.paths = tuple(path for _, path in sorted(present.items()))
        self._hash = recipe_hash(self.recipe)
        if self.missing and not partial:
            indices = ', '.join(str(index) for index in self.missing[:20])
            indices += ', ...' if len(self.missing) > 20 else ''
            raise DatasetError(
                f'{self.folder}: {len(self.missing)} of {self.recipe.trajectories} trajectories '
                f'are missing: {indices}; run `rigid-gns generate` again to add them'
            )
        if not self.paths:
            raise DatasetError(f'{self.folder}: holds no trajectory yet; run `rigid-gns generate`')

    def __len__(self) -> int:
        return len(self.paths)

    def __iter__(self) -> Iterator[Record]:
        return (self._read(path) for path in self.paths)

    def _read(self, path: Path) -> Record:
        record = read_record(path)
        check_membership(path, record, self._hash)
        return record


def record_path(folder: str | Path, index: int) -> Path:
    """Path of trajectory `index` of a data set."""
    return Path(folder) / f'{index:04d}.h5'


def present_records(folder: str | Path) -> dict[int, Path]:
    """Paths of the trajectories that a folder holds, by index."""
    files = Path(folder).glob('*.h5')
    return {int(path.stem): path for path in files if re.fullmatch(r'\d{4,}', path.stem)}


def check_membership(path: Path, record: Record, recipe: str) -> None:
    """Raise DatasetError where the file's content is not what its name and recipe say."""
    if record.recipe != recipe or record.index != int(path.stem):
        raise DatasetError(
            f'{path}: holds trajectory {record.index} of recipe {record.recipe or "none"}, '
            f'expected {int(path.stem)} of {recipe}; remove the file and generate it again'
        )


def write_recipe(folder: str | Path, recipe: DataRecipe) -> None:
    """Write recipe.yaml of a data set."""
    path = Path(folder) / RECIPE_NAME
    content = json.loads(json.dumps(asdict(recipe)))  # tuples to lists
    head = '# Written by `rigid-gns generate`; the trajectories beside it were made by it.\n'
    with whole_file(path) as partial:
        partial.write_text(head + yaml.safe_dump(content, sort_keys=False), encoding='utf-8')


def read_recipe(folder: str | Path) -> DataRecipe:
    """Recipe of the data set in a folder.

    Raises:
        DatasetError: The folder is no data set, or its recipe cannot be read.
    """
    path = Path(folder) / RECIPE_NAME
    if not path.is_file() and (Path(folder) / TRACKS_NAME).is_file():
        raise DatasetError(
            f'{folder}: holds tracks alone, no trajectories at a time step; `rigid-gns import` '
            'said why when it made them'
        )
    if not path.is_file():
        raise DatasetError(f'{folder}: no data set here, {RECIPE_NAME} is absent')
    try:
        return from_mapping(DataRecipe, load_yaml(path), str(path))
    except ConfigError as error:
        raise DatasetError(f'{error}; the data set cannot be used by this version') from error


def _assemble(attributes: dict[str, Any], arrays: dict[str, Array]) -> Record:
    arrays['quaternions'] = as_unit(arrays['quaternions'])
    make = Trajectory.from_poses if attributes['contents'] == 'poses' else Trajectory
    return Record(
        trajectory=make(**arrays, dt=float(attributes['dt'])),
        scene=Scene.from_mapping(parse_json(attributes['scene'])),
        seed=int(attributes['seed']),
        teacher=parse_json(attributes['teacher']),
        name=str(attributes['name']),
        index=int(attributes['index']),
        recipe=str(attributes['recipe']),
    )
