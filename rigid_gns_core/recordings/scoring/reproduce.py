# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reproduction: predictions of a bag are computed again and compared byte by byte.

On the machine that recorded a bag, with the same version of this package, all bytes are the same;
elsewhere other vector instructions may round differently.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..decoded_topic import decode_topic, DecodedTopic
from ..prediction_runs import split_by_start
from ..recorded_forecasts import recorded_learned, recorded_starts, starts_of
from ..recorded_simulators import find_recorded_model
from ..replay import replay_starts
from ...bags.reader import Bag, BagError, Topic
from ...bags.topics import Topics
from ...errors import UserError
from ...forecasts.forecaster import Forecast, Forecaster
from ...forecasts.node_parameters import with_defaults
from ...forecasts.starts import Start
from ...forecasts.window_setup import window_of
from ...messages.poses import decode_pose_array, MessageError, PoseArrayCodec, PoseArrayFrame
from ...scenes.scene import Scene
from ...tracking.usable_frames import RejectedFrame, seconds


@dataclass
class Reproduction:
    """Result of a reproduction.

    Args:
        predictions: Number of predictions in the bag.
        same: Number reproduced byte for byte.
        different: Number reproduced with other bytes.
        unknown: Number whose start is not known, or whose tracked frames are not in the bag.
        starts: Number of forecasts computed.
        first_difference: First prediction that differs, and by how much; None: none differs.
        notes: Sentences on what could not be compared.
    """

    predictions: int = 0
    same: int = 0
    different: int = 0
    unknown: int = 0
    starts: int = 0
    first_difference: dict[str, Any] | None = None
    notes: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        text = (
            f'reproduced: {self.same} of {self.predictions} predictions are the same bytes, '
            f'{self.different} differ, {self.unknown} have no known start'
        )
        if self.first_difference:
            first = self.first_difference
            text += (
                f'\nfirst to differ: prediction {first["index"]} for {first["stamp_s"]} s, from '
                f'the start at {first["start_s"]} s: {first["largest_m"]:.3g} m in a position, '
                f'{first["values"]} of its numbers'
            )
        return '\n'.join([text, *self.notes])


def reproduce(bag: Bag, topics: Topics, model: str | None = None) -> Reproduction:
    """Compute all predictions of a bag again.

    Where a bag holds no ~/start, predictions with `start: first` are computed from the first
    window of tracked frames, up to the first stamp that shows another start.

    Args:
        bag: The bag.
        topics: Topics of its simulator, see `find_topics`.
        model: Name or path of the model. None: the recorded one, identified by its card.

    Raises:
        UserError: The bag does not say how it was recorded, or the model is missing.
    """
    recorded = topics.recorded
    for key in ('scene', 'model_card', 'parameters'):
        if key not in recorded:
            raise BagError(
                f'{bag.path}: nothing on ~/scene says the {key}, so no prediction can be '
                'computed again; record with this package'
            )
    parameters = with_defaults(recorded['parameters'])
    model_in_scene = Forecaster(
        find_recorded_model(recorded, model, str(bag.path)),
        Scene.from_mapping(recorded['scene'], 'scene of the bag'),
        rate=parameters['rate'],
        threads=parameters['threads'],
    )
    predictions, tracked = decode_topic(topics.predicted), decode_topic(topics.tracked)
    result = Reproduction(len(topics.predicted), unknown=predictions.damaged)
    starts = recorded_starts(topics.start)
    if starts:
        chosen = starts_of(starts, predictions.frames, predictions.indices)
    else:
        starts, chosen = _first_start(model_in_scene, predictions, tracked, parameters, result)
    messages = _whole_messages(topics.predicted)
    window = window_of(model_in_scene, parameters)
    replay = replay_starts(
        window,
        tracked,
        starts,
        learned=recorded_learned(topics.learned),
        on_learned=lambda learned: model_in_scene.take_scene(learned.scene),
    )
    for index, (start, error) in enumerate(replay):
        own = np.flatnonzero(chosen == index)
        if not len(own):
            continue
        try:
            if error:
                raise BagError(error)
            _, state = window.start(tuple(start.surfaces.values()))
            forecast = model_in_scene.forecast(state, start.stamp_ns, window.ids, start.surfaces)
        except UserError as reason:
            result.unknown += len(own)
            result.notes.append(f'start at {seconds(start.stamp_ns)} s: {reason}')
            continue
        result.starts += 1
        _compare(result, forecast, [(int(k), predictions.frames[k], messages[k]) for k in own])
    result.unknown += int((chosen < 0).sum())
    return result


def _whole_messages(topic: Topic) -> list[bytes]:
    """Bytes of the messages that `decode_topic` decodes, in its order."""
    whole = []
    for message in topic.messages:
        try:
            decode_pose_array(message)
        except MessageError:
            continue
        whole.append(bytes(message))
    return whole


def _first_start(
    model_in_scene: Forecaster,
    predictions: DecodedTopic,
    tracked: DecodedTopic,
    parameters: dict[str, Any],
    result: Reproduction,
) -> tuple[list[Start], np.ndarray]:
    """Start from the first frames, and the index of the start of each prediction, or -1."""
    chosen = np.full(len(predictions.frames), -1, dtype=np.int64)
    if parameters['start'] != 'first':
        result.notes.append(
            'the bag holds no ~/start, and its predictions do not all start from the first frames'
        )
        return [], chosen
    window = window_of(model_in_scene, parameters)
    taken: list[int] = []
    for newest in np.argsort(tracked.indices, kind='stable'):
        frame = tracked.frames[newest]
        try:
            window.add(frame, int(tracked.times[newest]))
        except RejectedFrame:
            continue
        taken.append(frame.stamp_ns)
        if window.full:
            break
    else:
        result.notes.append(f'the bag holds no {window.length} tracked frames to start from')
        return [], chosen
    period = round(model_in_scene.period * 1e9)
    first = split_by_start(predictions.frames)[0]
    for index in range(first.start, first.stop):
        since = predictions.frames[index].stamp_ns - taken[-1]
        if since <= 0 or abs(since - round(since / period) * model_in_scene.period * 1e9) > 2:
            break
        chosen[index] = 0
    result.notes.append(
        'the bag holds no ~/start: all is computed from the first tracked frames, up to the first '
        'stamp that tells of a restart; one that no stamp tells of shows as a difference'
    )
    return [
        Start(taken[-1], tuple(taken), 'first', index=int(tracked.indices[newest]) + 1)
    ], chosen


def _compare(
    result: Reproduction, forecast: Forecast, own: list[tuple[int, PoseArrayFrame, bytes]]
) -> None:
    """Compare recorded predictions, with their indices and bytes, with those of a forecast."""
    for index, frame, message in sorted(own, key=lambda item: item[1].stamp_ns):
        try:
            poses = forecast.advance_to(frame.stamp_ns).poses
        except (UserError, FloatingPointError):  # it diverges, unlike the recorded one
            poses = np.full_like(frame.poses, np.inf)
        codec = PoseArrayCodec(frame.frame_id, len(poses))
        if codec.encode(poses, frame.stamp_ns) == message:
            result.same += 1
            continue
        result.different += 1
        if result.first_difference is None or index < result.first_difference['index']:
            same_shape = poses.shape == frame.poses.shape
            apart = np.abs(poses - frame.poses) if same_shape else np.full((1, 7), np.inf)
            result.first_difference = {
                'index': index,
                'stamp_s': seconds(frame.stamp_ns),
                'start_s': seconds(forecast.start_ns),
                'largest_m': float(apart[:, :3].max()),
                'values': int((apart > 0).sum()),
            }
