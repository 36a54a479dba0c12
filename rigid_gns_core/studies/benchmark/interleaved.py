# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""All peers through one scene in turns, so that what else the machine does meets all alike."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import time
from typing import Any

import numpy as np

from .peers import Peer, Run
from .scenes import BenchScene
from ...errors import UserError
from ...scenes.state import Array

BLOCK = 5
"""Frames that a peer takes before it is the next one's turn."""


@dataclass
class PeerRecord:
    """One peer in one scene.

    Args:
        peer: Who.
        seconds: Wall clock of each frame, one list for each repeat [s].
        positions: Centres of each frame of the first repeat [m], the start included, shape (n, 3)
            each; ends where it blew up.
        refused: Why it does not take the scene, or None.
        stopped: The error with which it blew up, or None.
    """

    peer: Peer
    seconds: list[list[float]] = field(default_factory=list)
    positions: list[Array] = field(default_factory=list)
    refused: str | None = None
    stopped: str | None = None


def run_interleaved(
    scene: BenchScene,
    peers: Sequence[Peer],
    repeats: int,
    on_repeat: Callable[[], None] = lambda: None,
) -> list[PeerRecord]:
    """Run the whole scene `repeats` times, in each all peers in turns of `BLOCK` frames.

    In a turn all peers go through the same frames, so a peer's repeat is beside those of the
    others within seconds. What begins a scene is not timed, its first frame is.

    Args:
        scene: What is simulated.
        peers: By whom.
        repeats: How often.
        on_repeat: Called after each repeat.
    """
    records = [PeerRecord(peer) for peer in peers]
    for repeat in range(repeats):
        runs = {
            index: run for index, record in enumerate(records) if (run := _begin(record, scene))
        }
        try:
            for first in range(0, scene.frames, BLOCK):
                count = min(BLOCK, scene.frames - first)
                # who is first in a turn finds other caches than who is last: not always the same
                order = sorted(runs, key=lambda index: (index + repeat + first) % len(records))
                for index in order:
                    if not _advance(records[index], runs[index], count, keep=repeat == 0):
                        runs.pop(index).close()
        finally:
            for run in runs.values():
                run.close()
        on_repeat()
    return records


def timing(record: PeerRecord) -> dict[str, Any] | None:
    """Seconds per frame of a record; None where it did not take a frame.

    Returns:
        `seconds_per_frame` with `median`, `p10` and `p90` over repeats [s], each repeat the mean
        of its frames; `frames_per_second` of the median; `latency` with `p50`, `p99` and `worst`
        of all single frames [s], and how many they are, `frames`.
    """
    repeats = [seconds for seconds in record.seconds if seconds]
    if not repeats:
        return None
    means = [float(np.mean(seconds)) for seconds in repeats]
    frames = np.concatenate(repeats)
    low, middle, high = np.percentile(means, [10, 50, 90]).tolist()
    half, most = np.percentile(frames, [50, 99]).tolist()
    return {
        'seconds_per_frame': {'median': middle, 'p10': low, 'p90': high},
        'frames_per_second': 1.0 / middle,
        'latency': {'p50': half, 'p99': most, 'worst': float(frames.max()), 'frames': len(frames)},
    }


def _begin(record: PeerRecord, scene: BenchScene) -> Run | None:
    if record.refused is not None:
        return None
    try:
        run = record.peer.start(scene.scene, scene.start)
    except UserError as error:
        record.refused = str(error)
        return None
    if not record.seconds:
        record.positions.append(scene.start.positions)
    record.seconds.append([])
    return run


def _advance(record: PeerRecord, run: Run, frames: int, *, keep: bool) -> bool:
    """Take some frames; False: it blew up."""
    clock = time.perf_counter
    for _ in range(frames):
        try:
            before = clock()
            positions = run.advance()
            after = clock()
        except FloatingPointError as error:
            record.stopped = str(error)
            return False
        record.seconds[-1].append(after - before)
        if keep:
            record.positions.append(positions)
        if not np.isfinite(positions).all():
            record.stopped = 'a position is not finite'
            return False
    return True
