# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of trackers that hold named objects, as the PoseArray of the balls among them (CDR).

Fields are those of vision_msgs 4, mocap4r2_msgs 0 and motion_capture_tracking_interfaces 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .cdr import Reader
from .poses import PoseArrayCodec
from ..scenes.state import Array

_NO_ROTATION = (0.0, 0.0, 0.0, 1.0)

# name and pose, shape (7,), of each object of a message, after its header
Objects = list[tuple[str, Array]]


def _detections(reader: Reader) -> Objects:
    found = []
    for _ in range(reader.number('I', 'number of detections')):
        reader.stamp()
        reader.text('frame_id')
        likeliest, score = None, -np.inf
        for _ in range(reader.number('I', 'number of results')):
            reader.text('class_id')
            own = reader.number('d', 'score')
            pose = reader.floats(1, 7, 'pose')[0]
            reader.floats(1, 36, 'covariance')
            if likeliest is None or own > score:
                likeliest, score = pose, own
        centre, size = reader.floats(1, 7, 'bbox.center')[0], reader.floats(1, 3, 'bbox.size')[0]
        # some detectors fill in the box, some the pose
        chosen = likeliest if likeliest is not None and not size.any() else centre
        found.append((reader.text('id'), chosen))
    return found


def _markers(reader: Reader) -> Objects:
    reader.number('I', 'frame_number')
    return _marker_list(reader)


def _marker_list(reader: Reader) -> Objects:
    found = []
    for _ in range(reader.number('I', 'number of markers')):
        reader.number('b', 'id_type')
        index, name = reader.number('i', 'marker_index'), reader.text('marker_name')
        place = reader.floats(1, 3, 'translation')[0]
        found.append((name or str(index), np.concatenate([place, _NO_ROTATION])))
    return found


def _rigid_bodies(reader: Reader) -> Objects:
    reader.number('I', 'frame_number')
    found = []
    for _ in range(reader.number('I', 'number of rigid bodies')):
        name = reader.text('rigid_body_name')
        _marker_list(reader)
        found.append((name, reader.floats(1, 7, 'pose')[0]))
    return found


def _named_poses(reader: Reader) -> Objects:
    return [
        (reader.text('name'), reader.floats(1, 7, 'pose')[0])
        for _ in range(reader.number('I', 'number of poses'))
    ]


OBJECT_ARRAYS: dict[str, Callable[[Reader], Objects]] = {
    'vision_msgs/Detection3DArray': _detections,
    'mocap4r2_msgs/Markers': _markers,
    'mocap4r2_msgs/RigidBodies': _rigid_bodies,
    'motion_capture_tracking_interfaces/NamedPoseArray': _named_poses,
}


def pose_array_of_objects(cdr: bytes, kind: str, balls: Sequence[str] = ()) -> bytes:
    """Encode the balls in a message as a PoseArray.

    Args:
        cdr: The message.
        kind: Its type, of `OBJECT_ARRAYS`.
        balls: Names of the balls, in the order of the poses; NaN where one is not there. Empty:
            all objects, in their own order. A detection's name is its `id`; that of a marker
            without one is its `marker_index`.

    Raises:
        MessageError: The bytes are no such message.
    """
    reader = Reader(cdr, kind.split('/')[1])
    stamp, frame_id = reader.stamp(), reader.text('frame_id')
    objects = OBJECT_ARRAYS[kind](reader)
    reader.end()
    if balls:
        known = dict(reversed(objects))  # the first of a name
        nowhere = np.full(7, np.nan)
        poses = [known.get(name, nowhere) for name in balls]
    else:
        poses = [pose for _, pose in objects]
    array = np.array(poses).reshape(len(poses), 7)
    return PoseArrayCodec(frame_id, len(poses)).encode(array, stamp)
