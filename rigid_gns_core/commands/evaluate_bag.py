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

"""`evaluate BAG`: score predictions against the tracked poses of a bag. No ROS needed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
import textwrap
from typing import Any

from rigid_gns_ros.parameters import SIMULATOR

from ..bags.reader import Bag, BagError, read_bag
from ..bags.topics import find_topics, holds_predictions, listing, recorded_scenes, said_names
from ..files.strict_json import write_json
from ..recordings.scoring.horizon_errors import format_horizons
from ..recordings.scoring.predictions import score_predictions
from ..recordings.tracked_segments import find_tracked
from ..scenes.sampling import load_scene
from ..scenes.scene import Scene
from ..scoring.evaluate import format_table

_BY_HORIZON = {
    'horizon_errors': 'Position error since a start [m]',
    'future_errors': 'Position error of futures [m]',
}


def evaluate_bag(
    folder: str | Path,
    *,
    scene: str | Path | None = None,
    tracked: str | None = None,
    predicted: str | None = None,
    model: str | None = None,
    starts: int = 20,
    match: bool = False,
    figure: str | Path | None = None,
) -> dict[str, Any]:
    """Score a bag: the predictions in it, or rollouts of a model from its tracked poses.

    Args:
        folder: Bag folder, or an .mcap file.
        scene: Shipped name or YAML file of the scene. None: the one that the simulator recorded.
        tracked: Topic of the tracked poses. None: that of the simulator, see `find_topics`.
        predicted: Topic of the predicted poses. None: the same.
        model: Name or path of a model to roll out instead of reading predictions. None: only where
            there are none, and then the shipped default.
        starts: Number of these rollouts, evenly over the recording.
        match: Whether these match poses to spheres, which come in any order or are missing; also
            where the simulator that recorded them did.
        figure: PNG to draw. None: none.

    Returns:
        What `rigid_gns_core.scoring.evaluate.evaluate` returns, and `recording` (what was compared),
        `frames` (counts), `horizon_errors` and `future_errors` (by time since a start, of
        predictions and of whole futures, see `HorizonErrors.report`),
        `timing` (of messages and of model steps) and `notes` (sentences that a reader of the
        numbers needs).

    Raises:
        ValueError: The bag cannot be read, lacks a topic or a scene, or nothing overlaps.
    """
    bag = read_bag(folder)
    if model is None and (predicted is not None or _predicts(bag, tracked, scene)):
        topics = find_topics(bag, tracked, predicted)
        return score_predictions(bag, topics, _scene(bag, topics.recorded, scene), figure)
    # late: a model need not be there to score predictions
    from ..recordings.scoring.rollouts import RolloutOptions, score_rollouts

    scenes = [one for one in recorded_scenes(bag).values() if 'scene' in one]
    topic = find_tracked(bag, tracked, [said_names(one).get('tracked', '') for one in scenes])
    own = [one for one in scenes if said_names(one).get('tracked') == topic.name] or scenes
    recorded = own[0] if own else {}
    match = match or bool(recorded.get('parameters', {}).get('match_spheres', False))
    options = RolloutOptions(model or '', starts, _window(recorded), match)
    return score_rollouts(bag, topic, _scene(bag, recorded, scene), options, figure)


def format_report(report: dict[str, Any]) -> str:
    """Return the tables of a report with its notes."""
    shown = {key: value for key, value in report.items() if key not in _BY_HORIZON}
    notes = [
        textwrap.fill(
            note, 100, initial_indent='- ', subsequent_indent='  ', break_long_words=False
        )
        for note in report['notes']
    ]
    tables = [format_horizons(report.get(key, {}), name) for key, name in _BY_HORIZON.items()]
    return '\n'.join([format_table(shown), *filter(None, tables), *notes, ''])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `evaluate`."""
    parser.add_argument('bag', type=Path, help='bag folder or .mcap file, whole or torn')
    parser.add_argument(
        '--json',
        type=Path,
        metavar='FILE',
        help='where to write all numbers (default: BAG_evaluation.json beside the bag)',
    )
    parser.add_argument(
        '--figure',
        type=Path,
        metavar='PNG',
        help='where to draw positions, energy and error (default: BAG_evaluation.png)',
    )
    parser.add_argument('--no-figure', action='store_true', help='do not draw')
    parser.add_argument(
        '--scene', metavar='NAME|FILE', help='scene, where the bag holds none or a wrong one'
    )
    parser.add_argument(
        '--tracked', '--topic', metavar='TOPIC', dest='tracked', help='topic of the tracked poses'
    )
    parser.add_argument('--predicted', metavar='TOPIC', help='topic of the predicted poses')
    parser.add_argument(
        '--model',
        metavar='NAME|FILE',
        help='model to roll out from tracked poses instead of reading predictions (default: only '
        'where the bag holds none, the shipped one)',
    )
    parser.add_argument(
        '--starts', type=int, default=20, help='number of these rollouts (default 20)'
    )
    parser.add_argument(
        '--match',
        action='store_true',
        help='match poses to spheres for these rollouts: they come in any order, or are missing',
    )
    parser.add_argument(
        '--reproduce',
        action='store_true',
        help='compute every prediction again instead, and compare bytes '
        '(exit code 1: some differ)',
    )


def default_output(bag: str | Path, suffix: str) -> Path:
    """Path beside a bag, so that no foreign file gets into its folder."""
    path = Path(bag).resolve()
    return path.with_name(f'{path.stem if path.is_file() else path.name}_evaluation{suffix}')


def run(arguments: argparse.Namespace) -> int:
    """Evaluate, print the table and the paths of what was written; returns the exit code."""
    model = getattr(arguments, 'model', None)
    if getattr(arguments, 'reproduce', False):
        return _reproduce(arguments, model)
    target = arguments.json or default_output(arguments.bag, '.json')
    figure = None
    if not arguments.no_figure:
        figure = arguments.figure or default_output(arguments.bag, '.png')
    missing = None
    if figure is not None:
        try:
            import matplotlib  # noqa: F401 - only to see whether it is there
        except ModuleNotFoundError:
            missing, figure = 'not drawn, as matplotlib is not installed', None
    report = evaluate_bag(
        arguments.bag,
        scene=arguments.scene,
        tracked=arguments.tracked,
        predicted=arguments.predicted,
        model=model,
        starts=getattr(arguments, 'starts', 20),
        match=getattr(arguments, 'match', False),
        figure=figure,
    )
    print(format_report(report))
    write_json(target, report)
    print(f'bag:     {arguments.bag}\nnumbers: {target}')
    if figure or missing:
        print(f'figure:  {figure or missing}')
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `evaluate`; returns the exit code: 0 done, 1 a difference, 2 bad input."""
    parser = argparse.ArgumentParser(
        prog='evaluate',
        description='Score predictions against the tracked poses of a recorded bag: those in it, '
        'or rollouts of a model.',
        epilog='examples:\n'
        '  evaluate bags/first\n'
        '  evaluate bags/first --reproduce\n'
        '  evaluate theirs --topic /vicon/balls --scene my_scene.yaml --model laws',
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_arguments(parser)
    arguments = parser.parse_args(argv)
    try:
        return run(arguments)
    except (ValueError, OSError) as error:
        print(f'evaluate: error: {error}', file=sys.stderr)
        return 2


def _reproduce(arguments: argparse.Namespace, model: str | None) -> int:
    from ..recordings.scoring.reproduce import reproduce

    bag = read_bag(arguments.bag)
    result = reproduce(bag, find_topics(bag, arguments.tracked, arguments.predicted), model)
    print('\n'.join([str(result), *bag.warnings]))
    if arguments.json is not None:
        write_json(arguments.json, vars(result))
        print(f'numbers: {arguments.json}')
    return 1 if result.different else 0


def _predicts(bag: Bag, tracked: str | None, scene: str | Path | None) -> bool:
    """Whether predictions are to be scored; also where only they are missing from our own bag."""
    return holds_predictions(bag) or (tracked is None and scene is None)


def _window(recorded: dict[str, Any]) -> int:
    """Tracked frames of a start, as the simulator had it, or has it by default."""
    default = next(spec.default for spec in SIMULATOR if spec.name == 'velocity_window')
    return int(recorded.get('parameters', {}).get('velocity_window', default))


def _scene(bag: Bag, recorded: dict[str, Any], scene: str | Path | None) -> Scene:
    if scene is not None:
        return load_scene(scene)[0]
    if 'scene' not in recorded:
        raise BagError(
            f'{bag.path}: no .../scene topic says what the scene is; name it with --scene. '
            f'The bag holds {listing(bag)}'
        )
    return Scene.from_mapping(recorded['scene'], 'scene of the bag')


if __name__ == '__main__':
    sys.exit(main())
