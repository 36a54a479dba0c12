"""ROS messages as CDR bytes, to and from NumPy arrays, with no object per pose and no ROS needed.

rclpy publishes such bytes as they are and a raw subscription hands them over, so a frame of 300
poses costs microseconds instead of milliseconds (docs/bags.md has the figures), and the bytes
published are the bytes recorded. The format is XCDR1: four bytes of encapsulation (0, 1 = little
endian or 0 = big endian, two of options), then the fields, each aligned to its size counted from
byte four. Padding is zero here; rclpy leaves it uninitialised, so its bytes differ from run to run.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rigid_gns_core.state import Array

_LITTLE_ENDIAN = b'\x00\x01\x00\x00'
_POSE_BYTES = 56  # 7 float64
_NANOSECONDS = 1_000_000_000


class MessageError(ValueError):
    """Bytes are not the message they should be, or values do not fit into a message."""


@dataclass(frozen=True)
class PoseArrayFrame:
    """One geometry_msgs/PoseArray.

    Args:
        stamp_ns: Time stamp [ns].
        frame_id: Coordinate frame of the poses.
        poses: Position [m] and quaternion (x, y, z, w) of each body, shape (n, 7).
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
        MessageError: The frame holds a NUL character or cannot be encoded, or count is negative.
    """

    def __init__(self, frame_id: str, count: int) -> None:
        if count < 0:
            raise MessageError(f'count is {count}, expected 0 or more poses')
        self.frame_id, self.count = frame_id, int(count)
        tail = _encode_text('frame_id', frame_id)
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
            MessageError: poses have another shape, or the stamp does not fit into int32 seconds.
        """
        array = np.ascontiguousarray(poses, dtype='<f8')
        if array.shape != (self.count, 7):
            raise MessageError(f'poses have shape {array.shape}, expected {(self.count, 7)}')
        seconds, nanoseconds = divmod(int(stamp_ns), _NANOSECONDS)
        if not -(2**31) <= seconds < 2**31:
            raise MessageError(f'stamp is {seconds} s, expected a number of seconds within int32')
        stamp = struct.pack('<iI', seconds, nanoseconds)
        return b''.join((_LITTLE_ENDIAN, stamp, self._tail, array.data))


def decode_pose_array(cdr: bytes) -> PoseArrayFrame:
    """Read a geometry_msgs/PoseArray of either byte order.

    Raises:
        MessageError: The bytes are cut short, too long, or not a PoseArray.
    """
    reader = _Reader(cdr, 'PoseArray')
    seconds = reader.number('i', 'stamp.sec')
    nanoseconds = reader.number('I', 'stamp.nanosec')
    if nanoseconds >= _NANOSECONDS:
        raise MessageError(f'PoseArray: stamp.nanosec is {nanoseconds}, expected less than 1e9')
    frame_id = reader.text('frame_id')
    count = reader.number('I', 'number of poses')
    start = reader.offset
    if count:
        start = reader.aligned(8)
    if count * _POSE_BYTES > len(cdr) - start:
        raise MessageError(
            f'PoseArray: {count} poses need {start + count * _POSE_BYTES} bytes, '
            f'but the message has {len(cdr)}'
        )
    reader.offset = start + count * _POSE_BYTES
    reader.end()
    values = np.frombuffer(cdr, reader.order + 'f8', 7 * count, start if count else 0)
    # a copy: aligned, writable, of native order and free of the message
    return PoseArrayFrame(
        seconds * _NANOSECONDS + nanoseconds,
        frame_id,
        np.array(values, dtype=np.float64).reshape(count, 7),
    )


def encode_string(text: str) -> bytes:
    """CDR bytes of a std_msgs/String."""
    return _LITTLE_ENDIAN + _encode_text('data', text)


def decode_string(cdr: bytes) -> str:
    """Read a std_msgs/String; MessageError where the bytes are not one."""
    reader = _Reader(cdr, 'String')
    text = reader.text('data')
    reader.end()
    return text


def encode_float64(value: float) -> bytes:
    """CDR bytes of a std_msgs/Float64."""
    return _LITTLE_ENDIAN + struct.pack('<d', value)


def decode_float64(cdr: bytes) -> float:
    """Read a std_msgs/Float64; MessageError where the bytes are not one."""
    reader = _Reader(cdr, 'Float64')
    value = reader.number('d', 'data')
    reader.end()
    return value


def _encode_text(name: str, text: str) -> bytes:
    if '\0' in text:
        raise MessageError(f'{name} is {text!r}; a ROS string cannot hold a NUL character')
    try:
        data = text.encode() + b'\0'
    except UnicodeEncodeError as error:
        raise MessageError(f'{name} is {text!r}, which UTF-8 cannot hold: {error.reason}') from None
    return struct.pack('<I', len(data)) + data


class _Reader:
    """Bounds-checked cursor over the fields of one message."""

    def __init__(self, cdr: bytes, kind: str) -> None:
        self.cdr, self.kind, self.offset = cdr, kind, 4
        if len(cdr) < 4:
            raise MessageError(f'{kind}: {len(cdr)} bytes, expected at least the 4 of a CDR header')
        if cdr[0] != 0 or cdr[1] not in (0, 1):
            raise MessageError(
                f'{kind}: encapsulation is 0x{bytes(cdr[:2]).hex()}, '
                'expected plain CDR (0x0001 or 0x0000)'
            )
        self.order = '<' if cdr[1] else '>'

    def aligned(self, size: int) -> int:
        """Offset of the next field, for a field of `size` bytes."""
        return self.offset + -(self.offset - 4) % size

    def number(self, code: str, name: str) -> Any:
        """Next number; `code` as in struct."""
        size = struct.calcsize(code)
        start = self.aligned(size)
        if start + size > len(self.cdr):
            raise MessageError(
                f'{self.kind}: cut short in {name}, at byte {start} of {len(self.cdr)}'
            )
        self.offset = start + size
        return struct.unpack_from(self.order + code, self.cdr, start)[0]

    def text(self, name: str) -> str:
        """Next string."""
        length = self.number('I', f'length of {name}')
        end = self.offset + length
        if end > len(self.cdr):
            raise MessageError(
                f'{self.kind}: {name} has {length} bytes, but only '
                f'{len(self.cdr) - self.offset} are left'
            )
        data = bytes(self.cdr[self.offset : end])
        self.offset = end
        # some middleware writes an empty string without its NUL
        if length and (data[-1] != 0 or 0 in data[:-1]):
            raise MessageError(f'{self.kind}: {name} does not end with one NUL character')
        try:
            return data[:-1].decode()
        except UnicodeDecodeError as error:
            raise MessageError(f'{self.kind}: {name} is not UTF-8: {error.reason}') from None

    def end(self) -> None:
        """Refuse bytes after the last field."""
        # middleware may pad a payload to a multiple of four
        if len(self.cdr) - self.offset > 3:
            raise MessageError(
                f'{self.kind}: {len(self.cdr) - self.offset} bytes after the last field'
            )
