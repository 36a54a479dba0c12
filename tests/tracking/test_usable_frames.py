# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Usable frames: a recording is judged by the same rules as frames on arrival in the node."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from rigid_gns_core.messages.poses import PoseArrayFrame
from rigid_gns_core.tracking.usable_frames import (
    covered,
    MEMORY,
    RejectedFrame,
    RESTART_FRAMES,
    short_gaps,
    usable_passes,
    WINDOW_GAP,
)
from tracking_windows import tracking_window

DT = 100_000_000  # [ns]
STAMP_KINDS = ('duplicate', 'late', 'ahead')


def frame(stamp: int, *, frame_id: str = 'world', count: int = 2) -> PoseArrayFrame:
    poses = np.zeros((count, 7))
    poses[:, 0], poses[:, 6] = 3.0 * np.arange(count), 1.0
    return PoseArrayFrame(stamp, frame_id, poses)


def recorded(rng: np.random.Generator) -> tuple[list[PoseArrayFrame], np.ndarray]:
    """Frames of a tracker with all kinds of trouble, and the times of their arrival."""
    frames, times, stamp, now = [], [], 100 * DT, 0
    for _ in range(300):
        stamp, now, sent = stamp + DT, now + DT, stamp
        trouble = rng.random()
        if trouble < 0.05:
            sent = stamp - int(rng.integers(0, 9)) * DT - int(rng.integers(2)) * DT // 2
        elif trouble < 0.07:
            sent = stamp + 50 * DT
        elif trouble < 0.09:
            stamp = sent = int(rng.integers(2)) * DT + stamp // 2  # restarted
        elif trouble < 0.11:
            stamp, now = stamp + 20 * DT, now + 20 * DT  # a pause
        one = frame(sent, frame_id='other' if trouble > 0.98 else 'world')
        if 0.96 < trouble <= 0.98:
            one.poses[: int(rng.integers(3)), 0] = [np.nan, 1e9][int(rng.integers(2))]
        frames.append(one)
        times.append(now)
    return frames, np.array(times)


@pytest.mark.parametrize('seed', range(20))
def test_a_recording_is_decided_as_on_arrival(seed: int) -> None:
    frames, times = recorded(np.random.default_rng(seed))
    window = tracking_window(length=MEMORY, max_gap=WINDOW_GAP, radius=1.0)
    taken: list[list[int]] = [[]]
    waiting: list[tuple[int, str]] = []
    refused: Counter[str] = Counter()
    for k, (one, time) in enumerate(zip(frames, times.tolist(), strict=True)):
        try:
            restarted = window.add(one, time)
        except RejectedFrame as error:
            refused[error.kind] += 1
            if error.kind in STAMP_KINDS:
                waiting.append((k, error.kind))
            continue
        if restarted:
            before = waiting[-(RESTART_FRAMES - 1) :]
            refused.subtract(kind for _, kind in before)
            taken.append([index for index, _ in before])
        taken[-1].append(k)
        waiting.clear()
    passes, found = usable_passes(frames, times, frame_id='world', radius=1.0)
    assert [sorted(one) for one in passes] == taken
    assert found == +refused
    for one in passes:
        assert (np.diff([frames[k].stamp_ns for k in one]) > 0).all()


def test_trouble_is_there_to_be_decided() -> None:
    kinds: Counter[str] = Counter()
    passes = 0
    for seed in range(20):
        frames, times = recorded(np.random.default_rng(seed))
        found, refused = usable_passes(frames, times, frame_id='world', radius=1.0)
        kinds += refused
        passes += len(found)
    assert {'duplicate', 'late', 'ahead', 'frame', 'not finite', 'far'} <= set(kinds)
    assert passes > 40


@pytest.mark.parametrize(('count', 'kind'), [(None, 'empty'), (2, 'count')])
def test_the_number_of_spheres(count: int | None, kind: str) -> None:
    frames = [frame(k * DT, count=[2, 0, 2][k % 3]) for k in range(9)]
    passes, refused = usable_passes(
        frames, DT * np.arange(9), frame_id='world', radius=1.0, count=count
    )
    assert (len(passes[0]), dict(refused)) == (6, {kind: 3})


def test_two_frames_may_be_missing() -> None:
    stamps = np.delete(DT * np.arange(20), [4, 5, 10, 11, 12])
    wanted = np.array([DT * 9 // 2, 11 * DT, 9 * DT, -DT])
    assert covered(wanted, stamps).tolist() == [True, False, True, False]
    seen = np.ones(20, dtype=bool)
    seen[[0, 4, 5, 10, 11, 12]] = False
    assert short_gaps(DT * np.arange(20), seen).tolist() == [4, 5]
    jitter = np.random.default_rng(0).integers(-DT // 8, DT // 8, 20)
    assert short_gaps(DT * np.arange(20) + jitter, seen).tolist() == [4, 5]


def moving(stamp: int, k: int) -> PoseArrayFrame:
    one = frame(stamp)
    one.poses[:, 1] = 0.01 * k
    return one


@pytest.mark.parametrize(
    ('ahead', 'arrived', 'kept'),
    [
        (50 * 8_000_000, 8_000_000, 1),  # the clock was set ahead by 0.4 s
        (50 * 8_000_000, 50 * 8_000_000, 7),  # frames are missing
        (3 * 8_000_000, 8_000_000, 7),  # two are missing, and this one is early
        (5 * 8_000_000, 8_000_000, 7),  # 40 ms: frames that come late
    ],
)
def test_frames_of_two_clocks_are_not_fitted_together(ahead: int, arrived: int, kept: int) -> None:
    window = tracking_window(max_gap=WINDOW_GAP)
    stamps = [10**9 + 8_000_000 * k for k in range(8)]
    times = stamps.copy()
    stamps.append(stamps[-1] + ahead)
    times.append(times[-1] + arrived)
    frames = [moving(stamp, k) for k, stamp in enumerate(stamps)]
    for one, time in zip(frames, times, strict=True):
        window.add(one, time)
    assert len(window.window_ns) == kept
    assert window.window_ns[-1] == stamps[-1]
    passes, refused = usable_passes(frames, np.array(times), frame_id='world', radius=0.02)
    assert passes == [list(range(9))] and not refused
