# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Import of tracked poses into a data set, as docs/learn_from_tracks.md describes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
import os
from pathlib import Path
import shutil
from typing import Any

import numpy as np

from .csv_import import import_csv, noise_of_tracks
from .options import Imported, ImportOptions
from .tracks import read_bag_tracks
from ...data.common_scene import fingerprint
from ...data.recipe import DataRecipe, recipe_hash
from ...data.records import (
    DatasetError,
    RECIPE_NAME,
    Record,
    record_path,
    write_recipe,
    write_record,
)
from ...data.tracks import Track, tracks_hash, TrackSet, write_tracks
from ...errors import UserError
from ...files.atomic_file import make_folder
from ...files.config import from_mapping
from ...running.progress import Progress


def import_bags(
    bags: Sequence[str | Path], out: str | Path, options: ImportOptions | None = None
) -> list[dict[str, Any]]:
    """Write a data set of the tracked poses of bags and CSV files, completely or not at all.

    It holds the tracks as they are, and trajectories at a model's time step where they can be
    made.

    Returns:
        The report of each file.

    Raises:
        UserError: A file cannot be read or used; the message says which, and why.
        FileExistsError: `out` exists.
    """
    out = Path(out)
    if out.exists():
        raise FileExistsError(f'{out} exists; remove it or give another --out')
    places = [os.path.realpath(bag) for bag in bags]
    if twice := [bag for bag, place in zip(bags, places, strict=True) if places.count(place) > 1]:
        raise UserError(f'{twice[0]}: given twice, which would count its frames twice')
    options = options or ImportOptions()
    imported = []
    with Progress(len(bags), 'import', unit='file') as progress:
        for bag in bags:
            read = import_csv if Path(bag).suffix.lower() == '.csv' else read_bag_tracks
            imported.append(read(Path(bag), options))
            progress.update(file=Path(bag).name)
    found = _together(imported)
    records = [record for one in imported for record in one.records]
    reports = [one.report for one in imported]
    recipe = _recipe(records, reports) if records else None
    partial = out.with_name(f'.{out.name}.{os.getpid()}.tmp')
    try:
        make_folder(out.parent, out)
        partial.mkdir()
        write_tracks(partial, found)
        if recipe is not None:
            _write_records(partial, records, recipe)
        os.replace(partial, out)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return reports


def _write_records(folder: Path, records: list[Record], recipe: DataRecipe) -> None:
    for index, record in enumerate(records):
        marked = replace(record, index=index, recipe=recipe_hash(recipe))
        write_record(record_path(folder, index), marked, 'poses')
    write_recipe(folder, recipe)
    text = (folder / RECIPE_NAME).read_text(encoding='utf-8')
    text = text.replace('rigid-gns generate', 'rigid-gns import', 1)
    (folder / RECIPE_NAME).write_text(text, encoding='utf-8')


def _together(imported: list[Imported]) -> TrackSet:
    """Tracks of all files.

    Raises:
        UserError: Their scenes differ.
    """
    first = imported[0]
    for one in imported[1:]:
        if one.scene != first.scene:
            files = first.report['file'], one.report['file']
            raise UserError(
                f'{files[1]} has another scene than {files[0]}; give one --scene for both, or '
                'import them into folders of their own'
            )
    tracks = _named_apart([track for one in imported for track in one.tracks])
    reports = [one.report for one in imported]
    origin = {'source': 'tracked poses', 'sha256': tracks_hash(tracks), 'files': reports}
    return TrackSet(tracks, first.scene, noise_of_tracks(tracks), origin)


def _named_apart(tracks: Sequence[Track]) -> tuple[Track, ...]:
    """Tracks with names of their own: files in two folders may have one name."""
    taken: Counter[str] = Counter()
    found = []
    for track in tracks:
        taken[track.name] += 1
        again = taken[track.name] > 1
        found.append(replace(track, name=f'{track.name}~{taken[track.name]}') if again else track)
    return tuple(found)


def _recipe(records: list[Record], reports: list[dict[str, Any]]) -> DataRecipe:
    """Recipe of the data set, with the tracked values where other recipes have drawn ones."""
    times = {record.trajectory.dt for record in records}
    if max(times) > 1.001 * min(times):
        raise DatasetError(
            f'the bags have time steps from {min(times):.4g} to {max(times):.4g} s, as their '
            'radii or gravities differ; import them into folders of their own, or give --dt'
        )
    scene = records[0].scene
    counts = [record.trajectory.count for record in records]
    origin = {'source': 'tracked poses', 'poses_sha256': fingerprint(records), 'bags': reports}
    side = 4.0 * float(np.max(scene.radius)) * float(np.sqrt(max(counts)))
    materials = {
        name: float(np.mean(getattr(scene, name)))
        for name in ('radius', 'mass', 'restitution', 'friction', 'rolling_friction')
    }
    recipe = {
        'trajectories': len(records),
        'seed': 0,
        'steps': max(record.trajectory.steps for record in records),
        'dt': min(times),
        'spheres': [min(counts), max(counts)],
        'box_side': [0.0, max(side, 100.0)],
        'gravity': float(np.linalg.norm(scene.gravity)),
        'teacher': origin,
        **materials,
    }
    return from_mapping(DataRecipe, recipe, 'recipe of the tracks')
