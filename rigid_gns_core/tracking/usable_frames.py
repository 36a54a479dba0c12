# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which tracked frames are usable, in what order, and where a tracker paused or restarted.

Node, import and evaluation share these rules: in a recording, each frame is judged as the node
judges it on arrival.
"""

from __future__ import annotations

from bisect import insort
from collections import Counter, deque
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .jit import plain
from .lost_spheres import check_seen, measured, why_lost
from .newest_frame import is_usual
from .rejected_frame import RejectedFrame as RejectedFrame
from .repeats import REPEATS, Repeats
from ..errors import shown
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array

# this many consecutive frames with unusable but rising stamps are a tracker that restarted
RESTART_FRAMES = 5
# this many late frames in a row, whose stamps rise, are those of a clock that was set back
LATE_FRAMES = 4
# a stamp may run ahead of earlier ones, relative to the arrival time, by at most this [ns]
MAX_AHEAD_NS = 1_000_000_000
# a position further out than this many radii is not in metres
MAX_DISTANCE = 1e6
# a clock that is set by less is not told from frames that arrive late [ns]
MIN_STEP_NS = 50_000_000
# largest norm of a quaternion
_LARGE = 1e6
# consecutive frames that may be missing, and the interval that is a gap [median intervals]
MISSING = 2
GAP = MISSING + 1.5
# frames this far apart, as those of a tracker at 1 Hz, are still fitted together [s]
WINDOW_GAP = 1.25
# frames among which a late one is inserted in a recording: the node's default window
MEMORY = 6

# stands in for poses that are not looked at
_UNTURNED = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])

Stamps = NDArray[np.int64]


class FrameOrder:
    """Checks frames on arrival: their content, and whether their stamp can be used.

    Args:
        frame_id: Coordinate frame that they must be in.
        radius: Radius of the largest sphere [m].
    """

    def __init__(self, frame_id: str, radius: float) -> None:
        self.frame_id, self._far = frame_id, MAX_DISTANCE * radius
        self._refused: list[PoseArrayFrame] = []  # consecutive ones with unusable, rising stamps
        self._late: list[PoseArrayFrame] = []  # consecutive ones that were inserted
        self._leads: deque[int] = deque(maxlen=20)  # stamp minus arrival of the newest frames

    @property
    def lead_ns(self) -> int:
        """Largest stamp minus arrival time of the newest 20 frames [ns]."""
        return max(self._leads, default=0)

    def clear(self) -> None:
        """Forget all frames."""
        self._refused.clear()
        self._late.clear()
        self._leads.clear()

    def check(self, frame: PoseArrayFrame) -> bool:
        """Check the content of a frame; whether it is as usual, so that no sphere is lost.

        Raises:
            RejectedFrame: It cannot be used; the message says why.
        """
        if frame.frame_id != self.frame_id:
            raise RejectedFrame(
                'frame',
                f'its frame is {shown(frame.frame_id)}, expected {self.frame_id!r} '
                '(parameter frame_id)',
            )
        return _check_poses(frame.poses, self._far)

    def admit(
        self, frame: PoseArrayFrame, now_ns: int, known: Sequence[int], *, full: bool
    ) -> list[PoseArrayFrame]:
        """Check the stamp of a frame that arrived at `now_ns`.

        Args:
            frame: Frame that passed `check`.
            now_ns: Time of arrival [ns].
            known: Stamps of the frames in memory, rising [ns].
            full: Whether these are enough to detect a stamp that runs ahead.

        Returns:
            The frame; or several, in the order of their stamps, where the tracker has restarted or
            its clock was set back: the frames in memory are then to be dropped.

        Raises:
            RejectedFrame: The stamp cannot be used.
        """
        try:
            self._check_stamp(frame.stamp_ns, now_ns, known, full=full)
        except RejectedFrame:
            if self._refused and frame.stamp_ns <= self._refused[-1].stamp_ns:
                self._refused.clear()
            self._refused.append(frame)
            if len(self._refused) < RESTART_FRAMES:
                raise
            return self._refused.copy()
        if not known or frame.stamp_ns > known[-1]:
            self._late.clear()
            return [frame]
        if self._late and frame.stamp_ns <= self._late[-1].stamp_ns:
            self._late.clear()
        self._late.append(frame)
        return [frame] if len(self._late) < LATE_FRAMES else self._late.copy()

    def accepted(self, stamp_ns: int, now_ns: int, *, late: bool) -> None:
        """Note an accepted frame; `late` ones do not count for the clock of the tracker."""
        self._refused.clear()
        if not late:
            self._leads.append(stamp_ns - now_ns)

    def _check_stamp(self, stamp: int, now: int, known: Sequence[int], *, full: bool) -> None:
        if known and stamp <= known[-1]:
            there = stamp in known
            if not there and stamp > known[0]:
                return  # late, but it can be inserted
            why = 'and is that of a frame taken' if there else 'nor into the window'
            raise RejectedFrame(
                'duplicate' if there else 'late',
                f'its stamp {seconds(stamp)} s does not come after {seconds(known[-1])} s of the '
                f'frame before, {why}; expected increasing stamps, or a call of ~/reset when the '
                f'tracker was started again ({RESTART_FRAMES} such frames with rising stamps do '
                'the same)',
            )
        if full and stamp - now > self.lead_ns + MAX_AHEAD_NS:
            ahead = (stamp - now - self.lead_ns) * 1e-9
            raise RejectedFrame(
                'ahead',
                f'its stamp {seconds(stamp)} s is {ahead:.3f} s ahead of its time by the frames '
                f'before, expected at most {MAX_AHEAD_NS * 1e-9:g} s',
            )


def usable_passes(
    frames: Sequence[PoseArrayFrame],
    times: Stamps,
    *,
    frame_id: str,
    radius: float,
    count: int | None = None,
) -> tuple[list[list[int]], Counter[str]]:
    """Sort the frames of a recording as the node does on arrival.

    Args:
        frames: In the order of recording.
        times: Times of their arrival [ns], shape (frames,).
        frame_id: Coordinate frame that they must be in.
        radius: Radius of the largest sphere [m].
        count: Number of spheres that each must hold; None: at least one.

    Returns:
        Indices of usable frames in the order of their stamps, for each pass: a new one begins
        where the tracker restarted. And the number of other frames, by reason.
    """
    order, repeats = FrameOrder(frame_id, radius), Repeats(radius)
    index = {id(frame): k for k, frame in enumerate(frames)}
    refused: dict[int, str] = {}
    passes: list[list[int]] = []
    known: list[int] = []
    masks: dict[int, NDArray[np.bool_]] = {}  # which spheres each frame shows
    places: Array | None = None  # where each was last [m]
    arrived = 0  # time of arrival of the newest frame [ns]
    for k, (frame, time) in enumerate(zip(frames, times.tolist(), strict=True)):
        try:
            order.check(frame)
            mask = measured(frame.poses)
            if places is not None and len(places) == len(mask):
                there = (frame.poses[:, :3] == 0.0).all(axis=1)
                mask &= ~there | (places == 0.0).all(axis=1)
            if not mask.all():
                near = known and frame.stamp_ns - known[-1] <= WINDOW_GAP * 1e9
                recent = [masks[stamp] for stamp in known[1 - MEMORY :]] if near else []
                recent = [one for one in recent if len(one) == len(mask)]
                before = np.array(recent, dtype=np.bool_).reshape(-1, len(mask))
                check_seen(frame.poses, mask, before, MEMORY)
            if len(frame.poses) != (count or len(frame.poses)) or not len(frame.poses):
                raise RejectedFrame('count' if count else 'empty', 'another number of spheres')
            if known and frame.stamp_ns > known[-1]:
                repeats.check(frame)
            admitted = order.admit(frame, time, known, full=len(known) == MEMORY)
        except RejectedFrame as error:
            refused[k] = error.kind
            continue
        if passes and repeats.belie([frames[own] for own in passes[-1][: REPEATS + 2]], frame):
            refused |= dict.fromkeys(passes[-1][1:], 'content')
            del passes[-1][1:]
            known = known[:1]
        if len(admitted) > 1 or not passes:
            own = {index[id(accepted)] for accepted in admitted}
            passes[-1:] = [[k for k in passes[-1] if k not in own]] if passes else []
            order.clear()
            repeats.clear()
            known, places = [], None
            passes.append([])
        for accepted in admitted:
            late = bool(known) and accepted.stamp_ns < known[-1]
            apart = accepted.stamp_ns - known[-1] if known else 0
            before_ns = np.array(known, dtype=np.int64)
            if apart > WINDOW_GAP * 1e9 or (
                not late and clock_was_set(before_ns, apart, time - arrived)
            ):
                known, places = [], None
            arrived = arrived if late else time
            if not late:
                repeats.took(accepted)
            seen = masks[accepted.stamp_ns] = measured(accepted.poses)
            if places is not None and len(places) == len(seen):
                there = (accepted.poses[:, :3] == 0.0).all(axis=1)
                seen &= ~there | (places == 0.0).all(axis=1)
            if not late:
                before = places if places is not None and len(places) == len(seen) else 0.0
                places = np.where(seen[:, None], accepted.poses[:, :3], before)
            insort(known, accepted.stamp_ns)
            known = known[-MEMORY:]
            insort(passes[-1], index[id(accepted)], key=lambda other: frames[other].stamp_ns)
            refused.pop(index[id(accepted)], None)
            order.accepted(accepted.stamp_ns, time, late=late)
    return passes, Counter(refused.values())


def clock_was_set(stamps: Stamps, apart_ns: int, arrived_ns: int) -> bool:
    """Whether stamps went ahead without the time that they tell, as of a clock that was set.

    Frames of both sides are not fitted together then, as where frames are missing for long.

    Args:
        stamps: Of the frames before, rising [ns], shape (k,).
        apart_ns: Time to the next frame by its stamp [ns].
        arrived_ns: The same by its arrival [ns].
    """
    if apart_ns <= MIN_STEP_NS or arrived_ns >= apart_ns / 2:  # as nearly always
        return False
    return 0 < GAP * median_interval(stamps) < apart_ns


def median_interval(stamps: Stamps) -> float:
    """Median of the positive steps between stamps [ns]; 0 where there is none."""
    steps = np.diff(stamps)
    return float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0


def covered(wanted: Stamps, stamps: Stamps) -> NDArray[np.bool_]:
    """Whether each time lies on a frame or between two without a gap, shape (m,).

    Args:
        wanted: Times [ns], shape (m,).
        stamps: Times of the frames [ns], rising, shape (k,).
    """
    inside = (wanted >= stamps[0]) & (wanted <= stamps[-1])
    after = np.minimum(np.searchsorted(stamps, wanted, side='left'), len(stamps) - 1)
    exact = stamps[after] == wanted
    span = stamps[after] - stamps[np.maximum(after - 1, 0)]
    found: NDArray[np.bool_] = exact | inside & (span <= GAP * median_interval(stamps))
    return found


def short_gaps(stamps: Stamps, seen: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Indices of the frames in which a sphere is missing within a gap short enough to fill.

    Args:
        stamps: Times of the frames [ns], rising, shape (k,).
        seen: Whether the sphere was seen in each, shape (k,).
    """
    longest = GAP * median_interval(stamps)
    gaps = [
        np.arange(before + 1, after)
        for before, after in pairwise(np.flatnonzero(seen))
        if after - before > 1 and stamps[after] - stamps[before] <= longest
    ]
    return np.concatenate([np.zeros(0, dtype=np.int64), *gaps])


def _check_poses(poses: Array, far: float) -> bool:
    """Check that poses are measurements: some there, within `far` [m], with usable quaternions.

    Returns:
        Whether they are as usual: all there, and no coordinate of a place is zero.

    Raises:
        RejectedFrame: A pose cannot be used; the message says which, and why.
    """
    if is_usual(plain(poses), min(far, _LARGE / 2)):
        return True  # four numbers of up to a half have a norm of up to one
    seen = measured(poses)
    if len(poses) and not seen.any():
        raise RejectedFrame('not finite', why_lost(poses, seen))
    poses = np.where(seen[:, None], poses, _UNTURNED)
    out = np.abs(poses[:, :3]).max(axis=1, initial=0.0)
    if (out > far).any():
        raise RejectedFrame(
            'far',
            f'sphere {int(np.argmax(out))} is {out.max():.3g} m out, expected at most '
            f'{far:.3g} m (a million radii); are positions in metres?',
        )
    norms = np.hypot.reduce(poses[:, 3:], axis=1)  # squares could overflow
    off = norms > _LARGE
    if off.any():
        sphere = int(np.argmax(off))
        raise RejectedFrame(
            'quaternion',
            f'the quaternion of sphere {sphere} has norm {norms[sphere]:.2g}, expected 1; send '
            'NaN or zeros where a rotation is unknown',
        )
    return False


def seconds(stamp_ns: int) -> str:
    """Stamp in seconds with all nine decimals, which a float would not keep."""
    sign = '-' if stamp_ns < 0 else ''
    whole, rest = divmod(abs(stamp_ns), 10**9)
    return f'{sign}{whole}.{rest:09d}'
