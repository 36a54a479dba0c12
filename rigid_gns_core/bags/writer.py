# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records messages into a rosbag2 folder (MCAP and metadata.yaml) without ROS.

It writes what rosbag2 of ROS 2 Jazzy writes, key for key, so that `ros2 bag`, `rosbags` and
`mcap-ros2-support` read it. docs/bags.md describes the format.
"""

from __future__ import annotations

import atexit
from collections import deque
from collections.abc import Callable
import math
from pathlib import Path
import sys
import threading
import time

from .metadata import Qos, qos_profiles, RecordedTopic
from .splits import SplitBag
from ..errors import UserError
from ..messages.definitions import type_hash

FLUSH_PERIOD = 0.5  # [s]; a killed process loses at most this much
# the thread looks so often for messages [s]: woken for each, it would take Python's lock from the
# caller as often
_TURN = 0.02


class BagWriter:
    """Recorder of messages, in a thread of its own: `write` only queues.

    Messages are flushed every 0.5 s, so that a killed process loses no more than that (`read_bag`
    reads the rest). `close` writes the index and metadata.yaml; it also runs at interpreter exit.
    If writing fails, recording stops, `error` holds the reason, and the caller continues.

    Args:
        folder: Folder to create; must not exist.
        max_size: Size at which the next file is begun [MB = 1e6 bytes]; 0: one file.
        max_duration: Duration, by log times, at which the next file is begun [s]; 0: one file.
        queue_bytes: Largest size of the queue [bytes]; messages beyond are counted in `lost`.
        on_error: Called from the recording thread with a sentence, once when recording has stopped
            and once when the first message was lost.

    Raises:
        FileExistsError: The folder exists already.
        OSError: The folder cannot be created.
        UserError: A limit is negative or not finite.
    """

    def __init__(
        self,
        folder: str | Path,
        *,
        max_size: float = 0.0,
        max_duration: float = 0.0,
        queue_bytes: int = 256 * 2**20,
        on_error: Callable[[str], None] | None = None,
    ) -> None:
        for name, limit in (('max_size', max_size), ('max_duration', max_duration)):
            if not (math.isfinite(limit) and limit >= 0):
                raise UserError(f'{name} is {limit}, expected 0 (no limit) or more')
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError:
            raise FileExistsError(
                f'{self.folder} exists already and a bag is never overwritten; '
                'choose another folder or remove it'
            ) from None
        self._bag = SplitBag(
            self.folder, max_size=round(max_size * 1e6), max_duration_ns=round(max_duration * 1e9)
        )
        self._queue: deque[tuple[RecordedTopic, bytes, int] | RecordedTopic] = deque()
        self._ending = threading.Event()
        self._queue_bytes, self._waiting = queue_bytes, 0
        self._lock = threading.Lock()
        self._on_error = on_error
        self._topics: dict[str, RecordedTopic] = {}
        self._lost, self._loss_reported = 0, False
        self._error: str | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._record, name='bag writer', daemon=True)
        self._thread.start()
        atexit.register(self.close)

    @property
    def error(self) -> str | None:
        """Why recording has stopped, or None."""
        return self._error

    @property
    def lost(self) -> int:
        """Number of messages passed to `write` that were not recorded."""
        return self._lost

    @property
    def topics(self) -> dict[str, int]:
        """Number of messages recorded so far, by topic."""
        return {name: topic.sequence for name, topic in self._topics.items()}

    def add_topic(self, name: str, type_name: str, qos: Qos, depth: int | None = None) -> None:
        """Register a topic.

        Args:
            name: Resolved name, such as `/lab/predicted_poses`.
            type_name: Type, such as `geometry_msgs/msg/PoseArray`.
            qos: QoS profile of its publisher: `reliable` (depth 10), `sensor_data` (best effort,
                depth 5) or `latched` (transient local, depth 1).
            depth: Depth of its history, where it is another.

        Raises:
            UserError: The type or profile is unknown, the name lacks its leading slash, or the
                topic was added with another type or profile.
        """
        qos_profiles(qos)  # both raise where the name is unknown
        type_hash(type_name)
        if not name.startswith('/'):
            raise UserError(f'topic {name!r} does not start with a slash; give its resolved name')
        known = self._topics.get(name)
        if known and (known.type_name, known.qos) != (type_name, qos):
            raise UserError(f'topic {name} was added before, with {known.type_name}, {known.qos}')
        if not known:
            self._topics[name] = topic = RecordedTopic(name, type_name, qos, depth)
            self._queue.append(topic)

    def write(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
        """Queue one message; never waits for the disk.

        After `close` or an error, with a full queue, or with a log time before the epoch [ns], the
        message is counted in `lost`.

        Raises:
            UserError: The topic was not added.
        """
        entry = self._topics.get(topic)
        if entry is None:
            raise UserError(f'topic {topic} was not added; added: {", ".join(self._topics)}')
        with self._lock:
            if (
                self._closed
                or self._error
                or not 0 <= log_time_ns < 2**63
                or self._waiting + len(cdr) > self._queue_bytes
            ):
                self._lost += 1
                return
            self._waiting += len(cdr)
            self._queue.append((entry, bytes(cdr), int(log_time_ns)))

    def close(self) -> None:
        """Write the queue, the index and metadata.yaml. A second call does nothing."""
        with self._lock:
            first, self._closed = not self._closed, True
        if first:
            self._ending.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()
        atexit.unregister(self.close)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    # --- the recording thread ---

    def _record(self) -> None:
        try:
            self._bag.start()
            self._drain()
            self._bag.finish()
            self._report_loss()
        except Exception as error:  # no failure of recording may stop the caller
            with self._lock:
                self._error = f'recording into {self.folder} has stopped: {error}'
                self._lost += self._bag.unflushed + self._discard()
            self._report(self._error)
        finally:
            self._bag.close()

    def _drain(self) -> None:
        flush_at = time.monotonic() + FLUSH_PERIOD
        ending = False
        while not ending:
            hurry = self._waiting > self._queue_bytes // 8
            ending = self._ending.wait(0.0 if hurry else _TURN)  # nothing is queued after it
            for _ in range(len(self._queue)):
                item = self._queue.popleft()
                if isinstance(item, RecordedTopic):
                    self._bag.register(item)
                else:
                    with self._lock:
                        self._waiting -= len(item[1])
                    self._bag.add(*item)
            if time.monotonic() >= flush_at:
                self._bag.flush()
                self._report_loss()
                flush_at = time.monotonic() + FLUSH_PERIOD

    def _discard(self) -> int:
        """Empty the queue; the number of messages dropped."""
        count = 0
        while self._queue:
            count += isinstance(self._queue.popleft(), tuple)
        return count

    def _report_loss(self) -> None:
        if self._lost and not self._loss_reported:
            self._loss_reported = True
            self._report(f'{self.folder} does not hold every message: {self._lost} lost so far')

    def _report(self, text: str) -> None:
        if self._on_error is None:
            print(f'rigid_gns_ros: {text}', file=sys.stderr)
        else:
            self._on_error(text)
