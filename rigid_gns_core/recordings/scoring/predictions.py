# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of the predictions in a bag."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TYPE_CHECKING

import numpy as np

from .bag_score import BagScore
from .horizon_errors import add_forecast, HorizonErrors
from .rotations import leave_out_unknown
from .timing import lateness, quantiles, step_times
from ..alignment import align
from ..decoded_topic import decode_topic, DecodedTopic
from ..prediction_runs import AlignmentError, ranked_runs, Run
from ..recorded_forecasts import (
    predictions_by_forecast,
    recorded_futures,
    recorded_learned,
    recorded_starts,
    RecordedForecast,
    starts_of,
)
from ..tracked_frames import Passes
from ..units import check_topic_units
from ...bags.reader import Bag
from ...bags.topics import Topics
from ...forecasts.learned_scene import LearnedScene
from ...forecasts.starts import Start
from ...scenes.scene import Scene
from ...scenes.state import Trajectory
from ...scoring.evaluate import evaluate
from ...tracking.usable_frames import Stamps

if TYPE_CHECKING:
    from ..matched_frames import IdentifiedFrames


def score_predictions(bag: Bag, topics: Topics, scene: Scene) -> BagScore:
    """Score the run of predictions of which most can be compared, and all by their lead times.

    Args:
        bag: The bag.
        topics: Topics of its simulator.
        scene: Surfaces and spheres.

    Raises:
        AlignmentError: Predictions and tracked poses do not overlap.
    """
    predicted_topic, tracked_topic, recorded = topics.predicted, topics.tracked, topics.recorded
    every = recorded.get('parameters', {}).get('start') == 'every'
    all_predictions, all_tracked = decode_topic(predicted_topic), decode_topic(tracked_topic)
    starts = recorded_starts(topics.start)
    chosen = starts_of(starts, all_predictions.frames, all_predictions.indices) if starts else None
    groups = chosen if chosen is None or not every else _sphere_sets(starts)[chosen]
    runs, breaks = ranked_runs(
        all_predictions.frames, all_tracked.stamps, every=every, starts=groups
    )
    radius = float(np.max(scene.radius))
    check_topic_units(all_tracked, scene, f'{bag.path}: {topics.tracked.name}')
    learned = recorded_learned(topics.learned)
    identified = _identified(all_tracked, starts, scene, recorded, learned)

    def tracked_beside(run: Run) -> DecodedTopic:
        if identified and chosen is not None and chosen[run.part.start] >= 0:
            return identified.of(starts[chosen[run.part.start]])
        return all_tracked

    run, compared, reference, dropped, alignment = _compare(
        runs, tracked_beside, all_predictions.indices, radius, topics
    )
    if all_tracked.damaged:
        dropped['damaged'] = all_tracked.damaged
    report = evaluate(compared, reference, scene, velocities='poses')
    unknown = leave_out_unknown(report, reference)
    report['recording'] = {
        'bag': str(bag.path),
        'predicted': predicted_topic.name,
        'tracked': tracked_topic.name,
        'model': str(recorded.get('model', 'unknown')),
        'start': str(recorded.get('parameters', {}).get('start', 'unknown')),
        'scene': scene.to_mapping(),
        'damage': list(bag.warnings),
    }
    report['frames'] = {
        'tracked': len(tracked_topic),
        'tracked_refused': sum(dropped.values()),
        'predicted': len(predicted_topic),
        'predicted_damaged': all_predictions.damaged,
        'compared': len(compared),
        'compared_s': compared.steps * compared.dt,
        'restarts': breaks['restarts'],
        'missing': breaks['missing'],
        'bridged': run.bridged,
        **alignment,
    }
    if starts:
        report['frames']['starts'] = len(starts)
    predicted = predictions_by_forecast(
        starts, all_predictions.frames, all_predictions.indices, all_tracked.stamps, every=every
    )
    futures = recorded_futures(topics.trajectory, starts, topics.deviations)
    for name, found in (('horizon_errors', predicted), ('future_errors', futures)):
        report[name] = _horizon_errors(found, all_tracked, starts, identified, radius)
    report['timing'] = (
        _timing(all_predictions) | _step_times(topics) | lateness('tracked_lateness', all_tracked)
    )
    report['notes'] = unknown + _notes(bag, report, dropped, every)
    return BagScore(report, scene, compared, reference)


def _compare(
    runs: Iterable[Run],
    tracked_beside: Callable[[Run], DecodedTopic],
    indices: Stamps,
    radius: float,
    topics: Topics,
) -> tuple[Run, Trajectory, Trajectory, dict[str, int], dict[str, float]]:
    """The first run that can be compared: predicted, tracked, frames refused, and counts.

    Raises:
        AlignmentError: None can; the message is that of the first.
    """
    passes: dict[tuple[int, str, int], Passes] = {}
    failure: AlignmentError | None = None
    for run in runs:
        known = tracked_beside(run)
        key = id(known), run.frame_id, run.poses.shape[1]
        if key not in passes:
            passes[key] = Passes.of(known, *key[1:], radius)
        usable, dropped = passes[key].beside(indices[run.part])
        try:
            if not usable:
                problem = known.problem if known.damaged else known.refusal(radius)
                raise AlignmentError(
                    f'no frame of {topics.tracked.name} can be compared with '
                    f'{topics.predicted.name} ({key[2]} spheres in frame {run.frame_id!r}); '
                    f'refused: {_reasons(dropped) or "none"}' + (f'; {problem}' if problem else '')
                )
            compared, reference, alignment = align(run, usable)
        except AlignmentError as error:
            failure = failure or error
        else:
            return run, compared, reference, dropped, alignment
    raise failure or AlignmentError('there is no run of predictions')


def _sphere_sets(starts: list[Start]) -> Stamps:
    """Number of each start's set of spheres, and a final -1, shape (starts + 1,)."""
    numbers: dict[tuple[int, ...] | None, int] = {}
    return np.array([*(numbers.setdefault(start.ids, len(numbers)) for start in starts), -1])


def _identified(
    tracked: DecodedTopic,
    starts: list[Start],
    scene: Scene,
    recorded: dict[str, Any],
    learned: list[LearnedScene],
) -> IdentifiedFrames | None:
    """Tracked frames with their association; None where poses kept their order."""
    parameters = recorded.get('parameters', {})
    if not parameters.get('match_spheres') or not starts:
        return None
    # imported late: only this needs the model, for the length of its steps
    from ..matched_frames import IdentifiedFrames
    from ..recorded_simulators import find_recorded_model
    from ...forecasts.forecaster import Forecaster
    from ...forecasts.window_setup import window_of

    model = Forecaster(find_recorded_model(recorded, None, 'the bag'), scene)
    return IdentifiedFrames(tracked, starts, window_of(model, parameters), model, learned)


def _horizon_errors(
    predicted: Iterable[RecordedForecast],
    all_tracked: DecodedTopic,
    starts: list[Start],
    identified: IdentifiedFrames | None,
    radius: float,
) -> dict[str, dict[str, float]]:
    """Errors by time since the start, of all forecasts."""
    errors = HorizonErrors()
    passes: dict[tuple[int, str, int], Passes] = {}
    for forecast in predicted:
        if identified is not None and forecast.start < 0:
            continue
        known = all_tracked if identified is None else identified.of(starts[forecast.start])
        key = id(known), forecast.frames[0].frame_id, len(forecast.frames[0].poses)
        if key not in passes:
            passes[key] = Passes.of(known, *key[1:], radius)
        tracked, _ = passes[key].beside(forecast.indices)
        if tracked:
            noise = starts[forecast.start].noise if forecast.start >= 0 else None
            add_forecast(errors, forecast, tracked, noise or 0.0)
    return errors.report()


def _timing(predicted: DecodedTopic) -> dict[str, float]:
    periods = np.diff(predicted.times) * 1e-6
    periods = periods[periods >= 0]  # simulated time goes back where it restarts
    late = lateness('lateness', predicted)
    if not periods.any():
        return late
    mean = float(periods.mean())
    return {
        'publishing_rate_hz': 1e3 / mean,
        'period_mean_ms': mean,
        'period_std_ms': float(periods.std()),
        **late,
    }


def _step_times(topics: Topics) -> dict[str, float]:
    topic, recorded = topics.step_time, topics.recorded
    dt = {'model_dt_ms': 1e3 * float(recorded['dt'])} if 'dt' in recorded else {}
    if topic is None:
        return dt
    _, seconds = step_times(topic)
    if not len(seconds):
        return dt
    return quantiles('step', 1e3 * seconds) | {'steps_timed': len(seconds)} | dt


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
            f'The prediction restarted {frames["restarts"]} times; the longest run with '
            f'tracked poses, {frames["compared_s"]:.1f} s, is compared.'
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
            'for more than two frames; the longest part without is compared.'
        )
    if dropped:
        notes.append(f'Tracked frames refused: {_reasons(dropped)}.')
    if 'publishing_rate_hz' not in report['timing']:
        notes.append(
            'Predictions have no rate: the log time of none is later than of the one before.'
        )
    if abs(report['timing']['lateness_p50_ms']) > 1e3:
        notes.append(
            'Lateness over a second: the clocks of tracker and recorder differ, or it was paused.'
        )
    return notes + list(bag.warnings)
