# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data sets of a budget, generated on demand in one folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import islice
from pathlib import Path

import numpy as np

from .budget import Budget, Data, short
from ...data.generate import generate, generate_scene
from ...data.recipe import DataRecipe, load_recipe
from ...data.records import Dataset, DatasetError, read_record, Record
from ...running.workers import Workers
from ...scenes.sampling import sample_start
from ...scenes.scene import Scene
from ...scenes.scene_file import load_start
from ...scenes.similarity import ModelUnits, Similarity
from ...scenes.state import State

# ending of a file, or key of `Data`: substeps, relative to the reference's
SUBSTEPS = {'': 1.0, 'half': 0.5, 'twice': 2.0}


def make_sets(budget: Budget, folder: Path, kinds: Sequence[str], workers: Workers) -> None:
    """Generate the data that cells of these kinds need and `folder` lacks.

    Raises:
        DatasetError: A folder holds data of another recipe; the message has the differences.
    """
    data = budget.data
    names = [data.train] if 'train' in kinds else []
    names += [data.test] if {'train', 'teacher', 'speed'} & set(kinds) else []
    names += [data.half, data.twice] if 'teacher' in kinds else []
    for name in names:
        recipe = load_recipe(name)
        if name != data.train:
            recipe = replace(recipe, trajectories=budget.trajectories)
            if recipe.steps < budget.long_steps:
                raise DatasetError(
                    f'data set {name} has trajectories of {recipe.steps} steps, but rollouts '
                    f'have up to {budget.long_steps} (long_steps of the budget); make steps of '
                    'the recipe as many, or long_steps fewer'
                )
        generate(recipe, folder / short(name), workers=workers)
    if {'train', 'teacher'} & set(kinds):
        for scene in data.ood:
            _make_scene(scene, folder, data)


def ood_path(folder: Path, scene: str, ending: str = '') -> Path:
    """File of a scene's reference, with an ending of `SUBSTEPS`."""
    name = short(scene)
    return folder / 'ood' / (f'{name}_{ending}.h5' if ending else f'{name}.h5')


def training_set(budget: Budget, folder: Path) -> list[Record]:
    """Records of the training set."""
    name = budget.data.train
    return _first(folder / short(name), load_recipe(name).trajectories)


def references(budget: Budget, folder: Path, which: str, ending: str = '') -> list[Record]:
    """References of the set 'test' or 'ood', with an ending of `SUBSTEPS`."""
    if which == 'ood':
        return [read_record(ood_path(folder, scene, ending)) for scene in budget.data.ood]
    name = getattr(budget.data, ending) if ending else budget.data.test
    return _first(folder / short(name), budget.trajectories)


def _first(folder: Path, count: int) -> list[Record]:
    """The first `count` records of a folder, which may hold more of the same recipe."""
    return list(islice(Dataset(folder, partial=True), count))


def _make_scene(name: str, folder: Path, data: Data) -> None:
    scene, recipe = load_start(name)
    start = sample_start(scene, recipe)
    dt = _native_dt(scene, load_recipe(data.train))
    for ending, share in SUBSTEPS.items():
        path, substeps = ood_path(folder, name, ending), round(share * data.ood_substeps)
        if not path.is_file():
            generate_scene(name, path, data.ood_steps, dt=dt, substeps=substeps)
            continue
        record = read_record(path)
        found = record.trajectory
        for what, there, wanted in (
            ('substeps', record.teacher.get('substeps'), substeps),
            ('steps', found.steps, data.ood_steps),
            ('time step [s]', f'{found.dt:.6g}', f'{dt:.6g}'),
            ('scene', 'another' if record.scene != scene else name, name),
            ('start', 'another' if _differ(found[0], start) else name, name),
        ):
            if there != wanted:
                raise DatasetError(
                    f'{path}: {what} is {there}, the budget wants {wanted}; remove the file, or '
                    'name another folder with --data'
                )


def _native_dt(scene: Scene, train: DataRecipe) -> float:
    """Time step, in a scene, of models trained by a recipe of one radius [s]."""
    radius = train.radius if isinstance(train.radius, float) else train.radius[1]
    units = ModelUnits(radius=radius, gravity=train.gravity, dt=train.dt)
    return units.dt * Similarity.between(scene, units).time


def _differ(one: State, other: State) -> bool:
    return any(
        not np.array_equal(getattr(one, entry.name), getattr(other, entry.name))
        for entry in fields(State)
    )
