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
from .tracking import RESTART_FRAMES

Stamps = NDArray[np.int64]

# a stamp further off the grid than this part of a period belongs to another start
RESTART_TOLERANCE = 0.01
# more frames missing in a row than this end a run
MAX_BRIDGED = 2
# tracked frames further apart than this many of their median intervals are a gap
MAX_GAP = 3.0


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
        part: Which of the predictions these are.
    """

    stamps: Stamps
    poses: Array
    frame_id: str
    dt: float
    bridged: int
    part: slice


@dataclass(frozen=True)
class Decoded:
    """Messages of a topic of poses that are whole.

    Args:
        frames: Their content.
        times: Log times [ns], shape (frames,).
        places: Places in the recording, shape (frames,).
        damaged: Number of messages that are not whole.
    """

    frames: list[PoseArrayFrame]
    times: Stamps
    places: Stamps
    damaged: int


def decode_topic(topic: Topic) -> Decoded:
    """Frames of a topic."""
    frames, kept = [], []
    for index, message in enumerate(topic.messages):
        try:
            frames.append(decode_pose_array(message))
        except MessageError:
            continue
        kept.append(index)
    return Decoded(frames, topic.times[kept], topic.places[kept], len(topic) - len(frames))


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
    changed = np.array(
        [
            (before.frame_id, before.poses.shape) != (after.frame_id, after.poses.shape)
            for before, after in pairwise(frames)
        ]
    )
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


def usable_frames(
    tracked: Decoded, frame_id: str, count: int, places: Stamps
) -> tuple[list[PoseArrayFrame], dict[str, int]]:
    """Tracked frames that can be a reference, and the number of others by reason.

    Where the tracker began anew (its stamps went back, for good), the frames before or after it
    are left out: those that were recorded with fewer of the predictions.

    Args:
        tracked: All tracked frames.
        frame_id: Coordinate frame of the predictions.
        count: Number of spheres of the predictions.
        places: Places of the predictions in the recording.
    """
    passes: list[list[tuple[int, PoseArrayFrame]]] = [[]]
    back: list[tuple[int, PoseArrayFrame]] = []
    dropped: Counter[str] = Counter()
    for place, frame in zip(tracked.places, tracked.frames, strict=True):
        item = (int(place), frame)
        if frame.frame_id != frame_id:
            dropped['frame'] += 1
        elif len(frame.poses) != count:
            dropped['count'] += 1
        elif not np.isfinite(frame.poses).all():
            dropped['not finite'] += 1
        elif (np.linalg.norm(frame.poses[:, 3:], axis=1) < 1e-6).any():
            dropped['quaternion'] += 1
        elif passes[-1] and frame.stamp_ns <= passes[-1][-1][1].stamp_ns:
            if back and frame.stamp_ns <= back[-1][1].stamp_ns:
                back = []
            back.append(item)
            dropped['stamp'] += 1
            if len(back) == RESTART_FRAMES:  # as the simulator takes it
                passes.append(back)
                dropped['stamp'] -= len(back)
                back = []
        else:
            passes[-1].append(item)
            back = []
    starts = np.array([*(part[0][0] for part in passes[1:])], dtype=np.int64)
    shares = np.bincount(np.searchsorted(starts, places, side='right'), minlength=len(passes))
    chosen = passes[int(np.argmax(shares))]
    dropped['pass'] = sum(map(len, passes)) - len(chosen)
    return [frame for _, frame in chosen], {key: n for key, n in dropped.items() if n}


def align(
    run: Run, tracked: list[PoseArrayFrame]
) -> tuple[Trajectory, Trajectory, dict[str, float]]:
    """Predicted and tracked poses at the same times, as trajectories.

    Velocities are backward differences of the poses, in both.

    Args:
        run: Predictions.
        tracked: Usable frames, see `usable_frames`.

    Returns:
        Predicted, tracked, and how they were aligned: `interpolated` frames (no tracked frame has
        their stamp), `tracked_interval_s`, the longest time between two tracked frames used, and
        `untracked` predictions that are left out, as they lie in a gap of the tracked frames, or
        on the shorter side of one.

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
    """The longest part of `wanted` without one that lies in a gap between `stamps`."""
    gap = MAX_GAP * float(np.median(np.diff(stamps)))
    after = np.searchsorted(stamps, wanted, side='left')
    exact = stamps[after] == wanted
    covered = exact | (stamps[after] - stamps[np.maximum(after - 1, 0)] <= gap)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], covered, [0]])))
    if not len(edges):
        return slice(0, 0)
    starts, stops = edges[::2], edges[1::2]
    longest = int(np.argmax(stops - starts))
    return slice(int(starts[longest]), int(stops[longest]))


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
