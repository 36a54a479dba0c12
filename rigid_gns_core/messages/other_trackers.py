# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of trackers that send no PoseArray, as the PoseArray that they amount to (CDR bytes).

Of points nothing is known of rotation, which is (0, 0, 0, 1). A position that is NaN stays: that
ball is lost.
"""

from __future__ import annotations

import numpy as np

from .cdr import MessageError, Reader
from .poses import PoseArrayCodec
from .stamped import decode_pose_stamped
from ..scenes.state import Array

# sensor_msgs/PointField: datatypes of coordinates
_FLOATS = {7: 'f4', 8: 'f8'}
_UNTURNED = (0.0, 0.0, 0.0, 1.0)


def pose_array_of_pose(cdr: bytes) -> bytes:
    """Encode the ball of a geometry_msgs/PoseStamped as a PoseArray.

    Raises:
        MessageError: The bytes are no such message, as of the other functions.
    """
    found = decode_pose_stamped(cdr)
    return PoseArrayCodec(found.frame_id, 1).encode(found.values[None], found.stamp_ns)


def pose_array_of_point(cdr: bytes) -> bytes:
    """Encode the ball of a geometry_msgs/PointStamped as a PoseArray."""
    reader = Reader(cdr, 'PointStamped')
    stamp, frame_id = reader.stamp(), reader.text('frame_id')
    point = reader.floats(1, 3, 'point')
    reader.end()
    return _of_points(frame_id, point, stamp)


def pose_array_of_cloud(cdr: bytes) -> bytes:
    """Encode a sensor_msgs/PointCloud2 with x, y, z of float32 or float64 as a PoseArray."""
    reader = Reader(cdr, 'PointCloud2')
    stamp, frame_id = reader.stamp(), reader.text('frame_id')
    count = reader.number('I', 'height') * reader.number('I', 'width')
    columns: dict[str, tuple[int, int]] = {}
    for _ in range(reader.number('I', 'number of fields')):
        name, offset = reader.text('field name'), reader.number('I', 'offset')
        columns[name] = (offset, reader.number('B', 'datatype'))
        reader.number('I', 'count')
    order = '>' if reader.number('B', 'is_bigendian') else '<'
    step, row_step = reader.number('I', 'point_step'), reader.number('I', 'row_step')
    size = reader.number('I', 'length of data')
    data = reader.raw(size, 'data')
    reader.number('B', 'is_dense')
    reader.end()
    if not count:
        return _of_points(frame_id, np.zeros((0, 3)), stamp)
    if count * step != size or row_step * max(size // max(row_step, 1), 1) != size:
        raise MessageError(
            f'PointCloud2: {count} points of {step} bytes, but {size} bytes of data in rows of '
            f'{row_step}; expected rows without padding'
        )
    coordinates = []  # the message holds that many points only where each has its bytes
    for name in 'xyz':
        offset, datatype = columns.get(name, (0, 0))
        kind = _FLOATS.get(datatype)
        if kind is None or offset + int(kind[1]) > step:
            raise MessageError(
                f'PointCloud2: no field {name} of float32 or float64 within points of {step} '
                f'bytes; fields: {", ".join(columns) or "none"}'
            )
        record = np.dtype(
            {'names': ['value'], 'formats': [order + kind], 'offsets': [offset], 'itemsize': step}
        )
        coordinates.append(np.frombuffer(data, record, count)['value'].astype(np.float64))
    return _of_points(frame_id, np.stack(coordinates, axis=1), stamp)


def _of_points(frame_id: str, points: Array, stamp_ns: int) -> bytes:
    poses = np.concatenate([points, np.tile(_UNTURNED, (len(points), 1))], axis=1)
    return PoseArrayCodec(frame_id, len(points)).encode(poses, stamp_ns)
