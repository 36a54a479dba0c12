# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""PoseArray, String and Float64 messages as CDR bytes, without an object per pose.

rclpy publishes such bytes unchanged and a raw subscription delivers them, so that a frame of 300
poses costs microseconds instead of milliseconds (docs/bags.md has the figures), and the published
bytes are the recorded bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
import struct

import numpy as np
from numpy.typing import ArrayLike

from .cdr import encode_text, LITTLE_ENDIAN, MessageError, Reader, split_stamp
from ..scenes.state import Array

__all__ = [
    'MessageError',
    'PoseArrayFrame',
    'PoseArrayCodec',
    'decode_pose_array',
    'encode_string',
    'decode_string',
    'encode_float64',
    'decode_float64',
]


# largest part of a quaternion that is one
_LEAST = 1e-6


@dataclass(frozen=True)
class PoseArrayFrame:
    """One geometry_msgs/PoseArray.

    Args:
        stamp_ns: Time stamp [ns].
        frame_id: Coordinate frame of the poses.
        poses: Position [m] and quaternion (x, y, z, w) of each body, shape (n, 7); a quaternion
            of zero is that of an unknown rotation.
    """

    stamp_ns: int
    frame_id: str
    poses: Array


class PoseArrayCodec:
    """Encoder of geometry_msgs/PoseArray for a fixed frame and number of poses.

    Args:
        frame_id: Coordinate frame.
        count: Number of poses n.

    Raises:
        MessageError: The frame cannot be a ROS string, or count is negative.
    """

    def __init__(self, frame_id: str, count: int) -> None:
        if count < 0:
            raise MessageError(f'count is {count}, expected 0 or more poses')
        self.frame_id, self.count = frame_id, int(count)
        tail = encode_text('frame_id', frame_id)
        offset = 8 + len(tail)  # of the fields before the pose count, from byte four
        tail += bytes(-offset % 4) + struct.pack('<I', count)
        if count:
            tail += bytes(-(8 + len(tail)) % 8)
        self._tail = tail

    def encode(self, poses: ArrayLike, stamp_ns: int) -> bytes:
        """CDR bytes of one message.

        Args:
            poses: Position [m] and quaternion (x, y, z, w) of each body, shape (count, 7).
            stamp_ns: Time stamp [ns].

        Raises:
            MessageError: The shape of `poses` is wrong, or the stamp does not fit into int32
                seconds.
        """
        array = np.ascontiguousarray(poses, dtype='<f8')
        if array.shape != (self.count, 7):
            raise MessageError(f'poses have shape {array.shape}, expected {(self.count, 7)}')
        stamp = struct.pack('<iI', *split_stamp(stamp_ns))
        return b''.join((LITTLE_ENDIAN, stamp, self._tail, array.data))


def decode_pose_array(cdr: bytes) -> PoseArrayFrame:
    """Decode a geometry_msgs/PoseArray of either byte order.

    A quaternion that is not finite, or is zero, is of a rotation that the tracker does not know.

    Raises:
        MessageError: The bytes are cut short, too long, or not a PoseArray.
    """
    reader = Reader(cdr, 'PoseArray')
    stamp_ns, frame_id = reader.stamp(), reader.text('frame_id')
    poses = reader.floats(reader.number('I', 'number of poses'), 7, 'poses')
    reader.end()
    size = np.abs(poses[:, 3:]).max(axis=1)
    known = (size > _LEAST) & (size < np.inf)  # not NaN either
    if not known.all():
        poses[~known, 3:] = 0.0
    return PoseArrayFrame(stamp_ns, frame_id, poses)


def restamped(cdr: bytes, shift_ns: int) -> bytes:
    """The bytes of a message that begins with a header, its stamp moved by a time [ns].

    Raises:
        MessageError: The bytes are cut short, or the stamp does not fit into int32 seconds.
    """
    if not shift_ns:
        return cdr
    stamp = split_stamp(Reader(cdr, 'Header').stamp() + shift_ns)
    order = '<' if cdr[1] & 1 else '>'
    return cdr[:4] + struct.pack(f'{order}iI', *stamp) + cdr[12:]


def encode_string(text: str) -> bytes:
    """CDR bytes of a std_msgs/String."""
    return LITTLE_ENDIAN + encode_text('data', text)


def decode_string(cdr: bytes) -> str:
    """Text of a std_msgs/String; MessageError: the bytes are not one."""
    reader = Reader(cdr, 'String')
    text = reader.text('data')
    reader.end()
    return text


def encode_float64(value: float) -> bytes:
    """CDR bytes of a std_msgs/Float64."""
    return LITTLE_ENDIAN + struct.pack('<d', value)


def decode_float64(cdr: bytes) -> float:
    """Number of a std_msgs/Float64; MessageError: the bytes are not one."""
    reader = Reader(cdr, 'Float64')
    value = float(reader.number('d', 'data'))
    reader.end()
    return value
