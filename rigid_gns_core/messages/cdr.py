# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""CDR, the wire format of ROS 2: a writer and a bounds-checked reader of fields.

XCDR1: four bytes of encapsulation (0, 1 = little endian or 0 = big endian, two of options), then
the fields, each aligned to its size counted from byte four. Padding is zero here; rclpy leaves it
uninitialised, so that its bytes differ between runs.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import UserError

LITTLE_ENDIAN = b'\x00\x01\x00\x00'
NANOSECONDS = 1_000_000_000

# numbers of one field, by byte order and code
_FIELDS = {order + code: struct.Struct(order + code) for order in '<>' for code in 'bBiId'}


class MessageError(UserError):
    """Bytes are not a message of the expected type, or values do not fit into a message."""


class Writer:
    """Writer of the fields of one message, little endian, in their order."""

    def __init__(self) -> None:
        self._body = bytearray()  # from byte four on

    def __len__(self) -> int:
        return len(self._body)

    def align(self, size: int) -> None:
        """Pad to a multiple of `size` bytes."""
        self._body += bytes(-len(self._body) % size)

    def numbers(self, codes: str, *values: float) -> None:
        """Write numbers of one size; `codes` as in struct, one letter for each."""
        self.align(struct.calcsize(codes[0]))
        self._body += struct.pack('<' + codes, *values)

    def text(self, name: str, text: str) -> None:
        """Write a string.

        Raises:
            MessageError: The text cannot be a ROS string; the message holds `name`.
        """
        self.align(4)
        self._body += encode_text(name, text)

    def floats(self, values: ArrayLike) -> None:
        """Write float64 numbers of any shape, without their count."""
        array = np.ascontiguousarray(values, dtype='<f8')
        if array.size:
            self.align(8)
            self._body += array.tobytes()

    def raw(self, data: bytes) -> None:
        """Write bytes that are aligned already."""
        self._body += data

    def stamp(self, stamp_ns: int) -> None:
        """Write a time or duration [ns]; MessageError: its seconds do not fit into int32."""
        seconds, nanoseconds = split_stamp(stamp_ns)
        self.numbers('i', seconds)
        self.numbers('I', nanoseconds)

    def header(self, stamp_ns: int, frame_id: str) -> None:
        """Write a std_msgs/Header."""
        self.stamp(stamp_ns)
        self.text('frame_id', frame_id)

    @property
    def cdr(self) -> bytes:
        """The whole message."""
        return LITTLE_ENDIAN + bytes(self._body)


def _remedy(encapsulation: bytes) -> str:
    """What helps against an encapsulation that cannot be read."""
    if encapsulation[0] == 0 and 6 <= encapsulation[1] <= 11:
        return (
            '; this is XCDR2: set the publisher to data representation XCDR1, as ROS 2 writes it'
        )
    return ''


class Reader:
    """Bounds-checked reader of the fields of one message.

    Args:
        cdr: The whole message.
        kind: Name of its type, for errors.

    Raises:
            MessageError: The bytes are not plain CDR; of each method: the field is cut short.
    """

    def __init__(self, cdr: bytes, kind: str) -> None:
        self.cdr, self.kind, self.offset = cdr, kind, 4
        if len(cdr) < 4:
            raise MessageError(
                f'{kind}: {len(cdr)} bytes, expected at least the 4 of a CDR header'
            )
        if cdr[0] != 0 or cdr[1] not in (0, 1):
            raise MessageError(
                f'{kind}: encapsulation is 0x{bytes(cdr[:2]).hex()}, '
                'expected plain CDR (0x0001 or 0x0000)' + _remedy(cdr[:2])
            )
        self.order = '<' if cdr[1] else '>'

    def aligned(self, size: int) -> int:
        """Offset of the next field, of `size` bytes."""
        return self.offset + -(self.offset - 4) % size

    def number(self, code: str, name: str) -> Any:
        """Read a number; `code` as in struct."""
        field = _FIELDS[self.order + code]
        size = field.size
        start = self.aligned(size)
        if start + size > len(self.cdr):
            raise MessageError(
                f'{self.kind}: cut short in {name}, at byte {start} of {len(self.cdr)}'
            )
        self.offset = start + size
        return field.unpack_from(self.cdr, start)[0]

    def floats(self, count: int, width: int, name: str) -> Any:
        """Read float64 numbers into a new array, shape (count, width)."""
        start = self.aligned(8) if count else self.offset
        end = start + 8 * count * width
        if end > len(self.cdr):
            raise MessageError(
                f'{self.kind}: {count} {name} need {end} bytes, '
                f'but the message has {len(self.cdr)}'
            )
        self.offset = end
        # numpy wants an offset within the buffer, even for no numbers
        values = np.frombuffer(self.cdr, self.order + 'f8', count * width, start if count else 0)
        # a copy: aligned, writable, in native byte order, independent of the message
        return np.array(values, dtype=np.float64).reshape(count, width)

    def raw(self, count: int, name: str) -> bytes:
        """Read so many bytes."""
        end = self.offset + count
        if end > len(self.cdr):
            raise MessageError(
                f'{self.kind}: {name} needs {end} bytes, but the message has {len(self.cdr)}'
            )
        found, self.offset = self.cdr[self.offset : end], end
        return found

    def stamp(self, name: str = 'stamp') -> int:
        """Read a time or duration [ns]."""
        seconds = self.number('i', f'{name}.sec')
        nanoseconds = self.number('I', f'{name}.nanosec')
        if nanoseconds >= NANOSECONDS:
            raise MessageError(
                f'{self.kind}: {name}.nanosec is {nanoseconds}, expected less than 1e9'
            )
        return int(seconds * NANOSECONDS + nanoseconds)

    def text(self, name: str) -> str:
        """Read a string."""
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
        """Check that no bytes follow the last field, but for padding."""
        # middleware may pad a payload to a multiple of four
        if len(self.cdr) - self.offset > 3:
            raise MessageError(
                f'{self.kind}: {len(self.cdr) - self.offset} bytes after the last field'
            )


def encode_text(name: str, text: str) -> bytes:
    """CDR bytes of a string, with its length.

    Raises:
        MessageError: The text cannot be a ROS string; the message holds `name`.
    """
    if '\0' in text:
        raise MessageError(f'{name} is {text!r}; a ROS string cannot hold a NUL character')
    try:
        data = text.encode() + b'\0'
    except UnicodeEncodeError as error:
        raise MessageError(
            f'{name} is {text!r}, which UTF-8 cannot hold: {error.reason}'
        ) from None
    return struct.pack('<I', len(data)) + data


def split_stamp(stamp_ns: int) -> tuple[int, int]:
    """Seconds and nanoseconds of a stamp [ns]; MessageError: the seconds do not fit into int32."""
    seconds, nanoseconds = divmod(int(stamp_ns), NANOSECONDS)
    if not -(2**31) <= seconds < 2**31:
        raise MessageError(f'stamp is {seconds} s, expected a number of seconds within int32')
    return seconds, nanoseconds
