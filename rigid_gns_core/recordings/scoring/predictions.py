# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of the predictions that a bag holds."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TYPE_CHECKING

import numpy as np

from .horizon_errors import add_forecast, HorizonErrors
from .scored import Scored
from .timing import lateness, quantiles
from ..alignment import align
from ..prediction_runs import AlignmentError, longest_run
from ..recorded_forecasts import (
    Forecasted,
    forecasts,
    recorded_futures,
    recorded_starts,
    starts_of,
)
from ..tracked_frames import decode_topic, Decoded, Passes
from ...bags.reader import Bag
from ...bags.topics import Topics
from ...forecasts.starts import Start
from ...messages.poses import decode_float64
from ...scenes.scene import Scene
from ...scoring.evaluate import evaluate
from ...tracking.usable_frames import Stamps

if TYPE_CHECKING:
    from ..matched_frames import IdentifiedFrames


def score_predictions(bag: Bag, topics: Topics, scene: Scene) -> Scored:
    """Score the longest run of predictions, and all of them by the time since their start.

    Args:
        bag: The bag.
        topics: Its topics.
        scene: Surfaces and spheres.

    Raises:
        AlignmentError: Nothing overlaps.
    """
    predicted_topic, tracked_topic, recorded = topics.predicted, topics.tracked, topics.recorded
    every = recorded.get('parameters', {}).get('start') == 'every'
    ours_all, theirs_all = decode_topic(predicted_topic), decode_topic(tracked_topic)
    starts = recorded_starts(topics.start)
    chosen = starts_of(starts, ours_all.frames, ours_all.places) if starts else None
    groups = chosen if chosen is None or not every else _sets(starts)[chosen]
    run, breaks = longest_run(ours_all.frames, every=every, starts=groups)
    count = run.poses.shape[1]
    places = ours_all.places[run.part]
    identified = _identified(theirs_all, starts, scene, recorded)
    reference_frames = theirs_all
    if identified and chosen is not None and chosen[run.part.start] >= 0:
        reference_frames = identified.of(starts[chosen[run.part.start]])
    radius = float(np.max(scene.radius))
    usable, dropped = Passes.of(reference_frames, run.frame_id, count, radius).beside(places)
    if theirs_all.damaged:
        dropped['damaged'] = theirs_all.damaged
    if not usable:
        raise AlignmentError(
            f'no frame of {tracked_topic.name} can be compared with {predicted_topic.name} '
            f'({count} spheres in frame {run.frame_id!r}); refused: {_reasons(dropped) or "none"}'
        )
    ours, reference, alignment = align(run, usable)
    report = evaluate(ours, reference, scene, velocities='poses')
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
        'predicted_damaged': ours_all.damaged,
        'compared': len(ours),
        'compared_s': ours.steps * ours.dt,
        'restarts': breaks['restarts'],
        'missing': breaks['missing'],
        'bridged': run.bridged,
        **alignment,
    }
    if starts:
        report['frames']['starts'] = len(starts)
    predicted = forecasts(starts, ours_all.frames, ours_all.places, theirs_all.stamps, every=every)
    futures = recorded_futures(topics.trajectory, starts)
    for name, found in (('horizon_errors', predicted), ('future_errors', futures)):
        report[name] = _horizon_errors(found, theirs_all, starts, identified, radius)
    report['timing'] = (
        _timing(ours_all) | _step_times(topics) | lateness('tracked_lateness', theirs_all)
    )
    report['notes'] = _notes(bag, report, dropped, every)
    return Scored(report, scene, ours, reference)


def _sets(starts: list[Start]) -> Stamps:
    """Return the number of each start's set of spheres, -1 at the end, shape (starts + 1,)."""
    numbers: dict[tuple[int, ...] | None, int] = {}
    return np.array([*(numbers.setdefault(start.ids, len(numbers)) for start in starts), -1])


def _identified(
    tracked: Decoded, starts: list[Start], scene: Scene, recorded: dict[str, Any]
) -> IdentifiedFrames | None:
    """Who is who in the tracked frames; None where they were in the same order throughout."""
    parameters = recorded.get('parameters', {})
    if not parameters.get('match_spheres') or not starts:
        return None
    # late: the model, which gives the length of its steps, need not be there otherwise
    from ..matched_frames import IdentifiedFrames
    from ..recorded_scenes import find_recorded_model
    from ...forecasts.forecaster import Forecaster
    from ...forecasts.window_setup import window_of

    model = Forecaster(find_recorded_model(recorded, None, 'the bag'), scene)
    return IdentifiedFrames(tracked, starts, window_of(model, parameters), model)


def _horizon_errors(
    predicted: Iterable[Forecasted],
    theirs: Decoded,
    starts: list[Start],
    identified: IdentifiedFrames | None,
    radius: float,
) -> dict[str, dict[str, float]]:
    """Errors by time since the start, of forecasts in all passes and of all sets of spheres."""
    errors = HorizonErrors()
    passes: dict[tuple[int, str, int], Passes] = {}
    for one in predicted:
        if identified is not None and one.start < 0:
            continue
        known = theirs if identified is None else identified.of(starts[one.start])
        key = id(known), one.frames[0].frame_id, len(one.frames[0].poses)
        if key not in passes:
            passes[key] = Passes.of(known, *key[1:], radius)
        tracked, _ = passes[key].beside(one.places)
        if tracked:
            add_forecast(errors, one, tracked)
    return errors.report()


def _timing(predicted: Decoded) -> dict[str, float]:
    periods = np.diff(predicted.times) * 1e-6
    periods = periods[periods >= 0]  # simulated time goes back where it begins anew
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
    seconds = np.array([decode_float64(message) for message in topic.messages])
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
