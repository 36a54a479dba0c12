# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scores of rollouts of a model from the tracked poses of any bag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from .bag_score import BagScore
from .horizon_errors import HorizonErrors, HORIZONS, TOLERANCE
from .rotations import leave_out_unknown
from .timing import lateness
from ..decoded_topic import decode_topic
from ..matched_frames import segment_matched_frames
from ..prediction_runs import AlignmentError
from ..resample import resample
from ..scene_frame import in_scene_frame
from ..tracked_frames import MATCH_REMEDY, Segment, segment_frames
from ..units import check_units
from ...bags.reader import Bag, Topic
from ...errors import UserError
from ...forecasts.forecaster import Forecast, Forecaster
from ...forecasts.window_setup import window_of
from ...messages.poses import PoseArrayFrame
from ...scenes.scene import Scene
from ...scenes.state import Array, Trajectory
from ...scoring.evaluate import evaluate
from ...tracking.usable_frames import GAP

# longest rollout for laws and errors [s]
LONGEST = 30.0


@dataclass(frozen=True)
class RolloutOptions:
    """Options of the rollouts.

    Args:
        model: Name or path; empty: the shipped default.
        starts: Number of start times, evenly over the recording.
        window: Number of tracked frames from which velocities are fitted at a start.
        matched: Whether poses are associated with tracks, as they come in any order or are
            missing.
        frame: Coordinate frame of the scene, see `in_scene_frame`; None: poses are as they are.
    """

    model: str = ''
    starts: int = 20
    window: int = 6
    matched: bool = False
    frame: str | None = None

    def __post_init__(self) -> None:
        for name in ('starts', 'window'):
            if getattr(self, name) < 1:
                raise UserError(f'{name} is {getattr(self, name)}, expected at least 1')


class _Reference:
    """Tracked poses of one segment, resampled at any times within it, see `resample`."""

    def __init__(self, segment: Segment, scene: Scene, noise: float) -> None:
        self.segment, self._scene, self._noise = segment, scene, noise

    def at(self, stamps: Array) -> tuple[Array, Array]:
        """Positions [m], shape (m, n, 3), and quaternions, shape (m, n, 4), at stamps [ns]."""
        found = resample(
            self.segment.times,
            self.segment.poses[..., :3],
            self.segment.poses[..., 3:],
            np.clip((stamps - self.segment.stamps[0]) * 1e-9, 0.0, self.segment.times[-1]),
            scene=self._scene,
            noise=self._noise,
        )
        return found.positions, found.quaternions


def score_rollouts(bag: Bag, topic: Topic, scene: Scene, options: RolloutOptions) -> BagScore:
    """Roll a model out from tracked frames at several times, and score it against later frames.

    Frames are cut into segments where the number of spheres changes (their set, where poses are
    matched), where more than two frames in a row are missing, and where the tracker restarted.
    Laws and errors are of one rollout over the longest segment; `horizon_errors` are of all
    starts.

    Args:
        bag: The bag.
        topic: Topic of the tracked poses.
        scene: Surfaces and spheres.
        options: Model and starts.

    Raises:
        AlignmentError: No segment is long enough.
        UserError: The model is missing, or does not support the scene.
    """
    decoded = in_scene_frame(bag, decode_topic(topic), options.frame)
    interval = decoded.interval(f'{bag.path}: {topic.name}')
    model = Forecaster(options.model, scene)
    gap = GAP * interval * 1e9
    parts = (
        segment_matched_frames(decoded, model, {'velocity_window': options.window}, gap)
        if options.matched
        else segment_frames(decoded, scene, gap)
    )
    noise = parts.noise().position
    check_units(parts.segments, scene, noise, f'{bag.path}: {topic.name}')
    refused, notes = Counter(parts.refused), []
    references = []
    for part in parts.segments:
        try:
            notes += model.check(part.poses.shape[1])
        except UserError as error:
            refused['count'] += len(part.stamps)
            notes.append(str(error))
            continue
        references.append(_Reference(part, scene, noise))
    starts = _starts(references, options, _seconds(model, HORIZONS[0]))
    if not starts:
        longest = max((part.times[-1] for part in parts.segments), default=0.0)
        raise AlignmentError(
            f'{bag.path}: no stretch of {topic.name} holds {options.window} frames and '
            f'{HORIZONS[0]:g} s after them; the longest of {len(parts.segments)} has '
            f'{longest:.3g} s (refused: {dict(refused) or "none"}; cuts: {parts.cuts or "none"}'
            + (f'; {notes[0]}' if notes else '')
            + ')'
            + (f'; {problem}' if (problem := decoded.refusal(model.radius)) else '')
            + (f'; {MATCH_REMEDY}' if 'count' in parts.cuts else '')
        )
    errors, begun = HorizonErrors(), 0
    for reference, frames in starts:
        for forecast in _forecasts(model, reference.segment, frames, options.window):
            begun += _score(errors, forecast, reference, model)
    wanted = sum(len(frames) for _, frames in starts)
    report, drawn = _whole(model, max(references, key=_duration), options)
    notes += leave_out_unknown(report, drawn[1])
    report['recording'] = {
        'bag': str(bag.path),
        'predicted': f'rolled out from {begun} of the tracked frames',
        'tracked': topic.name,
        'model': model.simulator.name,
        'start': 'offline',
        'scene': scene.to_mapping(),
        'damage': list(bag.warnings),
    }
    report['frames'] = {
        'tracked': len(topic),
        'tracked_refused': sum(refused.values()) + decoded.damaged,
        'segments': len(parts.segments),
        'cuts': sum(parts.cuts.values()),
        'starts': begun,
        'starts_failed': wanted - begun,
        'compared': len(drawn[0]),
        'compared_s': drawn[0].steps * drawn[0].dt,
        'tracked_interval_s': interval,
        'tracked_noise_m': noise,
    }
    report['horizon_errors'] = errors.report()
    report['timing'] = lateness('tracked_lateness', decoded)
    report['notes'] = _notes(parts.cuts, refused, sorted(set(notes)), options) + list(bag.warnings)
    return BagScore(report, scene, *drawn)


def _starts(
    references: list[_Reference], options: RolloutOptions, shortest: float
) -> list[tuple[_Reference, set[int]]]:
    """Indices of start frames by segment, evenly over all possible ones."""
    found = []
    for segment_index, reference in enumerate(references):
        times = reference.segment.times
        last = int(np.searchsorted(times, times[-1] - shortest + 1e-9, side='right'))
        found += [(segment_index, frame) for frame in range(options.window - 1, last)]
    if not found:
        return []
    chosen = np.unique(np.linspace(0, len(found) - 1, options.starts).round().astype(int))
    by_segment: dict[int, set[int]] = {}
    for index in chosen:
        segment_index, frame = found[index]
        by_segment.setdefault(segment_index, set()).add(frame)
    return [(references[segment_index], frames) for segment_index, frames in by_segment.items()]


def _forecasts(
    model: Forecaster, segment: Segment, wanted: Container[int], length: int
) -> Iterator[Forecast]:
    """Forecasts from frames of a segment, with all earlier frames in the window as in the node.

    Frames that give no start are left out.
    """
    window = window_of(model, {'frame_id': '', 'velocity_window': length, 'max_spheres': 100_000})
    for index, stamp in enumerate(segment.stamps.tolist()):
        try:
            window.add(PoseArrayFrame(stamp, '', segment.poses[index]), stamp)
            if index in wanted and window.full:
                start, state = window.start()
                yield model.forecast(state, start, window.ids)
        except UserError:  # the frame is refused, or the model cannot start from it
            continue


def _duration(reference: _Reference) -> float:
    return float(reference.segment.times[-1])


def _seconds(model: Forecaster, horizon: float) -> float:
    """The horizon, rounded to whole model steps where that changes it by less than 10 % [s].

    Between two steps, poses are interpolated linearly, which in flight is off by up to g dt^2 / 8.
    """
    whole = round(horizon / model.native_dt) * model.native_dt
    return whole if abs(whole - horizon) <= TOLERANCE * horizon else horizon


def _score(
    errors: HorizonErrors, forecast: Forecast, reference: _Reference, model: Forecaster
) -> bool:
    """Add the errors of one rollout; whether it reached any horizon."""
    segment, scored = reference.segment, False
    for horizon in HORIZONS:
        seconds = _seconds(model, horizon)
        stamp = forecast.start_ns + round(seconds * 1e9)
        if stamp > segment.stamps[-1]:
            break
        tracked = reference.at(np.array([stamp]))[0][0]
        try:
            predicted = forecast.advance_to(stamp).poses[:, :3]
        except (UserError, FloatingPointError):  # diverged: infinitely far off
            predicted = np.full_like(tracked, np.inf)
        errors.add(horizon, seconds, predicted, tracked)
        scored = True
    return scored


def _whole(
    model: Forecaster, reference: _Reference, options: RolloutOptions
) -> tuple[dict[str, Any], tuple[Trajectory, Trajectory]]:
    """Report of one rollout over the longest segment, and the two trajectories."""
    segment = reference.segment
    forecast = next(
        _forecasts(model, segment, range(options.window - 1, len(segment.stamps)), options.window),
        None,
    )
    begin = segment.stamps[-1] if forecast is None else forecast.start_ns
    steps = int(min((segment.stamps[-1] - begin) * 1e-9, LONGEST) / model.native_dt + 1e-6)
    if forecast is None or steps < 1:
        raise AlignmentError(
            f'no frame of the longest stretch, {segment.times[-1]:.3g} s, gives a start with a '
            f'step of {model.native_dt:.3g} s after it'
        )
    stamps = forecast.start_ns + np.round(np.arange(steps + 1) * model.native_dt * 1e9).astype(int)
    positions, quaternions = reference.at(stamps)
    start = forecast.rollout.state
    poses = [np.concatenate([start.positions, start.quaternions], axis=1)]
    for stamp in stamps[1:]:
        try:
            poses.append(forecast.advance_to(int(stamp)).poses)
        except (UserError, FloatingPointError):
            poses.append(np.full_like(poses[0], np.nan))
    predicted = np.stack(poses)
    dt = model.native_dt
    with np.errstate(invalid='ignore'):
        predictions = Trajectory.from_poses(predicted[..., :3], predicted[..., 3:], dt)
    theirs = Trajectory.from_poses(positions, quaternions, dt)
    return evaluate(predictions, theirs, model.scene, velocities='poses'), (predictions, theirs)


def _notes(
    cuts: dict[str, int], refused: Counter[str], warnings: list[str], options: RolloutOptions
) -> list[str]:
    how = (
        'The bag is scored by rollouts made now: laws and errors are of one over the longest '
        'stretch of tracked frames, from its start; errors since a start are of all starts, each '
        f'with velocities from {options.window} frames.'
    )
    measured = (
        'Tracked poses are measured: errors and the column of the reference hold the noise of the '
        'tracker.'
    )
    notes = [how, measured]
    if cuts:
        names = {
            'gap': 'missing frames',
            'count': 'another number of spheres',
            'anew': 'restarts',
            'set': 'another set of spheres',
        }
        text = ', '.join(f'{number} for {names[reason]}' for reason, number in cuts.items())
        remedy = f' {MATCH_REMEDY}.' if 'count' in cuts else ''
        notes.append(f'The tracked frames were cut: {text}.{remedy}')
    if refused:
        text = ', '.join(f'{number} for their {reason}' for reason, number in refused.items())
        notes.append(f'Tracked frames refused: {text}.')
    return notes + warnings
