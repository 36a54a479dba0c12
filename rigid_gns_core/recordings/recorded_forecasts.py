# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forecasts of a recording, and when they began, as the simulator said or as stamps tell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .prediction_runs import from_one_start, median_period
from ..bags.reader import BagError, Topic
from ..errors import UserError
from ..forecasts.starts import Start
from ..messages.poses import decode_string, MessageError, PoseArrayFrame
from ..messages.trajectories import decode_trajectory
from ..tracking.usable_frames import Stamps


def recorded_starts(topic: Topic | None) -> list[Start]:
    """Return starts that a simulator recorded on ~/start; none where there is no such topic.

    Raises:
        BagError: A message is not what it should be.
    """
    if topic is None:
        return []
    starts = []
    for message, place in zip(topic.messages, topic.places, strict=True):
        try:
            starts.append(Start.from_json(decode_string(message), int(place)))
        except UserError as error:
            raise BagError(
                f'message {len(starts)} of {topic.name} is no start of a forecast: {error}'
            ) from error
    return sorted(starts, key=lambda start: start.place)


def starts_of(starts: Sequence[Start], frames: list[PoseArrayFrame], places: Stamps) -> Stamps:
    """Which start each prediction comes from, -1 for none, shape (frames,).

    It is the last before it in the recording; the one before that where its frame is not earlier
    than the time predicted for, as of a prediction that was held while a new forecast began.
    """
    before = np.searchsorted([start.place for start in starts], places) - 1
    chosen = np.full(len(frames), -1, dtype=np.int64)
    for index, frame in enumerate(frames):
        for candidate in (int(before[index]), int(before[index]) - 1):
            if candidate >= 0 and starts[candidate].stamp_ns < frame.stamp_ns:
                chosen[index] = candidate
                break
    return chosen


@dataclass(frozen=True)
class Forecasted:
    """Predictions of one forecast.

    Args:
        start_ns: Stamp of its start frame [ns].
        start: Which of the recorded starts it is; -1 where they were not recorded.
        stamps: Times predicted for [ns], rising, shape (k,).
        frames: Predictions.
        places: Their places in the recording, shape (k,).
    """

    start_ns: int
    start: int
    stamps: Stamps
    frames: list[PoseArrayFrame]
    places: Stamps


def forecasts(
    starts: Sequence[Start],
    frames: list[PoseArrayFrame],
    places: Stamps,
    tracked: Stamps,
    *,
    every: bool,
) -> list[Forecasted]:
    """Predictions by forecast.

    Without recorded starts, a forecast is taken to start from the tracked frame one period before
    its first prediction; where there is no such frame it is left out, as are all of
    `start: every`.

    Args:
        starts: Recorded ones, or none.
        frames: Predictions in the order of recording.
        places: Their places in the recording, shape (frames,).
        tracked: Stamps of tracked frames [ns].
        every: Whether each prediction started from a frame of its own.
    """
    found = []
    if starts:
        chosen = starts_of(starts, frames, places)
        for index in np.unique(chosen[chosen >= 0]):
            own = np.flatnonzero(chosen == index)
            found.append(_forecasted(starts[index].stamp_ns, int(index), frames, places, own))
    elif not every and len(frames) > 1:
        period = median_period(np.array([frame.stamp_ns for frame in frames], dtype=np.int64))
        for part in from_one_start(frames):
            start = frames[part.start].stamp_ns - round(period)
            if len(tracked) and np.abs(tracked - start).min() <= 2:  # stamps are whole nanoseconds
                own = np.arange(part.start, part.stop)
                found.append(_forecasted(start, -1, frames, places, own))
    return found


def recorded_futures(topic: Topic | None, starts: Sequence[Start]) -> Iterator[Forecasted]:
    """Futures of a recording; messages that are damaged are left out.

    Args:
        topic: Topic of futures; None: there are none.
        starts: Recorded starts; a future gets the last one before it with its spheres.
    """
    if topic is None:
        return
    places = [start.place for start in starts]
    for message, place in zip(topic.messages, topic.places, strict=True):
        try:
            future = decode_trajectory(message)
        except MessageError:
            continue
        if not len(future.times_ns):
            continue
        index = int(np.searchsorted(places, place)) - 1
        if index >= 0 and starts[index].ids is not None:
            names = tuple(f'sphere_{sphere}' for sphere in starts[index].ids or ())
            if names != future.names:
                continue
        stamps = future.stamp_ns + np.array(future.times_ns, dtype=np.int64)
        frames = [
            PoseArrayFrame(int(stamp), future.frame_id, poses)
            for stamp, poses in zip(stamps, future.poses, strict=True)
        ]
        yield Forecasted(
            future.stamp_ns, index, stamps, frames, np.full(len(stamps), place, dtype=np.int64)
        )


def _forecasted(
    start_ns: int, start: int, frames: list[PoseArrayFrame], places: Stamps, own: Stamps
) -> Forecasted:
    stamps = np.array([frames[index].stamp_ns for index in own], dtype=np.int64)
    order = np.argsort(stamps, kind='stable')
    own = own[order]
    return Forecasted(
        start_ns, start, stamps[order], [frames[index] for index in own], places[own]
    )
