# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs of predictions from one start."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError
from ..forecasts.interpolation import interpolate
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array
from ..tracking.usable_frames import GAP, median_interval, Stamps

# a stamp further off the grid than this part of a period belongs to another start
RESTART_TOLERANCE = 0.01


class AlignmentError(UserError):
    """Predicted and tracked poses of a bag cannot be compared."""


@dataclass(frozen=True)
class Run:
    """Predictions at equal times.

    Args:
        stamps: Times predicted for [ns], those of bridged frames too, shape (frames,).
        poses: Position [m] and quaternion (x, y, z, w), shape (frames, n, 7).
        frame_id: Coordinate frame.
        dt: Time between two frames [s].
        bridged: Number of frames that were missing and are interpolated.
        part: Which of the predictions these are.
    """

    stamps: Stamps
    poses: Array
    frame_id: str
    dt: float
    bridged: int
    part: slice


def longest_run(
    frames: list[PoseArrayFrame], *, every: bool, starts: Stamps | None = None
) -> tuple[Run, dict[str, int]]:
    """Return the longest stretch of predictions from one start.

    A start is taken to be new where a stamp is not one period after the one before (the period is
    the median), or where the number of spheres or the frame changes. Where one or two predictions
    are missing, their poses are interpolated.

    Args:
        frames: Predictions in the order of recording.
        every: Each prediction starts from a tracked frame of its own, so that stamps follow the
            tracker's: only a step of more than half a period off ends a run.
        starts: Number of the start of each prediction, or of its set of spheres where each has a
            start of its own, where that was recorded, shape (frames,).

    Returns:
        The run, and `restarts` and `missing` frames of the whole recording.

    Raises:
        AlignmentError: There are fewer than two predictions in a row.
    """
    stamps, advance, restart, changed = _steps(frames)
    if starts is not None:
        anew = np.diff(starts) != 0
        restart, changed = restart | anew, changed | anew
    period = median_period(stamps)
    off = np.abs(np.diff(stamps) - advance * period)
    ends = (changed | (off > 0.5 * period) if every else restart) | (advance > GAP)
    bounds = [0, *(np.flatnonzero(ends) + 1), len(frames)]
    lengths = np.diff(bounds)
    start = bounds[int(np.argmax(lengths))]
    part = slice(start, start + int(lengths.max()))
    if lengths.max() < 2:
        raise AlignmentError(
            f'{len(frames)} predictions hold no two in a row that are one period of '
            f'{period * 1e-9:.4g} s apart'
        )
    run = _bridge(
        stamps[part],
        np.stack([frame.poses for frame in frames[part]]),
        advance[part.start : part.stop - 1],
        frames[start].frame_id,
        part,
    )
    missing = int((advance[~restart] - 1).sum())
    return run, {'restarts': int(restart.sum()), 'missing': missing}


def _bridge(
    stamps: Stamps, poses: Array, advance: NDArray[np.int_], frame_id: str, part: slice
) -> Run:
    places = np.concatenate([[0], np.cumsum(advance)])
    frames = np.arange(places[-1] + 1)
    full_stamps = np.rint(np.interp(frames, places, (stamps - stamps[0]).astype(float)))
    full_stamps = full_stamps.astype(np.int64) + stamps[0]
    bridged = len(frames) - len(stamps)
    return Run(
        full_stamps,
        interpolate(stamps, poses, full_stamps) if bridged else poses,
        frame_id,
        float(full_stamps[-1] - full_stamps[0]) * 1e-9 / (len(frames) - 1),
        bridged,
        part,
    )


def from_one_start(frames: list[PoseArrayFrame]) -> list[slice]:
    """Predictions by start, cut where one is told from the stamps as in `longest_run`."""
    if len(frames) < 2:
        return [slice(0, len(frames))]
    _, _, restart, _ = _steps(frames)
    bounds = [0, *(np.flatnonzero(restart) + 1), len(frames)]
    return [slice(int(begin), int(end)) for begin, end in pairwise(bounds)]


def median_period(stamps: Stamps) -> float:
    """Median of the steps forward [ns].

    Raises:
        AlignmentError: There is none.
    """
    period = median_interval(stamps)
    if not period:
        raise AlignmentError(
            f'{len(stamps)} predictions hold no two in a row; record for longer, '
            'or see why the predictor was not started'
        )
    return period


def _steps(
    frames: list[PoseArrayFrame],
) -> tuple[Stamps, NDArray[np.int_], NDArray[np.bool_], NDArray[np.bool_]]:
    """Stamps [ns]; of each step: periods, whether a start is in it, whether spheres changed."""
    stamps = np.array([frame.stamp_ns for frame in frames], dtype=np.int64)
    period, steps = median_period(stamps), np.diff(stamps)
    advance = np.maximum(np.rint(steps / period), 1).astype(int)
    changed = np.array(
        [
            (before.frame_id, before.poses.shape) != (after.frame_id, after.poses.shape)
            for before, after in pairwise(frames)
        ]
    )
    restart = changed | (np.abs(steps - advance * period) > RESTART_TOLERANCE * period)
    return stamps, advance, restart, changed
