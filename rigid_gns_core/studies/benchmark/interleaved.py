# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Interleaved runs of all peers, so that other load on the machine affects all of them alike."""

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
"""Frames that a peer takes in its turn."""


@dataclass
class PeerRecord:
    """Times and positions of one peer in one scene.

    Args:
        peer: The peer.
        seconds: Wall-clock time of each frame [s], a list for each repeat.
        positions: Centres at the start and after each frame of the first repeat [m], shape (n, 3)
            each; ends where the peer diverged.
        refused: Why it does not support the scene; None: it does.
        stopped: The error with which it diverged; None: it did not.
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
    """Run the whole scene `repeats` times, with the peers in turns of `BLOCK` frames.

    Within a turn all peers simulate the same frames, so that they are timed within seconds of each
    other. Setting up a scene is not timed; its first frame is.

    Args:
        scene: Scene to simulate.
        peers: Peers to run.
        repeats: Number of repeats.
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
                # the order varies, as the first peer of a turn finds other caches than the last
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
    """Timing of a peer; None where it took no frame.

    Returns:
        `seconds_per_frame` with `median`, `p10` and `p90` over the means of repeats [s];
        `frames_per_second` of the median; `latency` with `p50`, `p99` and `worst` of single frames
        [s], and their number `frames`.
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
    """Advance a peer by some frames; False: it diverged."""
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
