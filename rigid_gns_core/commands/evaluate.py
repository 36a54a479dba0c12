# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns evaluate`: scores a model on data or tracks, or the predictions in a bag.

`ros2 run rigid_gns_ros evaluate` is the same command.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import textwrap
from typing import Any

from .arguments import completes, configs, figure_file, shipped_models
from .evaluate_tracks import add_track_arguments, run_tracks
from ..data.records import RECIPE_NAME
from ..data.tracks import TRACKS_NAME
from ..errors import UserError
from ..files.strict_json import write_json
from ..scoring.evaluate import evaluate, summarise
from ..scoring.table import format_table

_BY_HORIZON = {
    'horizon_errors': 'Position error since a start [m]',
    'future_errors': 'Position error of futures [m]',
}
# options of one kind of source; None or False where not given
_OF_DATA = ('steps', 'velocities')
_OF_BAG = ('scene', 'tracked', 'predicted', 'starts', 'match', 'frame', 'reproduce')
_OF_TRACKS = ('window', 'horizons', 'every', 'samples')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns evaluate`."""
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument('source', type=Path, nargs='?', metavar='SOURCE', help='data, or a bag')
    source.add_argument(
        '--data',
        type=Path,
        metavar='PATH',
        help='HDF5 file, or folder of them: roll a model out from the start of each trajectory, '
        'or, with --window, forecast from windows of its tracks',
    )
    source.add_argument(
        '--bag',
        type=Path,
        help='bag folder or .mcap file, complete or truncated: score its predicted poses '
        'against its tracked ones',
    )
    model = parser.add_argument(
        '--model',
        metavar='NAME|FILE',
        help='model to roll out (default: the shipped one; for a bag: its predictions, if any)',
    )
    parser.add_argument(
        '--json',
        type=Path,
        metavar='FILE',
        help='write all numbers to this file (default for a bag: BAG_evaluation.json beside it)',
    )
    parser.add_argument(
        '--figure',
        type=figure_file,
        metavar='PNG',
        help='draw positions, energy and error of the first trajectory (default for a bag: '
        'BAG_evaluation.png)',
    )
    parser.add_argument('--no-figure', action='store_true', help='do not draw')
    data = parser.add_argument_group('options for data')
    data.add_argument('--steps', type=int, help='steps to roll out (default: as long as the data)')
    data.add_argument(
        '--velocities',
        choices=('given', 'poses'),
        help='velocities by differences of poses, or as given (default: poses, unless those of '
        'the model are instantaneous)',
    )
    add_track_arguments(parser)
    bag = parser.add_argument_group('options for a bag')
    scene = bag.add_argument(
        '--scene',
        metavar='NAME|FILE',
        help='scene instead of the recorded one; of tracks: of the imported one',
    )
    bag.add_argument(
        '--tracked', '--topic', metavar='TOPIC', dest='tracked', help='topic of the tracked poses'
    )
    bag.add_argument('--predicted', metavar='TOPIC', help='topic of the predicted poses')
    bag.add_argument(
        '--starts', type=int, help='number of rollouts from tracked poses (default 20)'
    )
    bag.add_argument(
        '--match',
        action='store_true',
        help='associate poses with tracks for these rollouts: poses are in any order or missing',
    )
    bag.add_argument(
        '--frame',
        metavar='NAME',
        help="coordinate frame of the scene for these rollouts: others are moved by the bag's tf",
    )
    bag.add_argument(
        '--reproduce',
        action='store_true',
        help='compute every prediction again instead, and compare the bytes '
        '(exit code 1: some differ)',
    )
    completes(model, shipped_models)
    completes(scene, configs('scenes'))
    parser.epilog = (
        'examples:\n'
        '  rigid-gns evaluate --model gns --data data/test --steps 300 --json report.json\n'
        '  rigid-gns evaluate --data data/lab --scene lab.yaml --window 0.2 --every 0.1\n'
        '  rigid-gns evaluate bags/first --figure first.png\n'
        '  rigid-gns evaluate bags/first --reproduce\n'
        '  rigid-gns evaluate theirs --topic /vicon/balls --scene my_scene.yaml --model laws\n'
        '\nWhat each number means: docs/metrics.md.'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns evaluate`, which prints a table and the paths of files; the exit code."""
    source = arguments.data or arguments.bag or arguments.source
    data = arguments.bag is None and (arguments.data is not None or _is_data(source))
    tracks = data and _wants_tracks(source, arguments)
    _refuse(arguments, data=data, tracks=tracks)
    if tracks:
        return run_tracks(source, arguments)
    if data:
        return _run_data(source, arguments)
    return _reproduce(source, arguments) if arguments.reproduce else _run_bag(source, arguments)


def _wants_tracks(source: Path, arguments: argparse.Namespace) -> bool:
    """Whether windows of tracks are asked for, or there is nothing else."""
    asked = any(getattr(arguments, name) is not None for name in _OF_TRACKS)
    return asked or ((source / TRACKS_NAME).is_file() and not (source / RECIPE_NAME).is_file())


def _refuse(arguments: argparse.Namespace, *, data: bool, tracks: bool) -> None:
    """Refuse options of another kind of source.

    Raises:
        UserError: There is one.
    """
    wrong = [name for name in _OF_BAG if not (tracks and name == 'scene')] if data else []
    wrong += _OF_DATA if tracks or not data else ()
    wrong += ['figure'] if tracks else []
    wrong += _OF_TRACKS if not tracks else ()
    for name in wrong:
        if getattr(arguments, name) not in (None, False):
            if name in _OF_BAG:
                raise UserError(f'--{name} goes with --bag: data say it themselves')
            remedy = (
                'of tracks there are numbers at --horizons' if tracks else 'all of a bag is scored'
            )
            raise UserError(f'--{name} goes with --data: {remedy}')


def _is_data(source: Path) -> bool:
    return source.suffix == '.h5' or any(source.glob('*.h5'))


def _run_data(data: Path, arguments: argparse.Namespace) -> int:
    if arguments.steps is not None and arguments.steps < 1:
        raise UserError(f'--steps is {arguments.steps}, expected at least 1')
    from ..data.records import read_records
    from ..prediction.load import load_simulator
    from ..running.progress import Progress

    simulator = load_simulator(arguments.model)
    records = read_records(data)
    reports: dict[str, dict[str, Any]] = {}
    draws = arguments.figure is not None and not arguments.no_figure
    simulator.warm_up()
    with Progress(len(records), 'evaluate', unit='trajectory') as progress:
        for number, record in enumerate(records):
            start = record.trajectory[0]
            reference = record.at_steps_of(simulator.native_dt(record.scene))
            steps = reference.steps
            steps = steps if arguments.steps is None else min(arguments.steps, steps)
            predicted = simulator.rollout(record.scene, steps=steps, **vars(start))
            name = record.name if record.name not in reports else ''
            name = name or f'{number:04d}'
            reports[name] = evaluate(
                predicted,
                reference,
                record.scene,
                velocities=arguments.velocities or simulator.velocities,
            )
            if draws and number == 0:
                from ..show.figure import write_figure

                write_figure(
                    arguments.figure,
                    predicted,
                    reference,
                    record.scene,
                    title=f'{simulator.name} on {name}: {reports[name]["spheres"]} spheres',
                )
            progress.update(mse=reports[name]['errors']['mse'])
    one = next(iter(reports.values()))
    summary = summarise(list(reports.values()))
    report = {'model': simulator.name, 'data': str(data), 'summary': summary, 'records': reports}
    written = _write_numbers(arguments.json, report)
    print(f'model {simulator.name} on {data}: {len(reports)} trajectories\n')
    print(format_table(one if len(reports) == 1 else summary), end='')
    print(written, end='')
    if arguments.figure is not None:
        print(f'figure:  {arguments.figure}')
    return 0


def _run_bag(bag: Path, arguments: argparse.Namespace) -> int:
    from ..bags.reader import read_bag
    from ..recordings.scoring.evaluate import score_bag

    figure, missing = None, ''
    if not arguments.no_figure:
        try:
            import matplotlib  # noqa: F401 - to find out whether it is installed

            figure = arguments.figure or _beside(bag, '.png')
        except ModuleNotFoundError:
            missing = 'not drawn, as matplotlib is not installed'
    scored = score_bag(
        read_bag(bag),
        scene=arguments.scene,
        tracked=arguments.tracked,
        predicted=arguments.predicted,
        model=arguments.model,
        starts=20 if arguments.starts is None else arguments.starts,
        match=arguments.match,
        frame=arguments.frame,
    )
    written = _write_numbers(arguments.json or _beside(bag, '.json'), scored.report)
    if figure is not None:
        from ..show.figure import write_figure

        write_figure(
            figure,
            scored.predicted,
            scored.tracked,
            scored.scene,
            title=scored.title,
            names=('predicted', 'tracked'),
        )
    print(f'{format_report(scored.report)}\nbag:     {bag}')
    print(written, end='')
    if figure or missing:
        print(f'figure:  {figure or missing}')
    return 0


def format_report(report: dict[str, Any]) -> str:
    """Tables and notes of the report of a bag."""
    from ..recordings.scoring.horizon_errors import format_horizons

    shown = {key: value for key, value in report.items() if key not in _BY_HORIZON}
    notes = [
        textwrap.fill(
            note, 100, initial_indent='- ', subsequent_indent='  ', break_long_words=False
        )
        for note in report['notes']
    ]
    tables = [format_horizons(report.get(key, {}), name) for key, name in _BY_HORIZON.items()]
    return '\n'.join([format_table(shown), *filter(None, tables), *notes, ''])


def _reproduce(bag: Path, arguments: argparse.Namespace) -> int:
    from ..bags.reader import read_bag
    from ..bags.topics import find_topics
    from ..recordings.scoring.reproduce import reproduce

    recorded = read_bag(bag)
    with recorded.naming_damage():
        topics = find_topics(recorded, arguments.tracked, arguments.predicted)
        result = reproduce(recorded, topics, arguments.model)
    written = _write_numbers(arguments.json, vars(result))
    print('\n'.join([str(result), *recorded.warnings]))
    print(written, end='')
    return 1 if result.different else 0


def _beside(bag: Path, suffix: str) -> Path:
    """Path of a file beside a bag, as no other file belongs into its folder."""
    path = bag.resolve()
    return path.with_name(f'{path.stem if path.is_file() else path.name}_evaluation{suffix}')


def _write_numbers(path: Path | None, report: dict[str, Any]) -> str:
    """Write the numbers where they are wanted, and return a line that says so.

    They are written before anything is printed, as the reader of the output may leave.
    """
    if path is None:
        return ''
    write_json(path, report)
    return f'numbers: {path}\n'
