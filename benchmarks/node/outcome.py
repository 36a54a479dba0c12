# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Outcome of a run of the simulator node: log, bag, and notes of tracker and listener."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any

from mcap.records import Channel, Message
import numpy as np
from peers import frame_of, stamp_of
from rigid_gns_core.bags.mcap_records import read_records
from rigid_gns_core.messages.poses import decode_float64
import yaml

COUNTS = re.compile(r'stopped: (\d+) published, (\d+) late, (\d+) skipped, (\d+) rejected')
ERRORS = ('[ERROR]', '[FATAL]', 'Traceback')


@dataclass(frozen=True)
class Recorded:
    """Predictions in the bag.

    Args:
        stamps: Sorted [ns], int64.
        lateness: Log time less stamp of each [s].
        step_times: Of the model [s].
        waits: From the arrival of each frame that has a future to its publication [s].
        crossing_waits: Likewise to that of its crossings [s].
        files: Number of files.
        warnings: What is wrong with the bag.
    """

    stamps: np.ndarray
    lateness: np.ndarray
    step_times: np.ndarray
    waits: np.ndarray
    crossing_waits: np.ndarray
    files: int
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run.

    Args:
        period: Of predictions [s].
        tracked_dt: Time between tracked frames [s].
        sent: See `peers.play`.
        heard: See `peers.listen`.
        counts: The node's own: published, late, skipped, rejected.
        recorded: The bag.
        memory: Seconds since the start and resident bytes of the simulator, shape (samples, 2).
        stolen: System time [ns] and time that the host has taken from this machine by then [s],
            shape (polls, 2).
        processor_share: Of one core, that the simulator used.
        errors: Lines of its log.
        warnings: Number of warnings in its log.
        load: Load average before and after.
        learned: Learned scenes that were taken.
    """

    period: float
    tracked_dt: float
    sent: np.ndarray
    heard: dict[str, np.ndarray]
    counts: dict[str, int]
    recorded: Recorded
    memory: np.ndarray
    stolen: np.ndarray
    processor_share: float
    errors: tuple[str, ...]
    warnings: int
    load: dict[str, Any]
    learned: int


def read_counts(log: str) -> dict[str, int]:
    found = COUNTS.search(log)
    if found is None:
        raise RuntimeError('the log of the simulator does not end with its counts')
    names = ('published', 'late', 'skipped', 'rejected')
    return dict(zip(names, map(int, found.groups()), strict=True))


def errors_of(log: str) -> tuple[str, ...]:
    """Lines of a log with errors."""
    return tuple(line for line in log.splitlines() if any(word in line for word in ERRORS))


def read_recorded(folder: Path) -> Recorded:
    """Read a bag message by message, as that of half an hour need not fit into memory."""
    information = yaml.safe_load((folder / 'metadata.yaml').read_text(encoding='utf-8'))
    files = information['rosbag2_bagfile_information']['relative_file_paths']
    warnings: list[str] = []
    predicted: list[tuple[int, int]] = []
    arrivals: dict[int, int] = {}
    waits: list[int] = []
    crossing_waits: list[int] = []
    step_times: list[float] = []
    for file in files:
        topics: dict[int, str] = {}
        for record in read_records(folder / file, warnings):
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                topic = topics[record.channel_id]
                if topic == '/predicted_poses':
                    predicted.append((stamp_of(record.data), record.log_time))
                elif topic == '/tracked_poses':
                    arrivals[stamp_of(record.data)] = record.log_time
                elif topic == '/predicted_trajectory':
                    waits.append(record.log_time - arrivals[stamp_of(record.data)])
                elif topic == '/simulator/crossings':
                    crossing_waits.append(record.log_time - arrivals[frame_of(record.data)])
                elif topic == '/simulator/step_time':
                    step_times.append(decode_float64(record.data))
    rows = np.array(sorted(predicted), dtype=np.int64).reshape(-1, 2)
    told = tuple(text.replace(str(folder), 'BAG') for text in warnings)
    lateness = (rows[:, 1] - rows[:, 0]) * 1e-9
    return Recorded(
        stamps=rows[:, 0],
        lateness=lateness,
        step_times=np.array(step_times),
        waits=1e-9 * np.array(waits, dtype=np.float64),
        crossing_waits=1e-9 * np.array(crossing_waits, dtype=np.float64),
        files=len(files),
        warnings=told,
    )


def quantiles(seconds: np.ndarray) -> dict[str, float] | None:
    """Median, 99 % quantile and maximum of times [s], in ms; None without any."""
    if not len(seconds):
        return None
    values = (1e3 * np.quantile(seconds, (0.5, 0.99, 1.0))).round(3).tolist()
    return dict(zip(('p50', 'p99', 'worst'), values, strict=True))
