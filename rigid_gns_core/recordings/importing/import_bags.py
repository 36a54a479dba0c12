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

"""`rigid-gns import BAG...`: tracked poses of bags as a data set to train on. No ROS needed.

docs/learn_from_tracks.md says what is done to the poses.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
import os
from pathlib import Path
import shutil
from typing import Any

import numpy as np

from .tracks import ImportOptions, read_tracks
from ...commands.arguments import completes, configs, shipped_models
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
from ...files.config import from_mapping
from ...running.progress import Progress


def import_bags(
    bags: Sequence[str | Path], out: str | Path, options: ImportOptions | None = None
) -> list[dict[str, Any]]:
    """Write a data set of the tracked poses of bags; all of it or nothing.

    Returns:
        The report of each bag.

    Raises:
        ValueError: A bag cannot be read or used; which, and why.
        FileExistsError: There is something at `out`.
    """
    out = Path(out)
    if out.exists():
        raise FileExistsError(f'{out} exists; remove it or give another --out')
    places = [Path(bag).resolve() for bag in bags]
    if twice := [bag for bag, place in zip(bags, places, strict=True) if places.count(place) > 1]:
        raise ValueError(f'{twice[0]}: given twice, which would count its frames twice')
    options = options or ImportOptions()
    imported = []
    with Progress(len(bags), 'import', unit='bag') as progress:
        for bag in bags:
            imported.append(read_tracks(bag, options))
            progress.update(bag=Path(bag).name)
    records = [record for one in imported for record in one.records]
    reports = [one.report for one in imported]
    recipe = _recipe(records, reports)
    marked = [
        replace(record, index=index, recipe=recipe_hash(recipe))
        for index, record in enumerate(records)
    ]
    partial = out.with_name(f'.{out.name}.{os.getpid()}.tmp')
    try:
        partial.mkdir(parents=True)
        for index, record in enumerate(marked):
            write_record(record_path(partial, index), record, 'poses')
        write_recipe(partial, recipe)
        text = (partial / RECIPE_NAME).read_text(encoding='utf-8')
        text = text.replace('rigid-gns generate', 'rigid-gns import', 1)
        (partial / RECIPE_NAME).write_text(text, encoding='utf-8')
        os.replace(partial, out)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return reports


def format_report(report: dict[str, Any]) -> str:
    """Return what one bag gave, in sentences."""
    records = ', '.join(f'{steps} steps of {count}' for count, steps in report['records'])
    turning = report['noise_rad']
    period = f'{1e3 * report["interval_s"]:.4g} ms'
    lines = [
        f'{report["bag"]}: {report["frames"]} frames of {report["topic"]} every {period}',
        f'  steps: {1e3 * report["dt_s"]:.4g} ms',
        f'  records: {records} spheres',
        f'  noise: {1e3 * report["noise_m"]:.3g} mm in each coordinate, '
        + ('rotations are not tracked' if turning is None else f'{turning:.2g} rad in rotations'),
    ]
    poses = report['poses']
    total = sum(poses.values())
    shares = ', '.join(f'{name} {100 * n / total:.3g} %' for name, n in poses.items() if n)
    lines.append(f'  poses: {shares}')
    if report['matched']:
        lines.append(
            f'  spheres: matched from frame to frame, {report["matched"]}; '
            f'{report["filled"]} poses put in where one was not seen'
        )
    for key in ('refused', 'cuts'):
        if report[key]:
            lines.append(f'  {key}: ' + ', '.join(f'{n} {why}' for why, n in report[key].items()))
    if report['damaged'] or report['too_short']:
        lines.append(
            f'  left out: {report["damaged"]} damaged frames, {report["too_short"]} stretches '
            'too short'
        )
    return '\n'.join(lines + [f'  {warning}' for warning in report['warnings']])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `rigid-gns import`."""
    parser.add_argument('bags', type=Path, nargs='+', metavar='BAG', help='folder or .mcap file')
    parser.add_argument('--out', required=True, type=Path, help='data set to make')
    parser.add_argument(
        '--topic',
        help='topic of the tracked poses (default: that which a simulator named, else the only '
        '.../tracked_poses)',
    )
    scene = parser.add_argument(
        '--scene', metavar='NAME|FILE', help="scene instead of the bag's own"
    )
    parser.add_argument('--radius', type=float, help='radius of all spheres [m]')
    model = parser.add_argument('--model', default='', help='model whose time step the data get')
    completes(scene, configs('scenes'))
    completes(model, shipped_models)
    parser.add_argument('--dt', type=float, help='time step instead of that [s]')
    parser.add_argument('--max-gap', type=float, help='longest time to bridge [s]')
    parser.add_argument(
        '--min-steps', type=int, default=10, help='shorter stretches are left out (default 10)'
    )
    parser.add_argument(
        '--match',
        action='store_true',
        help='match poses to spheres: they come in any order, or are missing (default: only where '
        'the simulator that recorded the bag did)',
    )
    parser.epilog = (
        'examples:\n  rigid-gns import bags/first bags/second --out data/lab\n'
        '  rigid-gns calibrate --data data/lab --out lab.yaml'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns import`."""
    names = ('topic', 'scene', 'radius', 'model', 'dt', 'max_gap', 'min_steps', 'match')
    options = ImportOptions(**{name: getattr(arguments, name) for name in names})
    reports = import_bags(arguments.bags, arguments.out, options)
    print('\n'.join(format_report(report) for report in reports))
    print(f'{sum(len(report["records"]) for report in reports)} records in {arguments.out}')
    return 0


def _recipe(records: list[Record], reports: list[dict[str, Any]]) -> DataRecipe:
    """Return a recipe as data sets have one; what was drawn for others was tracked here."""
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
    return from_mapping(DataRecipe, recipe, 'recipe of the bags')
