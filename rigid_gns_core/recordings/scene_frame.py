# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked frames of a bag in the scene's coordinate frame, by the bag's own /tf and /tf_static."""

from __future__ import annotations

from dataclasses import replace

from .decoded_topic import DecodedTopic
from ..bags.reader import Bag, BagError
from ..messages.cdr import MessageError
from ..messages.transforms import decode_transforms
from ..tracking.transform_buffer import NoTransform, TransformBuffer

_TYPE = 'tf2_msgs/msg/TFMessage'


def in_scene_frame(bag: Bag, decoded: DecodedTopic, frame_id: str | None) -> DecodedTopic:
    """The frames of a topic in the coordinate frame `frame_id`; None: as they are.

    A frame without a transform at its stamp stays as it is; `usable_passes` refuses it.

    Raises:
        BagError: No frame has a transform; the message says why.
    """
    if frame_id is None or all(frame.frame_id == frame_id for frame in decoded.frames):
        return decoded
    buffer, problem = _buffer(bag)
    frames, missing = [], None
    for frame in decoded.frames:
        try:
            found = frame if frame.frame_id == frame_id else buffer.in_frame(frame, frame_id)
        except NoTransform as error:
            missing, found = missing or error, frame
        frames.append(found)
    if missing is not None and all(frame.frame_id != frame_id for frame in frames):
        raise BagError(f'{bag.path}: {missing}' + (f'; {problem}' if problem else ''))
    return replace(decoded, frames=frames)


def _buffer(bag: Bag) -> tuple[TransformBuffer, str]:
    """All transforms of a bag, and what is wrong with the first that cannot be used."""
    buffer, problem = TransformBuffer(None), ''
    for topic in bag.topics.values():
        if topic.type_name != _TYPE:
            continue
        static = topic.name.split('/')[-1] == 'tf_static'
        for cdr in topic.messages:
            try:
                wrong = buffer.add(decode_transforms(cdr), static=static)
            except MessageError as error:
                wrong = f'{topic.name}: {error}'
            problem = problem or wrong
    return buffer, problem
