# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recorded forecasts and their starts, from ~/start or, without it, from the stamps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from .prediction_runs import median_period, split_by_start
from ..bags.reader import BagError, Topic
from ..errors import UserError
from ..forecasts.learned_scene import LearnedScene
from ..forecasts.starts import Start
from ..messages.poses import decode_string, MessageError, PoseArrayFrame
from ..messages.trajectories import decode_trajectory, FutureFrame
from ..scenes.state import Array
from ..tracking.usable_frames import Stamps

Event = TypeVar('Event', Start, LearnedScene)


def recorded_starts(topic: Topic | None) -> list[Start]:
    """Starts on the topic ~/start in the order of recording; none without such a topic.

    Raises:
        BagError: A message is not a start.
    """
    return _read(topic, Start.from_json, 'start of a forecast')


def recorded_learned(topic: Topic | None) -> list[LearnedScene]:
    """Scenes on the topic ~/learned in the order of recording; none without such a topic.

    Raises:
        BagError: A message is no such scene.
    """
    return _read(topic, LearnedScene.from_json, 'scene')


def _read(topic: Topic | None, from_json: Callable[[str, int], Event], what: str) -> list[Event]:
    """What the strings on a topic hold, in the order of recording."""
    if topic is None:
        return []
    found = []
    for message, record_index in zip(topic.messages, topic.indices, strict=True):
        try:
            found.append(from_json(decode_string(message), int(record_index)))
        except UserError as error:
            raise BagError(
                f'message {len(found)} of {topic.name} is no {what}: {error}'
            ) from error
    return sorted(found, key=lambda event: event.index)


def starts_of(starts: Sequence[Start], frames: list[PoseArrayFrame], indices: Stamps) -> Stamps:
    """Index of the start of each prediction, -1 for none, shape (frames,).

    It is the last start recorded before the prediction; or the one before that, where the last has
    a later stamp, as for a prediction that was pending while a new forecast started.
    """
    before = np.searchsorted([start.index for start in starts], indices) - 1
    chosen = np.full(len(frames), -1, dtype=np.int64)
    for index, frame in enumerate(frames):
        for candidate in (int(before[index]), int(before[index]) - 1):
            if candidate >= 0 and starts[candidate].stamp_ns < frame.stamp_ns:
                chosen[index] = candidate
                break
    return chosen


@dataclass(frozen=True)
class RecordedForecast:
    """Predictions of one forecast.

    Args:
        start_ns: Stamp of its start frame [ns].
        start: Index of its recorded start; -1: not recorded.
        stamps: Predicted times [ns], rising, shape (k,).
        frames: Predictions.
        indices: Index of each in the order of recording, shape (k,).
        covariances: Published ones of the centres [m^2], shape (k, n, 3, 3); None: there are none.
    """

    start_ns: int
    start: int
    stamps: Stamps
    frames: list[PoseArrayFrame]
    indices: Stamps
    covariances: Array | None = None


def predictions_by_forecast(
    starts: Sequence[Start],
    frames: list[PoseArrayFrame],
    indices: Stamps,
    tracked: Stamps,
    *,
    every: bool,
) -> list[RecordedForecast]:
    """Predictions grouped by forecast.

    Without recorded starts, a forecast is assumed to start from the tracked frame one period
    before its first prediction. Without such a frame it is left out, as are all with `start:
    every`.

    Args:
        starts: Recorded starts; empty: not recorded.
        frames: Predictions in the order of recording.
        indices: Index of each in the order of recording, shape (frames,).
        tracked: Stamps of the tracked frames [ns], shape (m,).
        every: Whether each prediction had its own start.
    """
    found = []
    if starts:
        chosen = starts_of(starts, frames, indices)
        for index in np.unique(chosen[chosen >= 0]):
            own = np.flatnonzero(chosen == index)
            found.append(
                _recorded_forecast(starts[index].stamp_ns, int(index), frames, indices, own)
            )
    elif not every and len(frames) > 1:
        period = median_period(np.array([frame.stamp_ns for frame in frames], dtype=np.int64))
        for part in split_by_start(frames):
            start = frames[part.start].stamp_ns - round(period)
            if len(tracked) and np.abs(tracked - start).min() <= 2:  # stamps are whole nanoseconds
                own = np.arange(part.start, part.stop)
                found.append(_recorded_forecast(start, -1, frames, indices, own))
    return found


def recorded_futures(
    topic: Topic | None, starts: Sequence[Start], deviations: Topic | None = None
) -> Iterator[RecordedForecast]:
    """Recorded trajectories, each as a forecast; damaged messages are left out.

    Args:
        topic: Topic of predicted trajectories; None: not recorded.
        starts: Recorded starts; a trajectory gets the last one before it, if it has its spheres.
        deviations: Topic of their deviations; None: not recorded.
    """
    if topic is None:
        return
    spreads = _by_stamp(deviations)
    indices = [start.index for start in starts]
    for message, record_index in zip(topic.messages, topic.indices, strict=True):
        try:
            future = decode_trajectory(message)
        except MessageError:
            continue
        if not len(future.times_ns):
            continue
        index = int(np.searchsorted(indices, record_index)) - 1
        if index >= 0 and starts[index].ids is not None:
            names = tuple(f'sphere_{sphere}' for sphere in starts[index].ids or ())
            if names != future.names:
                continue
        stamps = future.stamp_ns + np.array(future.times_ns, dtype=np.int64)
        frames = [
            PoseArrayFrame(int(stamp), future.frame_id, poses)
            for stamp, poses in zip(stamps, future.poses, strict=True)
        ]
        yield RecordedForecast(
            future.stamp_ns,
            index,
            stamps,
            frames,
            np.full(len(stamps), record_index, dtype=np.int64),
            _covariances(future, spreads.get(future.stamp_ns)),
        )


def _by_stamp(topic: Topic | None) -> dict[int, FutureFrame]:
    """Intact messages by stamp."""
    found = {}
    for message in topic.messages if topic is not None else ():
        try:
            one = decode_trajectory(message)
        except MessageError:
            continue
        found[one.stamp_ns] = one
    return found


def _covariances(future: FutureFrame, spread: FutureFrame | None) -> Array | None:
    """Covariances of the centres by deviations and correlations of the same points, or None."""
    if spread is None or (spread.names, spread.times_ns) != (future.names, future.times_ns):
        return None
    deviations, (xy, xz, yz) = spread.poses[..., :3], np.moveaxis(spread.twists[..., 3:], -1, 0)
    one = np.ones_like(xy)
    rows = [[one, xy, xz], [xy, one, yz], [xz, yz, one]]
    correlations = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    found: Array = deviations[..., :, None] * deviations[..., None, :] * correlations
    return found


def _recorded_forecast(
    start_ns: int, start: int, frames: list[PoseArrayFrame], indices: Stamps, own: Stamps
) -> RecordedForecast:
    stamps = np.array([frames[index].stamp_ns for index in own], dtype=np.int64)
    order = np.argsort(stamps, kind='stable')
    own = own[order]
    return RecordedForecast(
        start_ns, start, stamps[order], [frames[index] for index in own], indices[own]
    )
