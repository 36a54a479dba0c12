"""`evaluate BAG`: score the predicted poses of a bag against its tracked poses. No ROS needed."""

from __future__ import annotations

import argparse
import json
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.evaluate import evaluate, format_table, write_json
from rigid_gns_core.sampling import load_scene
from rigid_gns_core.scene import Scene

from .alignment import AlignmentError, align, decode_topic, longest_run, usable_frames
from .bag_reader import Bag, BagError, Topic, read_bag
from .messages import MessageError, decode_float64, decode_string

_POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
_STRING = 'std_msgs/msg/String'
_FLOAT64 = 'std_msgs/msg/Float64'


def evaluate_bag(
    folder: str | Path, *, scene: str | Path | None = None, tracked: str | None = None,
    predicted: str | None = None, figure: str | Path | None = None,
) -> dict[str, Any]:
    """Score a bag.

    Args:
        folder: Bag folder, or an .mcap file.
        scene: Shipped name or YAML file of the scene. None: the one that the simulator recorded.
        tracked: Topic of the tracked poses. None: the one that ends with `tracked_poses`.
        predicted: Topic of the predicted poses. None: the one that ends with `predicted_poses`.
        figure: PNG to draw. None: none.

    Returns:
        What `rigid_gns_core.evaluate.evaluate` returns, and `recording` (what was compared),
        `frames` (counts), `timing` (of publishing and of model steps) and `notes` (sentences that a
        reader of the numbers needs).

    Raises:
        ValueError: The bag cannot be read, lacks a topic or a scene, or nothing overlaps.
    """
    bag = read_bag(folder)
    predicted_topic = _find(bag, 'predicted_poses', _POSE_ARRAY, predicted, '--predicted')
    tracked_topic = _find(bag, 'tracked_poses', _POSE_ARRAY, tracked, '--tracked')
    recorded = _recorded_scene(bag, predicted_topic)
    the_scene = _scene(bag, recorded, scene)
    every = recorded.get('parameters', {}).get('start') == 'every'

    frames, log_times, damaged = decode_topic(predicted_topic)
    run, breaks = longest_run(frames, every=every)
    count = run.poses.shape[1]
    all_tracked, _, tracked_damaged = decode_topic(tracked_topic)
    usable, dropped = usable_frames(all_tracked, run.frame_id, count)
    if tracked_damaged:
        dropped['damaged'] = tracked_damaged
    if not usable:
        raise AlignmentError(
            f'no frame of {tracked_topic.name} can be compared with {predicted_topic.name} '
            f'({count} spheres in frame {run.frame_id!r}); refused: {_reasons(dropped) or "none"}'
        )
    ours, reference, alignment = align(run, usable)
    report = evaluate(ours, reference, the_scene, velocities='poses')
    report['recording'] = {
        'bag': str(bag.path),
        'predicted': predicted_topic.name,
        'tracked': tracked_topic.name,
        'model': str(recorded.get('model', 'unknown')),
        'start': str(recorded.get('parameters', {}).get('start', 'unknown')),
        'scene': the_scene.to_mapping(),
    }
    report['frames'] = {
        'tracked': len(tracked_topic),
        'tracked_refused': sum(dropped.values()),
        'predicted': len(predicted_topic),
        'predicted_damaged': damaged,
        'compared': len(ours),
        'compared_s': ours.steps * ours.dt,
        'restarts': breaks['restarts'],
        'missing': breaks['missing'],
        'bridged': run.bridged,
        **alignment,
    }
    stamps = np.array([frame.stamp_ns for frame in frames], dtype=np.int64)
    report['timing'] = _timing(log_times, stamps) | _step_times(bag, predicted_topic, recorded)
    report['notes'] = _notes(bag, report, dropped, every)
    if figure is not None:
        from rigid_gns_core.figure import write_figure

        title = f'{bag.path.name}: {count} spheres, model {report["recording"]["model"]}'
        write_figure(
            figure, ours, reference, the_scene, title=title, names=('predicted', 'tracked'),
        )
    return report


def format_report(report: dict[str, Any]) -> str:
    """The table of a report with its notes."""
    notes = [
        textwrap.fill(
            note, 100, initial_indent='- ', subsequent_indent='  ', break_long_words=False,
        )
        for note in report['notes']
    ]
    return '\n'.join([format_table(report), *notes, ''])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of `evaluate`."""
    parser.add_argument('bag', type=Path, help='bag folder or .mcap file, whole or torn')
    parser.add_argument(
        '--json', type=Path, metavar='FILE',
        help='where to write all numbers (default: BAG_evaluation.json beside the bag)',
    )
    parser.add_argument(
        '--figure', type=Path, metavar='PNG',
        help='where to draw positions, energy and error (default: BAG_evaluation.png)',
    )
    parser.add_argument('--no-figure', action='store_true', help='do not draw')
    parser.add_argument(
        '--scene', metavar='NAME|FILE', help='scene, where the bag holds none or a wrong one',
    )
    parser.add_argument('--tracked', metavar='TOPIC', help='topic of the tracked poses')
    parser.add_argument('--predicted', metavar='TOPIC', help='topic of the predicted poses')


def default_output(bag: str | Path, suffix: str) -> Path:
    """Path beside a bag, so that no foreign file gets into its folder."""
    path = Path(bag).resolve()
    return path.with_name(f'{path.stem if path.is_file() else path.name}_evaluation{suffix}')


def run(arguments: argparse.Namespace) -> int:
    """Evaluate, print the table and the paths of what was written."""
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
        arguments.bag, scene=arguments.scene, tracked=arguments.tracked,
        predicted=arguments.predicted, figure=figure,
    )
    print(format_report(report))
    write_json(target, report)
    print(f'bag:     {arguments.bag}\nnumbers: {target}')
    if figure or missing:
        print(f'figure:  {figure or missing}')
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of `evaluate`; returns the exit code: 0 done, 2 bad input."""
    parser = argparse.ArgumentParser(
        prog='evaluate',
        description='Score the predicted poses of a recorded bag against its tracked poses.',
    )
    add_arguments(parser)
    arguments = parser.parse_args(argv)
    try:
        return run(arguments)
    except (ValueError, OSError) as error:
        print(f'evaluate: error: {error}', file=sys.stderr)
        return 2


def _find(bag: Bag, suffix: str, type_name: str, name: str | None, option: str) -> Topic:
    """The topic called `name`, else the only one of that type whose last part is `suffix`."""
    if name is not None:
        found = [topic for topic in bag.topics.values() if topic.name == name]
    else:
        found = [topic for topic in bag.topics.values() if topic.name.split('/')[-1] == suffix]
    found = [topic for topic in found if topic.type_name == type_name]
    wanted = name or f'.../{suffix}'
    if len(found) != 1:
        problem = f'no topic {wanted}' if not found else f'{len(found)} topics {wanted}'
        raise BagError(
            f'{bag.path}: {problem} of type {type_name}; choose one with {option}. '
            f'The bag holds {_listing(bag)}'
        )
    if not found[0].messages:
        raise BagError(
            f'{bag.path}: {found[0].name} holds no messages. The bag holds {_listing(bag)}'
        )
    return found[0]


def _listing(bag: Bag) -> str:
    listed = [f'{t.name} ({t.type_name}, {len(t)} messages)' for t in bag.topics.values()]
    return ', '.join(sorted(listed)) or 'no topics'


def _beside(bag: Bag, predicted: Topic, suffix: str, type_name: str) -> Topic | None:
    """A topic of the node that predicted: that in the same namespace, where there are several."""
    found = [
        topic for topic in bag.topics.values()
        if topic.name.endswith(f'/{suffix}') and topic.type_name == type_name and topic.messages
    ]
    namespace = predicted.name.rsplit('/', 1)[0]
    near = [topic for topic in found if topic.name.rsplit('/', 2)[0] == namespace]
    chosen = near if len(near) == 1 else found
    return chosen[0] if len(chosen) == 1 else None


def _recorded_scene(bag: Bag, predicted: Topic) -> dict[str, Any]:
    """What the simulator said about itself on ~/scene; empty where there is nothing."""
    topic = _beside(bag, predicted, 'scene', _STRING)
    if topic is None:
        return {}
    try:
        content = json.loads(decode_string(topic.messages[-1]))
    except (MessageError, json.JSONDecodeError) as error:
        raise BagError(f'{bag.path}: {topic.name} holds no JSON: {error}') from error
    return content if isinstance(content, dict) else {}


def _scene(bag: Bag, recorded: dict[str, Any], scene: str | Path | None) -> Scene:
    if scene is not None:
        return load_scene(scene)[0]
    if 'scene' not in recorded:
        raise BagError(
            f'{bag.path}: no .../scene topic says what the scene is; name it with --scene. '
            f'The bag holds {_listing(bag)}'
        )
    return Scene.from_mapping(recorded['scene'], 'scene of the bag')


def _timing(log_times: NDArray[np.int64], stamps: NDArray[np.int64]) -> dict[str, float]:
    periods = np.diff(log_times) * 1e-6
    lateness = (log_times - stamps) * 1e-6
    return {
        'publishing_rate_hz': 1e3 / float(periods.mean()) if periods.mean() > 0 else float('inf'),
        'period_mean_ms': float(periods.mean()),
        'period_std_ms': float(periods.std()),
        **_quantiles('lateness', lateness),
    }


def _step_times(bag: Bag, predicted: Topic, recorded: dict[str, Any]) -> dict[str, float]:
    topic = _beside(bag, predicted, 'step_time', _FLOAT64)
    dt = {'model_dt_ms': 1e3 * float(recorded['dt'])} if 'dt' in recorded else {}
    if topic is None:
        return dt
    seconds = np.array([decode_float64(message) for message in topic.messages])
    return _quantiles('step', 1e3 * seconds) | {'steps_timed': len(seconds)} | dt


def _quantiles(name: str, milliseconds: NDArray[np.floating]) -> dict[str, float]:
    return {
        f'{name}_p50_ms': float(np.median(milliseconds)),
        f'{name}_p99_ms': float(np.quantile(milliseconds, 0.99)),
        f'{name}_max_ms': float(milliseconds.max()),
    }


def _reasons(dropped: dict[str, int]) -> str:
    return ', '.join(f'{number} for their {reason}' for reason, number in dropped.items())


def _notes(bag: Bag, report: dict[str, Any], dropped: dict[str, int], every: bool) -> list[str]:
    frames = report['frames']
    noise = (
        'Tracked poses are measured: the column of the reference holds the noise of the tracker, '
        'as energy gain and penetration above all. Noise of 1 mm is '
        f'{1.4e-3 / report["dt"]:.2g} m/s in velocities over {1e3 * report["dt"]:.4g} ms.'
    )
    notes = [noise, 'Lateness is the log time minus the stamp; a stamp is the time predicted for.']
    if every:
        notes.append('Each prediction starts from a tracked frame: errors are one period ahead.')
    if frames['restarts'] and not every:
        notes.append(
            f'The prediction started anew {frames["restarts"]} times; the longest stretch, '
            f'{frames["compared_s"]:.1f} s, is compared.'
        )
    if frames['bridged']:
        notes.append(f'{frames["bridged"]} predictions are missing and were interpolated.')
    if frames['interpolated']:
        notes.append(
            f'{frames["interpolated"]} of {frames["compared"]} tracked poses are interpolated '
            f'between frames up to {frames["tracked_interval_s"]:.3g} s apart.'
        )
    if dropped:
        notes.append(f'Tracked frames refused: {_reasons(dropped)}.')
    if abs(report['timing']['lateness_p50_ms']) > 1e3:
        notes.append(
            'Lateness over a second: the clocks of tracker and recorder differ, or it was paused.'
        )
    return notes + list(bag.warnings)
