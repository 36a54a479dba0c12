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

"""Data sets of a budget: made on demand below one folder, or used where they are there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from .budget import Budget
from ..dataset import (
    Dataset,
    DatasetError,
    read_recipe,
    read_record,
    RECIPE_NAME,
    Record,
    record_path,
)
from ..generate import generate, generate_scene, resolve
from ..recipe import DataRecipe, load_recipe, recipe_hash
from ..sampling import load_scene
from ..workers import Workers

# ending of a file or key in `Data`: share of the reference's substeps
SUBSTEPS = {'': 1.0, 'half': 0.5, 'twice': 2.0}


def make_sets(budget: Budget, folder: Path, kinds: Sequence[str], workers: Workers) -> None:
    """Make what cells of these kinds need and `folder` lacks.

    Raises:
        DatasetError: A folder holds data of another recipe; the differences are named.
    """
    data = budget.data
    names = [data.train] if 'train' in kinds else []
    names += [data.test] if {'train', 'teacher', 'speed'} & set(kinds) else []
    names += [data.half, data.twice] if 'teacher' in kinds else []
    for name in names:
        recipe = load_recipe(name)
        if name != data.train:
            recipe = replace(recipe, trajectories=budget.trajectories)
        if not _is_there(folder / name, recipe):
            generate(recipe, folder / name, workers=workers)
    if {'train', 'teacher'} & set(kinds):
        for scene in data.ood:
            for ending, share in SUBSTEPS.items():
                _make_scene(scene, ood_path(folder, scene, ending), share, budget)


def ood_path(folder: Path, scene: str, ending: str = '') -> Path:
    """File of a scene at a share of the substeps, see `SUBSTEPS`."""
    return folder / 'ood' / (f'{scene}_{ending}.h5' if ending else f'{scene}.h5')


def training_set(budget: Budget, folder: Path) -> list[Record]:
    """Return the training set."""
    return _first(folder / budget.data.train, load_recipe(budget.data.train).trajectories)


def references(budget: Budget, folder: Path, which: str, ending: str = '') -> list[Record]:
    """Return references of a set, at a share of the substeps; 'test' or 'ood'."""
    if which == 'ood':
        return [read_record(ood_path(folder, scene, ending)) for scene in budget.data.ood]
    name = getattr(budget.data, ending) if ending else budget.data.test
    return _first(folder / name, budget.trajectories)


def _first(folder: Path, count: int) -> list[Record]:
    """Return the first `count` trajectories: a folder may hold more of the same recipe."""
    return Dataset(folder, partial=True)[:count]


def _is_there(folder: Path, recipe: DataRecipe) -> bool:
    """Whether the files of this recipe are there; `Dataset` checks each when it reads it."""
    if not (folder / RECIPE_NAME).is_file():
        return False
    if recipe_hash(read_recipe(folder)) != recipe_hash(resolve(recipe)):
        return False  # and `generate` says what differs
    return all(record_path(folder, index).is_file() for index in range(recipe.trajectories))


def _make_scene(name: str, path: Path, share: float, budget: Budget) -> None:
    data = budget.data
    substeps = round(share * data.ood_substeps)
    if not path.is_file():
        generate_scene(name, path, data.ood_steps, substeps=substeps)
        return
    record = read_record(path)
    found = {
        'substeps': record.teacher.get('substeps'),
        'steps': record.trajectory.steps,
        'scene': record.scene == load_scene(name)[0],
    }
    wanted = {'substeps': substeps, 'steps': data.ood_steps, 'scene': True}
    for key, value in wanted.items():
        if found[key] != value:
            raise DatasetError(
                f'{path}: {key} is {found[key]}, the budget wants {value}; remove the file, or '
                'name another folder with --data'
            )
