# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One MCAP file of a bag, while it is written."""

from __future__ import annotations

import io
import os
from pathlib import Path

from mcap.writer import CompressionType, Writer

from .metadata import qos_yaml, RecordedFile, RecordedTopic
from ..messages.definitions import full_text, type_hash

LIBRARY = 'rigid_gns_ros'  # in the header: its sequence numbers count messages without a gap
_CHUNK_SIZE = 768 * 1024  # rosbag2's
_MESSAGE = 47  # bytes of a message record and of its index entry, without its data


class BagFile:
    """Writer of one MCAP file. Used from one thread.

    Args:
        path: File to create; must not exist.

    Raises:
        OSError: The file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.information = RecordedFile(path.name)
        self._raw = open(path, 'xb', buffering=0)  # noqa: SIM115 - closed by `close`
        self._stream = io.BufferedWriter(self._raw)
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_SIZE, compression=CompressionType.NONE
        )
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._pending = 0  # bytes of the open chunk

    @property
    def size(self) -> int:
        """Bytes written and pending, without the index at the end."""
        return self._stream.tell() + self._pending

    def start(self) -> None:
        """Write the header."""
        self._writer.start(profile='ros2', library=LIBRARY)

    def register(self, topic: RecordedTopic) -> None:
        """Register a topic, with the full text of its message definition."""
        if topic.type_name not in self._schemas:
            self._schemas[topic.type_name] = self._writer.register_schema(
                topic.type_name, 'ros2msg', full_text(topic.type_name).encode()
            )
        self._channels[topic.name] = self._writer.register_channel(
            topic.name,
            'cdr',
            self._schemas[topic.type_name],
            {
                'offered_qos_profiles': qos_yaml(topic.qos, topic.depth),
                'topic_type_hash': type_hash(topic.type_name),
            },
        )

    def add(self, topic: str, cdr: bytes, log_time_ns: int, sequence: int) -> None:
        """Add a message."""
        before = self._stream.tell()
        self._writer.add_message(
            self._channels[topic], log_time_ns, cdr, publish_time=log_time_ns, sequence=sequence
        )
        written = self._stream.tell() > before
        self._pending = 0 if written else self._pending + len(cdr) + _MESSAGE
        self.information.take(log_time_ns)

    def flush(self) -> None:
        """Close the chunk and hand it to the operating system, to survive a killed process."""
        self._writer.flush()
        self._pending = 0

    def finish(self, information: str) -> None:
        """Write the metadata of the bag so far, as YAML, and the index, and close the file."""
        self._writer.add_metadata('rosbag2', {'serialized_metadata': information})
        self._writer.finish()
        self._stream.flush()
        os.fsync(self._raw.fileno())
        self.close()

    def close(self) -> None:
        """Close the file without an index."""
        self._raw.close()
