# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which files a bag has, and what its metadata.yaml says of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from filecmp import cmp
from pathlib import Path
import re
from typing import Any

from .mcap_records import BagError, SQLITE_REMEDY, zstd_decompress
from ..errors import shown
from ..files.config import parse_yaml

# what the files of one bag add to its name
_PART = re.compile(r'(_\d+)?\.mcap.*')
# how what is compressed by zstd begins
_ZSTD = b'\x28\xb5\x2f\xfd'


def files_of(path: Path, warnings: list[str]) -> tuple[list[Path], dict[str, Any]]:
    """MCAP files of a bag in order, and the content of its metadata.yaml.

    Raises:
        BagError: There is no bag, its metadata.yaml is damaged, or it is not of MCAP files.
    """
    if path.is_file():
        return [path], {}
    if not path.is_dir():
        raise BagError(f'{path}: no such bag')
    metadata = path / 'metadata.yaml'
    if not metadata.is_file():
        files = _unlike(sorted(path.glob('*.mcap*'), key=_natural), warnings)
        if not files and (sqlite := sorted(path.glob('*.db3*'), key=_natural)):
            raise BagError(
                f'{path}: holds {sqlite[0].name} and no metadata.yaml: a bag in SQLite whose '
                f'recorder did not finish; `ros2 bag reindex {path.name}` creates metadata.yaml, '
                f'then {SQLITE_REMEDY}'
            )
        if not files:
            raise BagError(f'{path}: holds neither metadata.yaml nor an .mcap file; not a bag')
        if len(several := list(dict.fromkeys(_PART.sub('', file.name) for file in files))) > 1:
            raise BagError(
                f'{path}: holds no metadata.yaml and files of several bags, '
                f'{shown(", ".join(several))}; give each by itself'
            )
        warnings.append(
            f'{path}: no metadata.yaml, so the recorder did not finish: messages that it had not '
            'yet written are lost (this package: at most the last second); all others are read '
            '(`ros2 bag reindex` creates the file)'
        )
        return files, {}
    try:
        text = metadata.read_text('utf-8')
        content = parse_yaml(text, strict=False)
        if not isinstance(content, dict):
            raise ValueError(f'it holds {shown(content)}, expected a mapping')
        information = content['rosbag2_bagfile_information']
        names, storage = information['relative_file_paths'], information['storage_identifier']
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise ValueError(f'relative_file_paths is {shown(names)}, expected names of files')
    except (ValueError, KeyError, TypeError) as error:
        reason = f'no {error}' if isinstance(error, KeyError) else str(error)
        raise BagError(
            f'{metadata}: not the metadata of a bag: {reason}; `ros2 bag reindex` makes it anew; '
            'without the file, the folder is read as that of a recorder that did not finish'
        ) from error
    if not storage:  # `ros2 bag reindex` leaves it empty
        storage = 'sqlite3' if any('.db3' in name for name in names) else 'mcap'
    if storage != 'mcap':
        raise BagError(f'{path}: stored as {shown(storage)}, expected mcap; {SQLITE_REMEDY}')
    files = [path / name for name in names]
    for file in [file for file in files if not file.is_file()]:
        warnings.append(f'{file}: named in metadata.yaml, but missing')
        files.remove(file)
    if not files:
        raise BagError(f'{path}: none of the files that metadata.yaml names is there')
    return _unlike(files, warnings), information


def _unlike(files: Sequence[Path], warnings: list[str]) -> list[Path]:
    """Files of a bag without copies of others, whose messages would count twice."""
    kept: list[Path] = []
    for file in files:
        sizes = (other for other in kept if other.stat().st_size == file.stat().st_size)
        if twin := next((other for other in sizes if cmp(other, file, shallow=False)), None):
            warnings.append(f'{file}: left out, as it holds the same as {twin.name}')
        else:
            kept.append(file)
    return kept


def _natural(path: Path) -> list[int | str]:
    """Sort key that puts bag_10 after bag_9."""
    return [int(part) if part.isdigit() else part for part in re.split(r'(\d+)', path.name)]


def message_unpacker(information: dict[str, Any], path: Path) -> Callable[[bytes], bytes]:
    """Decompressor of messages recorded with `ros2 bag record --compression-mode message`.

    What is not compressed is taken as it is; what cannot be decompressed is empty, which is no
    message of any type.

    Raises:
        BagError: They are compressed by another format than zstd.
    """
    mode = information.get('compression_mode', '')
    if not isinstance(mode, str) or mode.lower() != 'message':
        return lambda data: data
    if (form := information.get('compression_format')) not in ('zstd', '', None):
        raise BagError(
            f'{path}: its messages are compressed by {shown(form)}, expected zstd; '
            '`ros2 bag convert` writes them without'
        )

    def unpack(data: bytes) -> bytes:
        try:
            return zstd_decompress(data) if data.startswith(_ZSTD) else data
        except Exception:  # a decompressor may raise anything
            return b''

    return unpack


def declared_types(information: dict[str, Any]) -> dict[str, str]:
    """Type of each topic by metadata.yaml, for channels without a schema."""
    types = {}
    listed = information.get('topics_with_message_count')
    for entry in listed if isinstance(listed, list) else ():
        topic = entry.get('topic_metadata') if isinstance(entry, dict) else None
        name, kind = (
            (topic.get('name'), topic.get('type')) if isinstance(topic, dict) else ('', '')
        )
        if isinstance(name, str) and isinstance(kind, str) and name and kind:
            types[name] = kind
    return types
