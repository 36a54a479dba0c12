# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which tracked frames are accepted, and the start state that a window of them gives."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable

import numpy as np

from .environment import Environment
from .tracks import TrackerSettings, Tracks
from .usable_frames import FrameOrder, RejectedFrame
from .warm import warm_up
from ..errors import UserError
from ..messages.poses import PoseArrayFrame
from ..scenes.scene import Scene
from ..scenes.state import State

# defaults: spheres are coasted for so many times sqrt(r / g), and found up to so many times
# sqrt(g r) of speed
_COAST, _MAX_SPEED = 2.0, 50.0
# frames of the same poses are refused so many times in a row, where spheres move by so many radii
_REPEATS, _STILL = 3, 0.01

_NOTHING = Tracks.empty()


class TrackingWindow:
    """The newest frames of a tracker, each checked on arrival, and the spheres that they show.

    What comes out is a function of the frames accepted since `clear`, in the order of their stamps
    (where poses are not matched, of those in the window alone): neither the time nor the order of
    arrival matters, as long as a late frame still finds its place among those in memory.

    Args:
        frame_id: Coordinate frame that messages must be in.
        length: Number of frames from which velocities are estimated; 1 means at rest.
        max_spheres: Largest number of spheres accepted.
        gravity: Acceleration of free flight [m/s^2].
        max_gap: Longest time between two frames of a window [s]; after a longer one it starts
            anew.
        radius: Of the largest sphere [m]; positions beyond a million radii are refused.
        check: Called with the number of spheres of a first frame; UserError where there cannot be
            so many.
        on_gap: Called with a time between two frames [s] that is longer than `max_gap`, where the
            window was not yet full, as so slow a tracker never fills it.
        scene: Surfaces that spheres bounce off; None: only frames that do not fit tell bounces.
        matched: Whether poses are matched to spheres, which may then come in any order, be
            missing, appear and vanish; else there is always the same number in the same order.
        noise: Standard deviation of each coordinate of a position [m]; None: estimated.
        coast_time: A sphere that is not seen is coasted for so long [s], and for two frames at
            least; None: 2 sqrt(radius / gravity).
        max_speed: New spheres that are faster are not found [m/s]; None: 50 sqrt(radius gravity).
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
        scene: Scene | None = None,
        matched: bool = False,
        noise: float | None = None,
        coast_time: float | None = None,
        max_speed: float | None = None,
    ) -> None:
        warm_up()
        size = float(np.linalg.norm(gravity)) or 1.0
        natural = float(np.sqrt(radius / size))  # time to fall half a radius [s]
        for name, value in (
            ('noise', noise),
            ('coast_time', coast_time),
            ('max_speed', max_speed),
        ):
            if value is not None and not (value >= 0 and np.isfinite(value)):
                raise UserError(f'{name} is {value}, expected 0 or more')
        self.length, self.max_spheres = length, max_spheres
        self.max_gap_ns, self._check = round(max_gap * 1e9), check
        self._order, self._on_gap = FrameOrder(frame_id, radius), on_gap
        environment = (
            Environment.unknown(gravity, radius) if scene is None else Environment.of(scene)
        )
        self.settings = TrackerSettings(
            environment=environment,
            length=length,
            matched=matched,
            noise=noise,
            coast_time=_COAST * natural if coast_time is None else coast_time,
            max_speed=_MAX_SPEED * natural * size if max_speed is None else max_speed,
            radius=radius,
        )
        # newest frames, each with the spheres before it, to go on from when one comes late
        self._frames: deque[tuple[PoseArrayFrame, Tracks]] = deque(maxlen=self.settings.memory)
        self._now = _NOTHING
        self._state: State | None = None  # of the newest frame, where it was asked for
        self._repeats = 0  # frames of the same content, in a row
        self.arrival_ns = 0  # of the newest frame, by this node's clock
        self.generation = 0  # changes with the set of spheres
        self.counts: Counter[str] = Counter()  # of frames and spheres, by what became of them

    @property
    def frame_id(self) -> str:
        """Coordinate frame that messages must be in."""
        return self._order.frame_id

    @property
    def full(self) -> bool:
        """Whether there are enough frames to start from, and spheres in them."""
        return len(self._now.stamps) >= self.length and len(self._now.ids) > 0

    @property
    def count(self) -> int | None:
        """Number of spheres; None before the first."""
        return len(self._now.ids) or None

    @property
    def ids(self) -> tuple[int, ...]:
        """Of the spheres, in the order of `start`; a sphere keeps its own while tracked."""
        return tuple(self._now.ids.tolist())

    @property
    def noise(self) -> float:
        """Standard deviation of each coordinate of a position, given or estimated [m]."""
        return self._now.noise(self.settings)

    @property
    def stamp_ns(self) -> int | None:
        """Stamp of the newest frame [ns]; None before the first."""
        return self._frames[-1][0].stamp_ns if self._frames else None

    @property
    def window_ns(self) -> tuple[int, ...]:
        """Stamps of the frames that velocities come from, the newest last [ns]."""
        return tuple(frame.stamp_ns for frame, _ in self._frames)[-self.length :]

    @property
    def lead_ns(self) -> int:
        """Stamp minus arrival of the frame that was fastest, of the newest 20 [ns]."""
        return self._order.lead_ns

    def clear(self) -> None:
        """Forget all frames and spheres."""
        self._frames.clear()
        self._order.clear()
        self._repeats = 0
        self._become(_NOTHING)

    def add(self, frame: PoseArrayFrame, now_ns: int) -> bool:
        """Take the next frame, which arrived at `now_ns` of this node's clock.

        Returns:
            Whether all before were forgotten, as the tracker has begun anew.

        Raises:
            RejectedFrame: It cannot be used; what was there before is kept.
        """
        try:
            restarted = self._add(frame, now_ns)
        except RejectedFrame as error:
            self.counts[error.kind] += 1
            raise
        self.counts['accepted'] += 1
        return restarted

    def _add(self, frame: PoseArrayFrame, now_ns: int) -> bool:
        self._order.check(frame)
        self._check_count(len(frame.poses))
        known = [one.stamp_ns for one, _ in self._frames]
        admitted = self._order.admit(frame, now_ns, known, full=self.full)
        restarted = len(admitted) > 1
        if restarted:
            self.clear()
        else:
            self._check_content(frame)
        for one in admitted:
            self._take(one, now_ns)
        return restarted

    def _take(self, frame: PoseArrayFrame, now_ns: int) -> None:
        later: list[PoseArrayFrame] = []
        now, newborn = self._now, self._now.next_id
        frames = self._frames.copy()  # what fails below leaves all as it was
        while frames and frames[-1][0].stamp_ns > frame.stamp_ns:
            after, now = frames.pop()
            later.insert(0, after)
        anew = now.next_id < newborn
        for one in (frame, *later):
            if len(now.stamps) and one.stamp_ns - now.stamps[-1] > self.max_gap_ns:
                if not self.full:
                    self._on_gap((one.stamp_ns - int(now.stamps[-1])) * 1e-9)
                frames.clear()
                matched = self.settings.matched
                now = Tracks.empty(now.next_id, now.noise_estimate) if matched else _NOTHING
            frames.append((one, now))
            now = now.after(one, self.settings)
        self._frames = frames
        self._order.taken(frame.stamp_ns, now_ns, late=bool(later))
        if later:
            self.counts['reordered'] += 1
        else:
            self.arrival_ns = now_ns
            self.counts['missed'] += now.missed
        # a late frame may have given other spheres the same ids
        self._become(now, changed=anew)

    def _become(self, now: Tracks, *, changed: bool = False) -> None:
        before, self._now, self._state = self._now.ids, now, None
        if changed or not np.array_equal(before, now.ids):
            self.generation += 1
            self.counts['appeared'] += len(np.setdiff1d(now.ids, before))
            self.counts['vanished'] += len(np.setdiff1d(before, now.ids))

    def start(self) -> tuple[int, State]:
        """Stamp [ns] and state of the newest frame, with velocities from the whole window."""
        if self._state is None:
            motion = self._now.window_motion(self.settings)
            self._state = State(
                positions=motion.positions,
                quaternions=motion.quaternions,
                velocities=motion.velocities,
                angular_velocities=motion.angular_velocities,
            )
        return int(self._now.stamps[-1]), self._state

    def _check_count(self, count: int) -> None:
        known, matched = self.count, self.settings.matched
        if count == 0 and not (matched and known):
            raise RejectedFrame('empty', 'it holds no poses, expected one per sphere')
        if count > self.max_spheres:
            raise RejectedFrame(
                'max_spheres',
                f'it holds {count} spheres, expected at most {self.max_spheres} '
                '(parameter max_spheres)',
            )
        if known is None:
            try:
                self._check(count)
            except UserError as error:
                raise RejectedFrame('model', str(error)) from error
        elif count != known and not matched:
            raise RejectedFrame(
                'count',
                f'it holds {count} spheres, expected {known} as before; call ~/reset '
                'to start again with another number',
            )

    def _check_content(self, frame: PoseArrayFrame) -> None:
        """Refuse the poses of the newest frame under a new stamp, where spheres move."""
        if not self.settings.matched or not self._frames or not len(frame.poses):
            return
        newest = self._frames[-1][0]
        same = np.array_equal(newest.poses, frame.poses) and frame.stamp_ns > newest.stamp_ns
        time = (frame.stamp_ns - newest.stamp_ns) * 1e-9
        velocities = self._now.motion.velocities
        travel = time * float(np.linalg.norm(velocities, axis=1).max(initial=0.0))
        # what stopped at once is believed after a few
        if not same or self._repeats >= _REPEATS or travel <= _STILL * self.settings.radius:
            self._repeats = 0
            return
        self._repeats += 1
        raise RejectedFrame(
            'content',
            f'its poses are those of the frame {time:.3g} s before, in which spheres moved; '
            'expected each measurement once',
        )
