# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of an MCAP file, whole or torn.

A file is read from its start, record by record, never through its index: a torn file has none, and
every record that is whole is still there.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
import struct
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Message, Schema
from mcap.stream_reader import breakup_chunk

from ..errors import UserError

Record = Header | Schema | Channel | Message

_MAGIC = b'\x89MCAP0\r\n'
_HEAD = struct.Struct('<BQ')  # opcode, length of the content


class BagError(UserError):
    """A folder or file is not a bag that can be read."""


def read_records(file: Path, warnings: list[str]) -> Iterator[Record]:
    """Header, schemas, channels and messages, with those in chunks, as far as they are whole.

    Args:
        file: The file; one that ends in `.zstd` is decompressed.
        warnings: Gets a sentence for each damage.

    Raises:
        BagError: It is not MCAP.
    """
    with _open(file) as stream:
        size = stream.seek(0, 2)
        stream.seek(0)
        magic = stream.read(len(_MAGIC))
        if magic != _MAGIC:
            if not _MAGIC.startswith(magic):
                raise BagError(f'{file}: does not start as an MCAP file')
            warnings.append(f'{file}: is empty, so the recorder did not get to write into it')
            return
        while True:
            start = stream.tell()
            if start == size:
                warnings.append(f'{file}: has no end, so the recorder did not finish')
                return
            # a damaged length may be huge: compare before reading
            opcode, length = _HEAD.unpack(stream.read(_HEAD.size).ljust(_HEAD.size, b'\xff'))
            if start + _HEAD.size + length > size:
                warnings.append(
                    f'{file}: torn, so the recorder did not finish; '
                    f'its last {size - start} bytes are lost'
                )
                return
            content = stream.read(length)
            if opcode == Opcode.FOOTER:
                if stream.read() != _MAGIC:
                    warnings.append(f'{file}: torn in its last bytes; every message is read')
                return
            try:
                records = _parse(opcode, content)
            except Exception as error:  # anything may come out of a decompressor or parser here
                warnings.append(f'{file}: {length} bytes at {start} are damaged and lost: {error}')
            else:
                yield from records


def _open(file: Path) -> BinaryIO:
    if file.suffix != '.zstd':
        return open(file, 'rb')
    try:  # `ros2 bag record --compression-mode file`
        return BytesIO(zstd_decompress(file.read_bytes()))
    except Exception as error:
        raise BagError(f'{file}: cannot be decompressed: {error}') from error


def _parse(opcode: int, content: bytes) -> list[Record]:
    stream = ReadDataStream(BytesIO(content))
    if opcode == Opcode.HEADER:
        return [Header.read(stream)]
    if opcode == Opcode.SCHEMA:
        return [Schema.read(stream)]
    if opcode == Opcode.CHANNEL:
        return [Channel.read(stream)]
    if opcode == Opcode.MESSAGE:
        return [Message.read(stream, len(content))]
    if opcode == Opcode.CHUNK:
        records = breakup_chunk(Chunk.read(stream), validate_crc=True)
        return [r for r in records if isinstance(r, (Schema, Channel, Message))]
    return []


def zstd_decompress(data: bytes) -> bytes:
    """Return what zstd compressed."""
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(data)
