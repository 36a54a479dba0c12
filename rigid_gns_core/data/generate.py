# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bullet trajectories of a data recipe, or of one scene, into HDF5 files."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path
import sys
import time
from typing import Any

from .recipe import DataRecipe, recipe_difference, recipe_hash
from .records import (
    check_membership,
    Contents,
    DatasetError,
    present_records,
    read_recipe,
    read_record,
    RECIPE_NAME,
    Record,
    record_path,
    write_recipe,
    write_record,
)
from ..errors import UserError
from ..files.atomic_file import make_folder
from ..files.config import from_mapping
from ..running.progress import Progress
from ..running.workers import WorkerDied, Workers
from ..scenes.sampling import sample_start
from ..scenes.scene_file import load_start


class GenerateError(UserError):
    """A trajectory could not be made; the message says which."""


def generate(
    recipe: DataRecipe, folder: str | Path, *, workers: int | Workers | None = None
) -> list[Path]:
    """Make the trajectories of `recipe` that `folder` lacks; files that are whole are kept.

    Args:
        recipe: What to make.
        folder: Where; made if absent.
        workers: Where they are made, or the number of processes; None: one per usable core. With
            1, all are made in this process.

    Returns:
        Paths of the trajectories of the recipe.

    Raises:
        DatasetError: The folder holds another recipe's data; the differences are named.
        GenerateError: A trajectory failed; its seed and index are named.
    """
    workers = workers if isinstance(workers, Workers) else Workers(workers)
    recipe, folder = resolve(recipe), Path(folder)
    _claim(folder, recipe)
    paths = [record_path(folder, index) for index in range(recipe.trajectories)]
    missing = [index for index, path in enumerate(paths) if not _is_whole(path, recipe)]
    at_work: set[int] = set()

    def calls() -> Iterator[tuple[DataRecipe, Path, int]]:
        for index in missing:
            at_work.add(index)
            yield recipe, folder.absolute(), index

    with Progress(
        len(paths), str(folder), unit='trajectory', initial=len(paths) - len(missing)
    ) as progress:
        try:
            for index, spheres, seconds in workers.run(_make, calls(), len(missing)):
                at_work.discard(index)
                progress.update(index=str(index), spheres=str(spheres), seconds=seconds)
        except WorkerDied as error:
            suspects = ' or '.join(str(index) for index in sorted(at_work))
            raise GenerateError(
                f'a worker process died at trajectory {suspects} of seed {recipe.seed}; '
                'give the same command again to go on, with fewer --workers where memory is short'
            ) from error
    return paths


def generate_scene(
    name: str | Path,
    path: str | Path,
    steps: int,
    *,
    dt: float = 0.1,
    substeps: int | None = None,
    contents: Contents = 'full',
    done: Callable[[], object] | None = None,
) -> Path:
    """Simulate `steps` time steps of `dt` [s] of a scene file from its own start, into one file.

    `substeps` is the teacher's, None: its default; `done` is called after each time step.

    Raises:
        ConfigError: No such scene, or a value of it is wrong.
        SamplingError: The spheres do not fit.
    """
    from ..teacher.bullet import simulate
    from ..teacher.settings import TeacherSettings

    scene, recipe = load_start(name)
    settings = TeacherSettings() if substeps is None else TeacherSettings(substeps=substeps)
    trajectory = simulate(scene, sample_start(scene, recipe), steps, dt, settings, done)
    record = Record(
        trajectory=trajectory,
        scene=scene,
        seed=recipe.seed,
        teacher=_describe(asdict(settings)),
        name=Path(name).stem,
    )
    return write_record(path, record, contents)


def resolve(recipe: DataRecipe) -> DataRecipe:
    """Recipe with every setting of the teacher, so that a changed default counts as a change."""
    from ..teacher.settings import TeacherSettings

    settings = from_mapping(TeacherSettings, recipe.teacher, 'teacher')
    return replace(recipe, teacher=asdict(settings))


def _describe(settings: dict[str, Any]) -> dict[str, Any]:
    return {'engine': 'pybullet', 'version': version('pybullet'), **settings}


def _claim(folder: Path, recipe: DataRecipe) -> None:
    """Write the recipe to a new folder, or check that the folder has the same one."""
    make_folder(folder)
    present = present_records(folder)
    if (folder / RECIPE_NAME).exists():
        if difference := recipe_difference(read_recipe(folder), recipe):
            raise DatasetError(
                f'{folder}: made by another recipe ({"; ".join(difference)}); '
                'choose another folder, or remove this one'
            )
    elif present:
        raise DatasetError(f'{folder}: holds trajectories but no recipe; choose another folder')
    for left_over in folder.glob('.*.tmp'):  # of a run that was killed
        left_over.unlink()
    # with fewer trajectories than before, the data set keeps those that are there
    listed = max(recipe.trajectories, 1 + max(present, default=-1))
    write_recipe(folder, replace(recipe, trajectories=listed))


def _is_whole(path: Path, recipe: DataRecipe) -> bool:
    if not path.exists():
        return False
    try:
        record = read_record(path)
    except DatasetError as error:
        print(f'{error}: made again', file=sys.stderr)
        return False
    check_membership(path, record, recipe_hash(recipe))
    return True


def _make(recipe: DataRecipe, folder: Path, index: int) -> tuple[int, int, float]:
    """Make a trajectory; returns its index, the number of spheres and the time it took [s]."""
    from ..teacher.bullet import simulate
    from ..teacher.settings import TeacherSettings

    begin = time.monotonic()
    try:
        scene, start = recipe.draw(index)
        settings = from_mapping(TeacherSettings, recipe.teacher, 'teacher')
        trajectory = simulate(scene, start, recipe.steps, recipe.dt, settings)
        path = record_path(folder, index)
        write_record(
            path,
            Record(
                trajectory=trajectory,
                scene=scene,
                seed=recipe.seed,
                index=index,
                name=path.stem,
                teacher=_describe(recipe.teacher),
                recipe=recipe_hash(recipe),
            ),
        )
    except Exception as error:
        raise GenerateError(
            f'trajectory {index} of seed {recipe.seed}: {type(error).__name__}: {error}'
        ) from error
    return index, len(start), time.monotonic() - begin
