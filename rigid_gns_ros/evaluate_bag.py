"""`evaluate BAG`: score the predicted poses of a bag against its tracked poses. No ROS needed."""

from __future__ import annotations

import argparse
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
from .bag_reader import Bag, BagError, read_bag
from .bag_topics import Topics, find_topics, listing
from .messages import decode_float64


def evaluate_bag(
    folder: str | Path,
    *,
    scene: str | Path | None = None,
    tracked: str | None = None,
    predicted: str | None = None,
    figure: str | Path | None = None,
) -> dict[str, Any]:
    """Score a bag.

    Args:
        folder: Bag folder, or an .mcap file.
        scene: Shipped name or YAML file of the scene. None: the one that the simulator recorded.
        tracked: Topic of the tracked poses. None: that of the simulator, see `find_topics`.
        predicted: Topic of the predicted poses. None: the same.
        figure: PNG to draw. None: none.

    Returns:
        What `rigid_gns_core.evaluate.evaluate` returns, and `recording` (what was compared),
        `frames` (counts), `timing` (of publishing and of model steps) and `notes` (sentences that a
        reader of the numbers needs).

    Raises:
        ValueError: The bag cannot be read, lacks a topic or a scene, or nothing overlaps.
    """
    bag = read_bag(folder)
    topics = find_topics(bag, tracked, predicted)
    predicted_topic, tracked_topic, recorded = topics.predicted, topics.tracked, topics.recorded
    the_scene = _scene(bag, recorded, scene)
    every = recorded.get('parameters', {}).get('start') == 'every'

    ours_all, theirs_all = decode_topic(predicted_topic), decode_topic(tracked_topic)
    run, breaks = longest_run(ours_all.frames, every=every)
    count = run.poses.shape[1]
    places = ours_all.places[run.part]
    usable, dropped = usable_frames(theirs_all, run.frame_id, count, places)
    if theirs_all.damaged:
        dropped['damaged'] = theirs_all.damaged
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
        'predicted_damaged': ours_all.damaged,
        'compared': len(ours),
        'compared_s': ours.steps * ours.dt,
        'restarts': breaks['restarts'],
        'missing': breaks['missing'],
        'bridged': run.bridged,
        **alignment,
    }
    stamps = np.array([frame.stamp_ns for frame in ours_all.frames], dtype=np.int64)
    report['timing'] = _timing(ours_all.times, stamps) | _step_times(topics)
    report['notes'] = _notes(bag, report, dropped, every)
    if figure is not None:
        from rigid_gns_core.figure import write_figure

        title = f'{bag.path.name}: {count} spheres, model {report["recording"]["model"]}'
        write_figure(
            figure, ours, reference, the_scene, title=title, names=('predicted', 'tracked')
        )
    return report


def format_report(report: dict[str, Any]) -> str:
    """The table of a report with its notes."""
    notes = [
        textwrap.fill(
            note, 100, initial_indent='- ', subsequent_indent='  ', break_long_words=False
        )
        for note in report['notes']
    ]
    return '\n'.join([format_table(report), *notes, ''])


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
        arguments.bag,
        scene=arguments.scene,
        tracked=arguments.tracked,
        predicted=arguments.predicted,
        figure=figure,
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


def _scene(bag: Bag, recorded: dict[str, Any], scene: str | Path | None) -> Scene:
    if scene is not None:
        return load_scene(scene)[0]
    if 'scene' not in recorded:
        raise BagError(
            f'{bag.path}: no .../scene topic says what the scene is; name it with --scene. '
            f'The bag holds {listing(bag)}'
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


def _step_times(topics: Topics) -> dict[str, float]:
    topic, recorded = topics.step_time, topics.recorded
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
        notes.append(
            'Each prediction starts from the newest frame: errors are about one period ahead.'
        )
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
    if frames['untracked']:
        notes.append(
            f'{frames["untracked"]} predictions are left out, as tracked frames are missing there '
            'for more than three of their median intervals; the longest part without is compared.'
        )
    if dropped:
        notes.append(f'Tracked frames refused: {_reasons(dropped)}.')
    if abs(report['timing']['lateness_p50_ms']) > 1e3:
        notes.append(
            'Lateness over a second: the clocks of tracker and recorder differ, or it was paused.'
        )
    return notes + list(bag.warnings)
