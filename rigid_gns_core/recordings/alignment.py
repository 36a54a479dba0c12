# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alignment: tracked poses interpolated at the predicted times."""

from __future__ import annotations

import numpy as np

from .prediction_runs import AlignmentError, Run
from ..forecasts.interpolation import interpolate
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Trajectory
from ..tracking.usable_frames import covered, Stamps


def align(
    run: Run, tracked: list[PoseArrayFrame]
) -> tuple[Trajectory, Trajectory, dict[str, float]]:
    """Predicted and tracked poses at the same times, as trajectories.

    Velocities are backward differences of the poses, in both.

    Args:
        run: Predictions of one run.
        tracked: Usable frames in the order of their stamps, see `Passes`.

    Returns:
        Predicted poses, tracked poses, and counts: `interpolated` predictions without a tracked
        frame of their stamp, `tracked_interval_s`, the longest time between two tracked frames
        used [s], and `untracked` predictions, left out as they lie in a gap of the tracked frames
        or on the shorter side of one.

    Raises:
        AlignmentError: Fewer than two consecutive predictions can be compared.
    """
    stamps = np.array([frame.stamp_ns for frame in tracked], dtype=np.int64)
    inside = (run.stamps >= stamps[0]) & (run.stamps <= stamps[-1])
    if inside.sum() < 2:
        raise AlignmentError(
            'predicted and tracked times do not overlap: predictions are for '
            f'{_span(run.stamps)}, tracked frames are of {_span(stamps)}'
        )
    within = np.flatnonzero(inside)
    kept = within[_longest_tracked(run.stamps[within], stamps)]
    if len(kept) < 2:
        raise AlignmentError('no two predictions in a row lie between tracked frames without gap')
    wanted = run.stamps[kept]
    first = int(np.searchsorted(stamps, wanted[0], side='right')) - 1
    last = int(np.searchsorted(stamps, wanted[-1], side='left'))
    stamps = stamps[first : last + 1]
    poses = np.stack([frame.poses for frame in tracked[first : last + 1]])
    reference = interpolate(stamps, poses, wanted)
    information = {
        'interpolated': int((~np.isin(wanted, stamps)).sum()),
        'tracked_interval_s': float(np.diff(stamps).max()) * 1e-9,
        'untracked': len(within) - len(kept),
    }
    predicted = run.poses[kept]
    return (
        Trajectory.from_poses(predicted[..., :3], predicted[..., 3:], run.dt),
        Trajectory.from_poses(reference[..., :3], reference[..., 3:], run.dt),
        information,
    )


def _longest_tracked(wanted: Stamps, stamps: Stamps) -> slice:
    """Longest part of `wanted` of which no time lies in a gap between `stamps`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], covered(wanted, stamps), [0]])))
    if not len(edges):
        return slice(0, 0)
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    return slice(int(starts[longest]), int(stops[longest]))


def _span(stamps: Stamps) -> str:
    return f'{stamps[0] * 1e-9:.3f} to {stamps[-1] * 1e-9:.3f} s'
