"""Recorded poses as arrays, and tracked poses at the times that were predicted for."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigid_gns_core.state import Array, Trajectory, rotate_quaternions, rotation_between

from .bag_reader import Topic
from .messages import MessageError, PoseArrayFrame, decode_pose_array

Stamps = NDArray[np.int64]

# a stamp further off the grid than this part of a period belongs to another start
RESTART_TOLERANCE = 0.01
# more frames missing in a row than this end a run
MAX_BRIDGED = 2


class AlignmentError(ValueError):
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
    """

    stamps: Stamps
    poses: Array
    frame_id: str
    dt: float
    bridged: int


def decode_topic(topic: Topic) -> tuple[list[PoseArrayFrame], Stamps, int]:
    """Frames of a topic, their log times [ns], and the number of messages that are damaged."""
    frames, times = [], []
    for time, message in zip(topic.times, topic.messages, strict=True):
        try:
            frames.append(decode_pose_array(message))
        except MessageError:
            continue
        times.append(time)
    return frames, np.array(times, dtype=np.int64), len(topic) - len(frames)


def longest_run(frames: list[PoseArrayFrame], *, every: bool) -> tuple[Run, dict[str, int]]:
    """The longest stretch of predictions from one start.

    A start is taken to be new where a stamp is not one period after the one before (the period is
    the median), or where the number of spheres or the frame changes. Where one or two predictions
    are missing, their poses are interpolated.

    Args:
        frames: Predictions in the order of recording.
        every: Each prediction starts from a tracked frame of its own, so that stamps follow the
            tracker's: only a step of more than half a period off ends a run.

    Returns:
        The run, and `restarts` and `missing` frames of the whole recording.

    Raises:
        AlignmentError: There are fewer than two predictions in a row.
    """
    stamps = np.array([frame.stamp_ns for frame in frames], dtype=np.int64)
    steps = np.diff(stamps)
    if not (steps > 0).any():
        raise AlignmentError(
            f'{len(frames)} predictions hold no two in a row; record for longer, '
            'or see why the predictor was not started'
        )
    period = float(np.median(steps[steps > 0]))
    advance = np.maximum(np.rint(steps / period), 1).astype(int)  # in periods
    changed = np.array([
        (before.frame_id, before.poses.shape) != (after.frame_id, after.poses.shape)
        for before, after in pairwise(frames)
    ])
    off = np.abs(steps - advance * period)
    restart = changed | (off > RESTART_TOLERANCE * period)
    ends = (changed | (off > 0.5 * period) if every else restart) | (advance > 1 + MAX_BRIDGED)
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
        stamps[part], np.stack([frame.poses for frame in frames[part]]),
        advance[part.start:part.stop - 1], frames[start].frame_id,
    )
    missing = int((advance[~restart] - 1).sum())
    return run, {'restarts': int(restart.sum()), 'missing': missing}


def _bridge(stamps: Stamps, poses: Array, advance: NDArray[np.int_], frame_id: str) -> Run:
    places = np.concatenate([[0], np.cumsum(advance)])
    frames = np.arange(places[-1] + 1)
    full_stamps = np.rint(np.interp(frames, places, (stamps - stamps[0]).astype(float)))
    full_stamps = full_stamps.astype(np.int64) + stamps[0]
    bridged = len(frames) - len(stamps)
    return Run(
        full_stamps, interpolate(stamps, poses, full_stamps) if bridged else poses, frame_id,
        float(full_stamps[-1] - full_stamps[0]) * 1e-9 / (len(frames) - 1), bridged,
    )


def usable_frames(
    frames: list[PoseArrayFrame], frame_id: str, count: int,
) -> tuple[list[PoseArrayFrame], dict[str, int]]:
    """Tracked frames that can be a reference, and the number of others by reason."""
    usable: list[PoseArrayFrame] = []
    dropped: Counter[str] = Counter()
    for frame in frames:
        if frame.frame_id != frame_id:
            dropped['frame'] += 1
        elif len(frame.poses) != count:
            dropped['count'] += 1
        elif not np.isfinite(frame.poses).all():
            dropped['not finite'] += 1
        elif (np.linalg.norm(frame.poses[:, 3:], axis=1) < 1e-6).any():
            dropped['quaternion'] += 1
        elif usable and frame.stamp_ns <= usable[-1].stamp_ns:
            dropped['stamp'] += 1
        else:
            usable.append(frame)
    return usable, dict(dropped)


def align(
    run: Run, tracked: list[PoseArrayFrame],
) -> tuple[Trajectory, Trajectory, dict[str, float]]:
    """Predicted and tracked poses at the same times, as trajectories.

    Velocities are backward differences of the poses, in both.

    Args:
        run: Predictions.
        tracked: Usable frames, see `usable_frames`.

    Returns:
        Predicted, tracked, and how they were aligned: `interpolated` frames (no tracked frame has
        their stamp) and `tracked_interval_s`, the longest time between two tracked frames used.

    Raises:
        AlignmentError: Fewer than two predictions lie within the tracked time.
    """
    stamps = np.array([frame.stamp_ns for frame in tracked], dtype=np.int64)
    inside = (run.stamps >= stamps[0]) & (run.stamps <= stamps[-1])
    if inside.sum() < 2:
        raise AlignmentError(
            'predicted and tracked times do not overlap: predictions are for '
            f'{_span(run.stamps)}, tracked frames are of {_span(stamps)}'
        )
    wanted = run.stamps[inside]
    first = int(np.searchsorted(stamps, wanted[0], side='right')) - 1
    last = int(np.searchsorted(stamps, wanted[-1], side='left'))
    stamps = stamps[first:last + 1]
    poses = np.stack([frame.poses for frame in tracked[first:last + 1]])
    reference = interpolate(stamps, poses, wanted)
    information = {
        'interpolated': int((~np.isin(wanted, stamps)).sum()),
        'tracked_interval_s': float(np.diff(stamps).max()) * 1e-9,
    }
    predicted = run.poses[inside]
    return (
        Trajectory.from_poses(predicted[..., :3], predicted[..., 3:], run.dt),
        Trajectory.from_poses(reference[..., :3], reference[..., 3:], run.dt),
        information,
    )


def interpolate(stamps: Stamps, poses: Array, wanted: Stamps) -> Array:
    """Poses at other times: linear in position, along the shorter arc in rotation.

    Args:
        stamps: Times [ns], rising, shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, n, 7).
        wanted: Times [ns] from the first to the last of `stamps`, shape (m,).

    Returns:
        Poses, shape (m, n, 7); exact where a time is one of `stamps`.
    """
    after = np.searchsorted(stamps, wanted, side='left')
    before = np.maximum(after - 1, 0)
    after = np.where(stamps[after] == wanted, after, np.maximum(after, 1))
    exact = stamps[after] == wanted
    before = np.where(exact, after, before)
    # differences first: nanoseconds since 1970 do not fit into a float64
    span = np.where(exact, 1, stamps[after] - stamps[before])
    weight = ((wanted - stamps[before]) / span)[:, None, None]
    start, end = poses[before], poses[after]
    positions = start[..., :3] + weight * (end[..., :3] - start[..., :3])
    turn = rotation_between(start[..., 3:], end[..., 3:])
    rotations = rotate_quaternions(start[..., 3:], weight * turn)
    return np.concatenate([positions, rotations], axis=-1)


def _span(stamps: Stamps) -> str:
    return f'{stamps[0] * 1e-9:.3f} to {stamps[-1] * 1e-9:.3f} s'
