# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag split into several files, and its metadata.yaml."""

from __future__ import annotations

import os
from pathlib import Path

from .file import BagFile
from .metadata import information_yaml, metadata_yaml, RecordedFile, RecordedTopic


class SplitBag:
    """Writer of a bag in files of limited size and duration. Used from one thread.

    Like rosbag2, it begins the next file before the first message beyond a limit and registers all
    topics in each file. The last message of a latched topic is repeated at the start of each file,
    with the log time of the last message before it, so that each file can be read by itself;
    rosbag2 of Jazzy does not do that, later ones with `--repeat-transient-local`.

    Args:
        folder: Folder of the bag; must exist.
        max_size: Largest size of a file without its index [bytes]; 0: no limit.
        max_duration_ns: Longest time from first to last message of a file [ns]; 0: no limit.

    Raises:
            OSError: The first file cannot be created.
    """

    def __init__(self, folder: Path, *, max_size: int, max_duration_ns: int) -> None:
        self.folder = folder
        self.unflushed = 0  # messages that would be lost if the process were killed
        self._max_size, self._max_duration = max_size, max_duration_ns
        self._topics: list[RecordedTopic] = []
        self._latched: dict[str, tuple[RecordedTopic, int, bytes]] = {}
        self._last_ns = 0
        self._repeated = 0  # latched messages at the start of the present file
        self._finished: list[RecordedFile] = []
        self._file = self._next()

    def start(self) -> None:
        """Write the header of the first file."""
        self._file.start()

    def register(self, topic: RecordedTopic) -> None:
        """Register a topic."""
        self._topics.append(topic)
        self._file.register(topic)

    def add(self, topic: RecordedTopic, cdr: bytes, log_time_ns: int) -> None:
        """Add a message, beginning the next file where a limit is reached."""
        self.unflushed += 1
        if self._full(len(cdr), log_time_ns):
            self._split()
        self._write(topic, cdr, log_time_ns, topic.sequence)
        if topic.qos == 'latched':
            self._latched[topic.name] = topic, topic.sequence, cdr
        topic.sequence += 1
        self._last_ns = log_time_ns

    def flush(self) -> None:
        """Hand all messages to the operating system."""
        self._file.flush()
        self.unflushed = 0

    def finish(self) -> None:
        """Write the index of the last file and metadata.yaml."""
        information = self._information()
        self._file.finish(information)
        self.unflushed = 0
        # atomically: a bag with half a metadata.yaml is worse than one without
        temporary = self.folder / 'metadata.yaml.tmp'
        with open(temporary, 'w', encoding='utf-8') as file:
            file.write(metadata_yaml(information))
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, self.folder / 'metadata.yaml')

    def close(self) -> None:
        """Close the present file without an index."""
        self._file.close()

    def _full(self, size: int, log_time_ns: int) -> bool:
        file = self._file.information
        if file.count == self._repeated:  # a message larger than the limit has a file of its own
            return False
        beyond = self._max_size and self._file.size + size > self._max_size
        late = self._max_duration and log_time_ns - file.first_ns > self._max_duration
        return bool(beyond or late)

    def _split(self) -> None:
        self._file.finish(self._information())
        self.unflushed = 1  # the message that is about to be added
        self._finished.append(self._file.information)
        self._file = self._next()
        self._file.start()
        for topic in self._topics:
            self._file.register(topic)
        for topic, sequence, cdr in self._latched.values():
            self._write(topic, cdr, self._last_ns, sequence)
        self._repeated = len(self._latched)

    def _next(self) -> BagFile:
        name = f'{self.folder.resolve().name}_{len(self._finished)}.mcap'
        return BagFile(self.folder / name)

    def _write(self, topic: RecordedTopic, cdr: bytes, log_time_ns: int, sequence: int) -> None:
        self._file.add(topic.name, cdr, log_time_ns, sequence)
        topic.count += 1

    def _information(self) -> str:
        return information_yaml([*self._finished, self._file.information], self._topics)
