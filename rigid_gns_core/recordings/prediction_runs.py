# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Runs: consecutive predictions from one start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError
from ..forecasts.interpolation import interpolate
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array
from ..tracking.usable_frames import covered, GAP, median_interval, Stamps

# a stamp further off the grid belongs to another start [periods]
RESTART_TOLERANCE = 0.01


class AlignmentError(UserError):
    """Predicted and tracked poses of a bag cannot be compared."""


@dataclass(frozen=True)
class Run:
    """Predictions at equal intervals.

    Args:
        stamps: Predicted times [ns], with those of interpolated frames, shape (frames,).
        poses: Position [m] and quaternion (x, y, z, w), shape (frames, n, 7).
        frame_id: Coordinate frame.
        dt: Time between two frames [s].
        bridged: Number of missing frames that are interpolated.
        part: Range of these predictions among all recorded ones.
    """

    stamps: Stamps
    poses: Array
    frame_id: str
    dt: float
    bridged: int
    part: slice


def ranked_runs(
    frames: list[PoseArrayFrame], tracked: Stamps, *, every: bool, starts: Stamps | None = None
) -> tuple[Iterator[Run], dict[str, int]]:
    """Runs of predictions from one start, those first of which most can be compared.

    These hold the longest parts in which tracked frames are not missing; of several, and where
    there are no tracked frames, the longest. Of runs without tracked frames only the first is
    given.

    A new start is assumed where a stamp is not one median period after the previous one, or where
    the number of spheres or the coordinate frame changes. One or two missing predictions in a row
    are interpolated.

    Args:
        frames: Predictions in the order of recording.
        tracked: Stamps of the tracked frames in any order [ns], shape (m,).
        every: Whether each prediction has its own start, so that stamps follow the tracker's: then
            only a step that is off by more than half a period ends a run.
        starts: Index of the recorded start of each prediction, or of its set of spheres where each
            has its own start, shape (frames,); None: not recorded.

    Returns:
        The runs, and the numbers of `restarts` and `missing` frames of the whole recording.

    Raises:
            AlignmentError: No two predictions are consecutive.
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
    if lengths.max() < 2:
        raise AlignmentError(
            f'{len(frames)} predictions hold no two in a row that are one period of '
            f'{period * 1e-9:.4g} s apart'
        )
    parts = [slice(int(begin), int(end)) for begin, end in pairwise(bounds)]
    known = np.unique(tracked)
    beside = covered(stamps, known) if len(known) else np.zeros(len(stamps), dtype=np.bool_)
    shares = [_longest(beside[part]) for part in parts]
    order = sorted(range(len(parts)), key=lambda k: (shares[k], lengths[k]), reverse=True)
    chosen = [parts[k] for k in order if lengths[k] > 1 and (shares[k] > 1 or k == order[0])]
    runs = (
        _bridge(
            stamps[part],
            np.stack([frame.poses for frame in frames[part]]),
            advance[part.start : part.stop - 1],
            frames[part.start].frame_id,
            part,
        )
        for part in chosen or [parts[int(np.argmax(lengths))]]
    )
    missing = int((advance[~restart] - 1).sum())
    return runs, {'restarts': int(restart.sum()), 'missing': missing}


def _longest(flags: NDArray[np.bool_]) -> int:
    """Length of the longest part that is true throughout."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _bridge(
    stamps: Stamps, poses: Array, advance: NDArray[np.int_], frame_id: str, part: slice
) -> Run:
    periods = np.concatenate([[0], np.cumsum(advance)])
    frames = np.arange(periods[-1] + 1)
    full_stamps = np.rint(np.interp(frames, periods, (stamps - stamps[0]).astype(float)))
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


def split_by_start(frames: list[PoseArrayFrame]) -> list[slice]:
    """Ranges of predictions by start, told from the stamps as in `ranked_runs`."""
    if len(frames) < 2:
        return [slice(0, len(frames))]
    _, _, restart, _ = _steps(frames)
    bounds = [0, *(np.flatnonzero(restart) + 1), len(frames)]
    return [slice(int(begin), int(end)) for begin, end in pairwise(bounds)]


def median_period(stamps: Stamps) -> float:
    """Median of the positive steps between stamps [ns].

    Raises:
        AlignmentError: There is no such step.
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
    """Stamps [ns]; of each step: periods, whether a start lies in it, whether spheres changed."""
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
