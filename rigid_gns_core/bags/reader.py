# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reads bags: finished folders, single MCAP files, and bags of a killed recorder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
import itertools
from pathlib import Path

from mcap.records import Channel, Header, Message, Schema
import numpy as np
from numpy.typing import NDArray

from .file import LIBRARY
from .folder import declared_types, files_of, message_unpacker
from .mcap_records import BagError, read_records
from ..errors import shown, UserError
from ..messages.definitions import HASHES

__all__ = ['Bag', 'BagError', 'Topic', 'read_bag']

# log times that go back by more begin another pass of simulated time; by less, they are unordered
# [ns]
PASS = 1_000_000_000
# log times are unsigned in MCAP; ROS has none that an int64 does not hold [ns]
_LATEST = 2**63 - 1


@dataclass(frozen=True)
class Topic:
    """Messages of one topic, ordered by log time within each pass.

    A new pass begins where simulated time went back by more than a second, as in a world that was
    reset: later messages stay later.

    Args:
        name: Name of the topic.
        type_name: Type, such as `geometry_msgs/msg/PoseArray`.
        times: Log times [ns], int64, shape (messages,).
        messages: CDR bytes of each message.
        indices: Index of each message in the order of recording, over all topics, int64, shape
            (messages,).
    """

    name: str
    type_name: str
    times: NDArray[np.int64]
    messages: list[bytes]
    indices: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.messages)


@dataclass(frozen=True)
class Bag:
    """Content of a bag.

    Args:
        path: Folder or file.
        topics: Topics by name.
        warnings: Damages and missing parts, a sentence each; empty for an intact bag.
    """

    path: Path
    topics: dict[str, Topic]
    warnings: tuple[str, ...]

    @contextmanager
    def naming_damage(self) -> Iterator[None]:
        """Add the bag and its warnings to a UserError raised within: they often are its reason."""
        try:
            yield
        except UserError as error:
            text = str(error)
            text = text if str(self.path) in text else f'{self.path}: {text}'
            error.args = ('; '.join([text, *self.warnings]),)
            raise


def read_bag(path: str | Path) -> Bag:
    """Read every complete message of a rosbag2 folder or an .mcap file.

    Raises:
        BagError: There is nothing to read, or it is not MCAP.
    """
    path = Path(path)
    warnings: list[str] = []
    files, information = files_of(path, warnings)
    unpack = message_unpacker(information, path)
    gathered: dict[tuple[str, str], _Gathered] = {}
    counter = itertools.count()
    types = declared_types(information)
    count = sum(_read_file(file, gathered, types, counter, warnings) for file in files)
    topics = {}
    for name, found in _one_type_each(gathered, path, warnings).items():
        if found.missing:
            warnings.append(f'{path}: {found.missing} messages of {name} are missing in between')
        if found.out_of_range:
            warnings.append(
                f'{path}: {found.out_of_range} messages of {name} are left out: their log times '
                f'are damaged, {_LATEST + 1} ns or more'
            )
        times = np.array(found.times, dtype=np.int64)
        order = _order(times)
        messages = [unpack(found.messages[index]) for index in order]
        indices = np.array(found.indices, dtype=np.int64)[order]
        topics[name] = Topic(name, found.type_name, times[order], messages, indices)
    expected = information.get('message_count')
    if expected is not None and count != expected:
        warnings.append(
            f'{path}: metadata.yaml counts {shown(expected)} messages, {count} were read'
        )
    return Bag(path, topics, tuple(warnings))


def _order(times: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices that sort messages by time within each pass."""
    latest = np.maximum.accumulate(times) if len(times) else times
    passes = np.zeros(len(times), dtype=np.int64)
    start = 0
    while (cuts := np.flatnonzero(times[start:] < latest[start:] - PASS)).size:
        start += int(cuts[0])
        passes[start:] += 1
        latest[start:] = np.maximum.accumulate(times[start:])
    return np.lexsort((times, passes))


@dataclass
class _Gathered:
    type_name: str
    times: list[int] = field(default_factory=list)
    messages: list[bytes] = field(default_factory=list)
    indices: list[int] = field(default_factory=list)
    sequences: list[int] = field(default_factory=list)  # of bags that this package recorded
    out_of_range: int = 0

    @property
    def missing(self) -> int:
        """Number of recorded messages that are missing, by gaps in their sequence numbers."""
        numbers = set(self.sequences)
        return max(numbers) - min(numbers) + 1 - len(numbers) if numbers else 0

    def take(self, message: Message, index: int) -> None:
        """Add a message, with its index in the order of recording."""
        if message.log_time > _LATEST:
            self.out_of_range += 1
            return
        self.times.append(message.log_time)
        self.messages.append(message.data)
        self.indices.append(index)


def _one_type_each(
    gathered: Mapping[tuple[str, str], _Gathered], path: Path, warnings: list[str]
) -> dict[str, _Gathered]:
    """The type of each topic that this package reads, else that of most messages."""
    by_name: dict[str, list[_Gathered]] = {}
    for (name, _), found in gathered.items():
        by_name.setdefault(name, []).append(found)
    chosen = {}
    for name, several in by_name.items():
        several.sort(
            key=lambda found: (
                bool(found.messages),
                found.type_name in HASHES,
                len(found.messages),
            ),
            reverse=True,
        )
        chosen[name] = several[0]
        warnings += [
            f'{path}: topic {name} has two types; {len(other.messages)} messages of '
            f'{other.type_name} are left out, those of {several[0].type_name} are read'
            for other in several[1:]
            if other.messages
        ]
    return chosen


def _read_file(
    file: Path,
    gathered: dict[tuple[str, str], _Gathered],
    types: Mapping[str, str],
    counter: Iterator[int],
    warnings: list[str],
) -> int:
    """Add the messages of one file to `gathered`; their number, with repeated ones."""
    schemas: dict[int, str] = {}
    channels: dict[int, _Gathered | None] = {}  # None: not CDR
    unknown_topic = count = 0
    numbered = False
    others: dict[str, str] = {}  # encoding of topics that are not CDR
    for record in read_records(file, warnings):
        if isinstance(record, Header):
            numbered = record.library == LIBRARY
        elif isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            channels[record.id] = None
            if record.message_encoding == 'cdr':
                name = record.topic
                type_name = schemas.get(record.schema_id) or types.get(name, 'unknown')
                channels[record.id] = gathered.setdefault((name, type_name), _Gathered(type_name))
            else:
                others[record.topic] = record.message_encoding
        elif record.channel_id not in channels:
            unknown_topic += 1
        elif topic := channels[record.channel_id]:
            count += 1
            if numbered:
                if record.sequence in topic.sequences[-1:]:
                    continue  # a latched message, repeated at the start of a file
                topic.sequences.append(record.sequence)
            topic.take(record, next(counter))
    warnings += [
        f'{file}: topic {shown(name)} is left out: its messages are encoded as {shown(encoding)}, '
        'expected cdr, as ROS 2 records them'
        for name, encoding in others.items()
    ]
    if unknown_topic:
        warnings.append(
            f'{file}: {unknown_topic} messages are lost, as the record of their topic is damaged'
        )
    return count
