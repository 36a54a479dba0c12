"""Which tracked frames are accepted, and the start state that a window of them gives."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from rigid_gns_core.state import Array, State

from .messages import PoseArrayFrame
from .velocity import estimate_velocities

# a stamp further ahead of the frames before it, by the clock of arrival, is an error [ns]
MAX_AHEAD_NS = 1_000_000_000
# so many frames in a row refused for their stamps, while these rise, are a tracker begun anew
RESTART_FRAMES = 5
# positions further out than this many radii are no measurement
MAX_DISTANCE = 1e6


class RejectedFrame(ValueError):
    """A tracked frame cannot be used. `kind` names the check that failed."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


class TrackingWindow:
    """The newest frames of a tracker, each checked on arrival.

    Args:
        frame_id: Coordinate frame that messages must be in.
        length: Number of frames from which velocities are estimated; 1 means at rest.
        max_spheres: Largest number of spheres accepted.
        gravity: Acceleration of free flight [m/s^2].
        max_gap: Longest time between two frames of a window [s]; after a longer one it starts anew.
        radius: Of the largest sphere [m]; positions beyond a million radii are refused.
        check: Called with the number of spheres of a first frame; ValueError where the model cannot
            serve that many.
        on_gap: Called with the time between two frames [s] where it is longer than `max_gap` and
            the window was not yet full, so that a tracker as slow as that never fills it.
    """

    def __init__(
        self,
        *,
        frame_id: str,
        length: int,
        max_spheres: int,
        gravity: tuple[float, float, float],
        max_gap: float,
        radius: float,
        check: Callable[[int], None],
        on_gap: Callable[[float], None],
    ) -> None:
        self.frame_id, self.length, self.max_spheres = frame_id, length, max_spheres
        self.gravity, self.max_gap_ns, self._check = gravity, round(max_gap * 1e9), check
        self._far, self._on_gap = MAX_DISTANCE * radius, on_gap
        self._frames: deque[PoseArrayFrame] = deque(maxlen=length)
        self._refused: list[PoseArrayFrame] = []  # for their stamps, which rise
        self._leads: deque[int] = deque(maxlen=20)  # stamp minus arrival of the newest frames
        self.arrival_ns = 0  # of the newest frame, on the clock of this node
        self.count: int | None = None

    @property
    def full(self) -> bool:
        """Whether there are enough frames to start from."""
        return len(self._frames) == self.length

    @property
    def stamp_ns(self) -> int | None:
        """Stamp of the newest frame [ns]; None before the first."""
        return self._frames[-1].stamp_ns if self._frames else None

    @property
    def lead_ns(self) -> int:
        """Stamp minus arrival of the frame that was fastest, of the newest 20 [ns]."""
        return max(self._leads, default=0)

    def clear(self) -> None:
        """Forget all frames and the number of spheres."""
        self._frames.clear()
        self._refused.clear()
        self._leads.clear()
        self.count = None

    def add(self, frame: PoseArrayFrame, now_ns: int) -> bool:
        """Take the next frame, which arrived at `now_ns` of this node's clock.

        Returns:
            Whether all before were forgotten, as the tracker has begun anew.

        Raises:
            RejectedFrame: It cannot be used; what was there before is kept.
        """
        if frame.frame_id != self.frame_id:
            raise RejectedFrame(
                'frame',
                f'its frame is {frame.frame_id!r}, expected {self.frame_id!r} (parameter frame_id)',
            )
        self._check_count(len(frame.poses))
        self._check_poses(frame.poses)
        restarted = False
        try:
            self._check_stamp(frame.stamp_ns, now_ns)
        except RejectedFrame:
            if self._refused and frame.stamp_ns <= self._refused[-1].stamp_ns:
                self._refused.clear()
            self._refused.append(frame)
            if len(self._refused) < RESTART_FRAMES:
                raise
            frames, restarted = list(self._refused), True
            self.clear()
            for earlier in frames[:-1]:
                self._take(earlier, now_ns)
        self._take(frame, now_ns)
        return restarted

    def _take(self, frame: PoseArrayFrame, now_ns: int) -> None:
        gap = frame.stamp_ns - (self.stamp_ns or 0) if self._frames else 0
        if gap > self.max_gap_ns:
            if not self.full:
                self._on_gap(gap * 1e-9)
            self._frames.clear()
        self._refused.clear()
        self._leads.append(frame.stamp_ns - now_ns)
        self.arrival_ns = now_ns
        self.count = len(frame.poses)
        self._frames.append(frame)

    def start(self) -> tuple[int, State]:
        """Stamp [ns] and state of the newest frame, with velocities from the whole window."""
        stamps = [frame.stamp_ns for frame in self._frames]
        poses = np.stack([frame.poses for frame in self._frames])
        positions = poses[:, :, :3]
        quaternions = poses[:, :, 3:] / np.linalg.norm(poses[:, :, 3:], axis=-1, keepdims=True)
        times = [(stamp - stamps[-1]) * 1e-9 for stamp in stamps]  # exact: differences are small
        velocities, spins = estimate_velocities(times, positions, quaternions, self.gravity)
        return stamps[-1], State(
            positions=positions[-1],
            quaternions=quaternions[-1],
            velocities=velocities,
            angular_velocities=spins,
        )

    def _check_count(self, count: int) -> None:
        if count == 0:
            raise RejectedFrame('empty', 'it holds no poses, expected one per sphere')
        if count > self.max_spheres:
            raise RejectedFrame(
                'max_spheres',
                f'it holds {count} spheres, expected at most {self.max_spheres} '
                '(parameter max_spheres)',
            )
        if self.count is None:
            try:
                self._check(count)
            except ValueError as error:
                raise RejectedFrame('model', str(error)) from error
        elif count != self.count:
            raise RejectedFrame(
                'count',
                f'it holds {count} spheres, expected {self.count} as before; call ~/reset '
                'to start again with another number',
            )

    def _check_stamp(self, stamp: int, now: int) -> None:
        last = self.stamp_ns
        if last is not None and stamp <= last:
            raise RejectedFrame(
                'stamp',
                f'its stamp {seconds(stamp)} s does not come after {seconds(last)} s of the frame '
                'before; expected increasing stamps, or a call of ~/reset when the tracker was '
                f'started again ({RESTART_FRAMES} such frames with rising stamps do the same)',
            )
        if self.full and stamp - now > self.lead_ns + MAX_AHEAD_NS:
            ahead = (stamp - now - self.lead_ns) * 1e-9
            raise RejectedFrame(
                'ahead',
                f'its stamp {seconds(stamp)} s is {ahead:.3f} s ahead of its time by the frames '
                f'before, expected at most {MAX_AHEAD_NS * 1e-9:g} s',
            )

    def _check_poses(self, poses: Array) -> None:
        finite = np.isfinite(poses).all(axis=1)
        if not finite.all():
            sphere = int(np.argmin(finite))
            values = ', '.join(f'{value:g}' for value in poses[sphere])
            raise RejectedFrame(
                'finite', f'the pose of sphere {sphere} is ({values}), expected finite numbers'
            )
        far = np.abs(poses[:, :3]).max(axis=1)
        if (far > self._far).any():
            raise RejectedFrame(
                'far',
                f'sphere {int(np.argmax(far))} is {far.max():.3g} m out, expected at most '
                f'{self._far:.3g} m (a million radii); are positions in metres?',
            )
        norms = np.linalg.norm(poses[:, 3:], axis=1)
        if (norms < 1e-6).any():
            raise RejectedFrame(
                'quaternion',
                f'the quaternion of sphere {int(np.argmin(norms))} has norm '
                f'{norms.min():.2g}, expected 1; send (0, 0, 0, 1) where a rotation is unknown',
            )


class Throttle:
    """Admits one message of a kind per period, and counts those held back.

    Args:
        period: Least time between two messages of one kind [s].
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self._next: dict[str, float] = {}
        self._held: dict[str, int] = {}

    def admit(self, kind: str, now: float) -> int | None:
        """Number of messages of that kind held back since the last one, or None to hold back this.

        Args:
            kind: What is counted.
            now: Time of any steady clock [s].
        """
        if now < self._next.get(kind, -np.inf):
            self._held[kind] = self._held.get(kind, 0) + 1
            return None
        self._next[kind] = now + self.period
        return self._held.pop(kind, 0)


def seconds(stamp_ns: int) -> str:
    """A stamp in seconds with all its digits, which a float would not keep."""
    sign = '-' if stamp_ns < 0 else ''
    whole, rest = divmod(abs(stamp_ns), 10**9)
    return f'{sign}{whole}.{rest:09d}'
