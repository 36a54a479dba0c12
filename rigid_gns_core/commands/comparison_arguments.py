# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Options that name the records or the bag of a comparison, and reading it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from .arguments import completes, configs
from ..data.records import read_record, Record
from ..errors import UserError
from ..scoring import divergence, law_metrics
from ..scoring.error import check_comparable
from ..scoring.evaluate import evaluate, Velocities
from ..show.bag_comparison import read_bag_comparison
from ..show.comparison import Comparison, cut


def add_source(parser: argparse.ArgumentParser) -> None:
    """Add the options of `read_comparison`."""
    parser.add_argument(
        'source',
        type=Path,
        metavar='RECORD|BAG',
        help='HDF5 file of `rigid-gns rollout` or `generate`, or a recorded bag',
    )
    parser.add_argument(
        '--reference',
        type=Path,
        metavar='RECORD',
        help='HDF5 file to compare a record with; a bag holds its own',
    )
    parser.add_argument('--title', help='headline (default: from the name of the source)')
    scene = parser.add_argument(
        '--scene', metavar='NAME|FILE', help='scene of a bag instead of the recorded one'
    )
    completes(scene, configs('scenes'))
    parser.add_argument('--tracked', metavar='TOPIC', help='topic of tracked poses in a bag')
    parser.add_argument('--predicted', metavar='TOPIC', help='topic of predicted poses in a bag')


def read_comparison(
    arguments: argparse.Namespace, *, floors: Sequence[Path] = (), velocities: Velocities = 'given'
) -> Comparison:
    """Read the comparison that the options of `add_source` name.

    Args:
        arguments: Parsed options.
        floors: Records of other simulations of the reference's start.
        velocities: Velocities of records: 'given', or 'poses' for backward differences, as for
            bags.

    Raises:
        UserError: A file cannot be read, or two files do not fit together.
    """
    source: Path = arguments.source
    if not source.exists():
        raise FileNotFoundError(f'{source}: no such record or bag')
    if source.is_file() and source.suffix != '.mcap':
        for name in ('scene', 'tracked', 'predicted'):
            if getattr(arguments, name) is not None:
                raise UserError(f'--{name} goes with a bag: the record {source} says it itself')
        comparison = _read_records(source, arguments.reference, velocities)
    else:
        if arguments.reference is not None:
            raise UserError(
                f'--reference goes with a record: the bag {source} holds tracked poses'
            )
        comparison = read_bag_comparison(
            source, scene=arguments.scene, tracked=arguments.tracked, predicted=arguments.predicted
        )
    if floors and comparison.reference is None:
        raise UserError('--floor needs a reference to measure from; give --reference too')
    added = {_floor_name(path): read_record(path).trajectory for path in floors}
    title = arguments.title or comparison.title
    return cut(replace(comparison, title=title, floors=added))


def _read_records(source: Path, reference: Path | None, velocities: Velocities) -> Comparison:
    record = read_record(source)
    name = record.name or source.stem
    if reference is None:
        return Comparison(
            title=name,
            scene=record.scene,
            predicted=record.trajectory,
            names=(engine_name(record), ''),
            evaluation=_laws_alone(record),
        )
    other = read_record(reference)
    frames = min(len(record.trajectory), len(other.trajectory))
    predicted = record.trajectory.window(0, frames)
    truth = other.trajectory.window(0, frames)
    try:
        check_comparable(predicted, truth)
    except UserError as error:
        raise UserError(f'{source} and {reference} do not compare: {error}') from error
    names = engine_name(record), engine_name(other)
    if names[0] == names[1]:
        names = f'{names[0]} ({source.stem})', f'{names[1]} ({reference.stem})'
    return Comparison(
        title=name,
        scene=other.scene,
        predicted=predicted,
        reference=truth,
        names=names,
        evaluation=evaluate(predicted, truth, other.scene, velocities=velocities),
    )


def _laws_alone(record: Record) -> dict[str, Any]:
    trajectory = record.trajectory
    return {
        'steps': trajectory.steps,
        'dt': trajectory.dt,
        'spheres': trajectory.count,
        'diverged_at': {'predicted': divergence(trajectory, record.scene)},
        'laws': {'predicted': law_metrics(trajectory, record.scene)},
    }


def engine_name(record: Record) -> str:
    """Name of the engine of a record, for legends."""
    engine = str(record.teacher.get('engine', 'unknown'))
    if engine == 'pybullet':
        return 'Bullet'
    return f'predicted ({record.teacher["model"]})' if 'model' in record.teacher else engine


def _floor_name(path: Path) -> str:
    substeps = read_record(path).teacher.get('substeps')
    return path.stem if substeps is None else f'{path.stem}, {substeps} substeps'
