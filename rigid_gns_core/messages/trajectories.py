# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""trajectory_msgs/MultiDOFJointTrajectory as CDR bytes, from and to arrays.

Every point after the first has the same layout, four bytes after a multiple of eight, so that all
points are records of one structured array.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
import struct

import numpy as np
from numpy.typing import ArrayLike

from .cdr import LITTLE_ENDIAN, MessageError, NANOSECONDS, Reader, split_stamp, Writer
from ..scenes.state import Array


@dataclass(frozen=True)
class FutureFrame:
    """One trajectory_msgs/MultiDOFJointTrajectory of k points and n bodies.

    Args:
        stamp_ns: Stamp from which the times of the points count [ns].
        frame_id: Coordinate frame of poses and twists.
        names: Name of each body.
        times_ns: Time of each point since the stamp [ns].
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7).
        twists: Linear [m/s] and angular [rad/s] velocity, shape (k, n, 6).
    """

    stamp_ns: int
    frame_id: str
    names: tuple[str, ...]
    times_ns: tuple[int, ...]
    poses: Array
    twists: Array


def encode_trajectory(
    stamp_ns: int,
    frame_id: str,
    names: Sequence[str],
    times_ns: Sequence[int],
    poses: ArrayLike,
    twists: ArrayLike,
) -> bytes:
    """CDR bytes of one message; arguments as in `FutureFrame`.

    Raises:
        MessageError: Shapes disagree, or a text or a time does not fit into the message.
    """
    poses, twists = np.asarray(poses, dtype='<f8'), np.asarray(twists, dtype='<f8')
    points, count = len(times_ns), len(names)
    for name, array, width in (('poses', poses, 7), ('twists', twists, 6)):
        if array.shape != (points, count, width):
            expected = (points, count, width)
            raise MessageError(f'{name} have shape {array.shape}, expected {expected}')
    writer = Writer()
    writer.header(stamp_ns, frame_id)
    writer.numbers('I', count)
    for text in names:
        writer.text('joint name', text)
    writer.numbers('I', points)
    if not count:
        for time in times_ns:
            writer.numbers('III', 0, 0, 0)
            writer.stamp(time)
        return writer.cdr
    records = np.zeros(points, _point_of(count))
    records['count'] = records['twist_count'] = count
    records['poses'], records['twists'] = poses, twists
    for time in (min(times_ns), max(times_ns)) if points else ():
        split_stamp(time)  # so all fit
    records['time'] = np.stack(np.divmod(np.array(times_ns, dtype=np.int64), NANOSECONDS), axis=1)
    if len(writer) % 8 == 0 and points:
        # padding follows the count of the first point: write the count, and begin with the padding
        writer.numbers('I', count)
        records['count'][0] = 0
    writer.raw(records.tobytes())
    return writer.cdr


class TrajectoryCodec:
    """Encoder of messages of the same bodies at the same times.

    Args:
        frame_id: See `FutureFrame`, as of the next two.
        names: See there, at least one.
        times_ns: See there, at least one.

    Raises:
        MessageError: A text or a time does not fit into the message.
    """

    def __init__(self, frame_id: str, names: Sequence[str], times_ns: Sequence[int]) -> None:
        shape = len(times_ns), len(names)
        zeros = np.zeros((*shape, 7)), np.zeros((*shape, 6))
        self._head = encode_trajectory(0, frame_id, names, times_ns, *zeros)
        self._points = _point_of(len(names))
        size = self._points.itemsize * len(times_ns)
        self._records = np.frombuffer(self._head[-size:], self._points).copy()
        self._head = self._head[12:-size]

    def encode(self, stamp_ns: int, poses: Array, twists: Array) -> bytes:
        """CDR bytes of one message; arguments as in `FutureFrame`.

        Raises:
            MessageError: The stamp does not fit into the message.
        """
        records = self._records.copy()
        records['poses'], records['twists'] = poses, twists
        stamp = struct.pack('<iI', *split_stamp(stamp_ns))
        return b''.join((LITTLE_ENDIAN, stamp, self._head, records.data))


@lru_cache(maxsize=8)
def _point_of(count: int) -> np.dtype[np.void]:
    """Layout of a point of `count` bodies after the first."""
    return np.dtype(
        [
            ('count', '<u4'),
            ('poses', '<f8', (count, 7)),
            ('twist_count', '<u4'),
            ('padding', '<u4'),
            ('twists', '<f8', (count, 6)),
            ('acceleration_count', '<u4'),
            ('time', '<i4', (2,)),
        ]
    )


def decode_trajectory(cdr: bytes, *, bare: bool = False) -> FutureFrame:
    """Decode a message of either byte order, with a transform and a twist for each name and point.

    Args:
        cdr: The message.
        bare: Accept points without velocities: their twists are NaN.

    Raises:
        MessageError: The bytes are cut short, too long, or not such a message.
    """
    reader = Reader(cdr, 'MultiDOFJointTrajectory')
    stamp_ns, frame_id = reader.stamp(), reader.text('frame_id')
    names = tuple(reader.text('joint name') for _ in range(_bounded(reader, 4, 'joint names')))
    poses: list[Array] = []
    twists: list[Array] = []
    times: list[int] = []
    for _ in range(_bounded(reader, 20, 'points')):
        for width, kind, out in ((7, 'transforms', poses), (6, 'velocities', twists)):
            found = reader.number('I', f'number of {kind}')
            if bare and kind == 'velocities' and not found:
                out.append(np.full((len(names), width), np.nan))
                continue
            if found != len(names):
                raise MessageError(f'{reader.kind}: {found} {kind}, expected {len(names)}')
            out.append(reader.floats(found, width, kind))
        reader.floats(reader.number('I', 'number of accelerations'), 6, 'accelerations')
        times.append(reader.stamp('time_from_start'))
    reader.end()
    count = len(names)
    return FutureFrame(
        stamp_ns,
        frame_id,
        names,
        tuple(times),
        np.array(poses, dtype=np.float64).reshape(len(times), count, 7),
        np.array(twists, dtype=np.float64).reshape(len(times), count, 6),
    )


def _bounded(reader: Reader, size: int, name: str) -> int:
    """Read the length of a sequence, whose items take at least `size` bytes each."""
    count = int(reader.number('I', f'number of {name}'))
    if count * size > len(reader.cdr) - reader.offset:
        raise MessageError(
            f'{reader.kind}: {count} {name} cannot be in the {len(reader.cdr)} bytes '
            'of the message'
        )
    return count
