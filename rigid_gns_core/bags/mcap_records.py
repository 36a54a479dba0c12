# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records of an MCAP file, complete or truncated.

A file is read record by record from its start, never through its index: a truncated file has none,
but its complete records can still be read.
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
_CHUNK_HEAD = struct.Struct('<QQQI')  # first and last time, size, checksum
_SQLITE = b'SQLite format 3\0'
_EXPECTED = 'expected the folder of a bag, an .mcap file, or tracks in a file that ends in .csv'

# what helps where a bag is stored in SQLite files
SQLITE_REMEDY = (
    'convert it by `ros2 bag convert -i BAG -o OPTIONS`, with `output_bags: [{uri: NEW, '
    'storage_id: mcap}]` in the file OPTIONS'
)


class BagError(UserError):
    """A folder or file is not a readable bag."""


def read_records(file: Path, warnings: list[str]) -> Iterator[Record]:
    """Header, schemas, channels and messages, also of chunks, as far as they are complete.

    Args:
        file: File to read; one that ends in `.zstd` is decompressed.
        warnings: Each damage appends a sentence.

    Raises:
            BagError: The file is not MCAP.
    """
    with _open(file, warnings) as stream:
        size = stream.seek(0, 2)
        stream.seek(0)
        magic = stream.read(len(_MAGIC))
        if magic != _MAGIC:
            if not _MAGIC.startswith(magic):
                sqlite = _SQLITE.startswith(magic)
                remedy = f'it holds SQLite: {SQLITE_REMEDY}' if sqlite else _EXPECTED
                raise BagError(f'{file}: does not start as an MCAP file; {remedy}')
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
                saved = _whole_records(stream.read()) if opcode == Opcode.CHUNK else []
                count = sum(isinstance(record, Message) for record in saved)
                warnings.append(
                    f'{file}: truncated, so the recorder did not finish; '
                    f'its last {size - start} bytes are lost'
                    + (f', but for {count} messages at their start' if count else '')
                )
                yield from saved
                return
            content = stream.read(length)
            if opcode == Opcode.FOOTER:
                if stream.read() != _MAGIC:
                    warnings.append(f'{file}: truncated in its last bytes; every message is read')
                return
            try:
                records = _parse(opcode, content)
            except Exception as error:  # a decompressor or parser may raise anything
                warnings.append(f'{file}: {length} bytes at {start} are damaged and lost: {error}')
            else:
                yield from records


def _open(file: Path, warnings: list[str]) -> BinaryIO:
    if file.suffix != '.zstd':
        return open(file, 'rb')
    import zstandard

    content, rest, whole = b'', file.read_bytes(), True
    try:  # `ros2 bag record --compression-mode file`; a file may hold several frames
        while rest and whole:
            frame = zstandard.ZstdDecompressor().decompressobj()
            content += frame.decompress(rest)
            rest, whole = frame.unused_data, frame.eof
    except Exception as error:
        raise BagError(f'{file}: cannot be decompressed: {error}') from error
    if not (whole or content):
        raise BagError(f'{file}: is cut short, and nothing of it can be decompressed')
    if not whole:
        warnings.append(f'{file}: is cut short; what can be decompressed is read')
    return BytesIO(content)


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


def _whole_records(chunk: bytes) -> list[Record]:
    """Records of a chunk that was cut short, as far as they are complete."""
    records: list[Record] = []
    try:
        content = _start_of_chunk(chunk)
        offset = 0
        while offset + _HEAD.size <= len(content):
            opcode, length = _HEAD.unpack_from(content, offset)
            offset += _HEAD.size
            if offset + length > len(content):
                break
            records += _parse(opcode, content[offset : offset + length])
            offset += length
    except Exception:  # a decompressor or parser may raise anything: what came before is kept
        return records
    return records


def _start_of_chunk(chunk: bytes) -> bytes:
    """Records of a chunk that was cut short, decompressed as far as they are there."""
    start = _CHUNK_HEAD.size
    length = int.from_bytes(chunk[start : start + 4], 'little')
    compression = chunk[start + 4 : start + 4 + length]
    start += 4 + length
    size = int.from_bytes(chunk[start : start + 8], 'little')
    content = chunk[start + 8 : start + 8 + size]
    if compression == b'zstd':
        return zstd_decompress(content)
    if compression == b'lz4':
        import lz4.frame

        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(content))
    return content


def zstd_decompress(data: bytes) -> bytes:
    """Decompressed data of a zstd frame."""
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj().decompress(data)
