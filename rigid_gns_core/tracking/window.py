# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The window of tracked frames: which are accepted, and the start state that they give."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from .environment import Environment
from .lost_spheres import check_seen, why_lost
from .rejected_frame import RejectedFrame
from .repeats import Repeats
from .scene_laws import by_window, SceneLaws
from .seen_poses import seen_in
from .state_estimate import StateEstimate
from .tracker_settings import TrackerSettings
from .tracks import Tracks
from .usable_frames import clock_was_set, FrameOrder
from .warm import warm_up, warm_up_laws
from ..errors import UserError
from ..messages.poses import PoseArrayFrame
from ..scenes.plane import Plane
from ..scenes.scene import Scene
from ..scenes.state import Array, State

_NO_TRACKS = Tracks.empty()


class TrackingWindow:
    """The newest frames of a tracker, each checked on arrival, and the tracks that they give.

    The tracks depend only on the frames accepted since `clear`, in the order of their stamps
    (where poses are not matched, on those in the window alone). Neither the time nor the order of
    arrival matters, as long as a late frame can be inserted among those in memory.

    Args:
        frame_id: Coordinate frame that messages must be in.
        length: Number of frames from which velocities are estimated; 1: spheres start at rest. In
            a scene with air or a learned tracker, all frames of its memory count.
        max_spheres: Largest number of spheres accepted.
        gravity: Acceleration of free flight [m/s^2].
        max_gap: Longest time between two frames of a window [s]; a longer one empties it.
        radius: Radius of the largest sphere [m]; positions beyond a million radii are refused.
        check: Called with the number of spheres of a first frame; raises UserError where that
            number is not possible.
        on_gap: Called with the time between two frames [s] where it exceeds `max_gap` before the
            window is full: so slow a tracker never fills it.
        scene: Surfaces that spheres bounce off; None: bounces show only as outliers.
        matched: Whether poses are associated with tracks, so that they may come in any order, be
            missing, appear and vanish; if not, their number and order are fixed.
        noise: Standard deviation of each coordinate of a position [m]; None: estimated.
        coast_time: How long a track is coasted without a pose [s], at least two frames; None:
            2 sqrt(radius / gravity).
        max_speed: Largest speed of a new track [m/s]; None: 50 sqrt(radius gravity).
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
        self._noise_given = noise
        self._laws = None if scene is None else SceneLaws.of(scene)
        if self._laws is not None:
            warm_up_laws()
            noise = self._laws.noise if noise is None else noise
        self.length, self.max_spheres = length, max_spheres
        self.max_gap_ns, self._check = round(max_gap * 1e9), check
        self._order, self._on_gap = FrameOrder(frame_id, radius), on_gap
        environment = (
            Environment.unknown(gravity, radius) if scene is None else Environment.of(scene)
        )
        self.settings = TrackerSettings.of(
            environment,
            radius,
            length=length,
            matched=matched,
            noise=noise,
            coast_time=coast_time,
            max_speed=max_speed,
            memory=0.0 if self._laws is None else self._laws.memory,
            most=0.0 if self._laws is None else self._laws.most,
        )
        # newest frames, each with the tracks before it, to insert a late frame
        self._frames: deque[tuple[PoseArrayFrame, Tracks]] = deque(maxlen=self.settings.fewest)
        self._tracks = _NO_TRACKS
        # at the newest frame, computed on demand
        self._state: State | None = None
        self._estimate: StateEstimate | None = None
        self._carried: tuple[Plane, ...] = ()  # surfaces that it knows
        self._repeats = Repeats(radius)
        self.lost = ''  # what is wrong with the first lost pose of the newest frame
        self.arrival_ns = 0  # of the newest frame, by the node's clock
        self.generation = 0  # changes with the set of tracks
        self.counts: Counter[str] = Counter()  # of frames and tracks, by outcome

    @property
    def frame_id(self) -> str:
        """Coordinate frame that messages must be in."""
        return self._order.frame_id

    @property
    def full(self) -> bool:
        """Whether there are enough frames, with spheres in them, to start from."""
        return len(self._tracks.stamps) >= self.length and len(self._tracks.ids) > 0

    @property
    def count(self) -> int | None:
        """Number of spheres; None before the first."""
        return len(self._tracks.ids) or None

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the tracks, in the order of `start`; a track keeps its id."""
        return tuple(self._tracks.ids.tolist())

    @property
    def noise(self) -> float:
        """Standard deviation of each coordinate of a position, given or estimated [m]."""
        return self._tracks.noise(self.settings)

    @property
    def knows_noise(self) -> bool:
        """Whether that is given or estimated; if not, it is a guess."""
        return self._tracks.knows_noise(self.settings)

    @property
    def stamp_ns(self) -> int | None:
        """Stamp of the newest frame [ns]; None before the first."""
        return self._frames[-1][0].stamp_ns if self._frames else None

    @property
    def window_ns(self) -> tuple[int, ...]:
        """Stamps of the frames from which a start is estimated, the newest last [ns]."""
        stamps = self._tracks.stamps
        used = self.settings.used(stamps, len(self._tracks.ids))
        return tuple(stamps[len(stamps) - used :].tolist())

    @property
    def lead_ns(self) -> int:
        """Largest stamp minus arrival time of the newest 20 frames [ns]."""
        return self._order.lead_ns

    @property
    def interval(self) -> float:
        """Shortest time between two of the newest three frames [s]; 0: there is one at most."""
        stamps = self._tracks.stamps[-3:].tolist()
        apart = [after - before for before, after in pairwise(stamps)]
        return min(apart, default=0) * 1e-9

    def clear(self) -> None:
        """Drop all frames and tracks."""
        self._frames.clear()
        self._order.clear()
        self._repeats.clear()
        self._set_tracks(_NO_TRACKS)

    def take_scene(self, scene: Scene) -> None:
        """Go on in another scene of the same spheres, without frames and tracks."""
        self._laws = laws = SceneLaws.of(scene)
        learned = None if laws is None else laws.noise
        self.settings = replace(
            self.settings,
            environment=Environment.of(scene),
            noise=learned if self._noise_given is None else self._noise_given,
            memory=0.0 if laws is None else laws.memory,
        )
        self.clear()

    def newest(self) -> tuple[int, Array]:
        """Stamp [ns] of the newest frame, and measured centres, NaN where not seen, (n, 3)."""
        tracks = self._tracks
        return int(tracks.stamps[-1]), np.where(
            tracks.seen[-1, :, None], tracks.poses[-1, :, :3], np.nan
        )

    def add(self, frame: PoseArrayFrame, now_ns: int) -> bool:
        """Add the next frame, which arrived at `now_ns` of the node's clock.

        Returns:
            Whether all earlier frames were dropped, as the tracker has restarted.

        Raises:
            RejectedFrame: The frame cannot be used; the window is unchanged.
        """
        try:
            restarted = self._add(frame, now_ns)
        except RejectedFrame as error:
            self.counts[error.kind] += 1
            raise
        self.counts['accepted'] += 1
        return restarted

    def _add(self, frame: PoseArrayFrame, now_ns: int) -> bool:
        usual, self.lost, missing = self._order.check(frame), '', 0
        if not usual:
            frame, missing = self._without_lost(frame)
        self._check_count(len(frame.poses))
        known = [known_frame.stamp_ns for known_frame, _ in self._frames]
        admitted = self._order.admit(frame, now_ns, known, full=self.full)
        restarted = len(admitted) > 1
        if restarted:
            self.clear()
        else:
            self._check_content(frame, now_ns)
        if missing:
            self.counts['lost spheres'] += missing
        for admitted_frame in admitted:
            self._take(admitted_frame, now_ns)
        return restarted

    def _without_lost(self, frame: PoseArrayFrame) -> tuple[PoseArrayFrame, int]:
        """The frame with what it shows, and the number of lost spheres; `lost` says what is."""
        newest = self._frames[-1][0].poses if self._frames else None
        seen = seen_in(frame.poses, newest, self._tracks, self.settings)
        self.lost = why_lost(frame.poses, seen)
        if self.lost and not seen.any():
            raise RejectedFrame('not finite', self.lost)
        if self.settings.matched:
            frame = replace(frame, poses=frame.poses[seen])
        elif self.lost:
            tracks = self._tracks
            before = np.zeros((0, len(seen)), dtype=np.bool_)
            known = len(tracks.ids) == len(seen)
            if known and frame.stamp_ns - tracks.stamps[-1] <= self.max_gap_ns:
                before = tracks.seen[max(len(tracks.seen) - self.length + 1, 0) :]
            check_seen(frame.poses, seen, before, self.length)
            frame = replace(frame, poses=np.where(seen[:, None], frame.poses, np.nan))
        return frame, int((~seen).sum())

    def _take(self, frame: PoseArrayFrame, now_ns: int) -> None:
        later: list[PoseArrayFrame] = []
        tracks, next_id = self._tracks, self._tracks.next_id
        frames = self._frames.copy()  # an error below leaves the window unchanged
        while frames and frames[-1][0].stamp_ns > frame.stamp_ns:
            last, tracks = frames.pop()
            later.insert(0, last)
        ids_reused = tracks.next_id < next_id
        for queued in (frame, *later):
            apart = queued.stamp_ns - int(tracks.stamps[-1]) if len(tracks.stamps) else 0
            if apart > self.max_gap_ns or (
                not later and clock_was_set(tracks.stamps, apart, now_ns - self.arrival_ns)
            ):
                if not self.full and apart > self.max_gap_ns:
                    self._on_gap(apart * 1e-9)
                frames.clear()
                matched = self.settings.matched
                tracks = (
                    Tracks.empty(tracks.next_id, tracks.noise_estimate) if matched else _NO_TRACKS
                )
            frames.append((queued, tracks))
            tracks = tracks.updated(queued, self.settings)
        self._frames = frames
        self._order.accepted(frame.stamp_ns, now_ns, late=bool(later))
        if later:
            self.counts['reordered'] += 1
        else:
            self._repeats.took(frame)
            self.arrival_ns = now_ns
            self.counts['missed'] += tracks.missed
        # after a late frame the same ids may be of other spheres
        self._set_tracks(tracks, changed=ids_reused)

    def _set_tracks(self, tracks: Tracks, *, changed: bool = False) -> None:
        before, self._tracks = self._tracks.ids, tracks
        self._state = self._estimate = None
        if changed or (before is not tracks.ids and not np.array_equal(before, tracks.ids)):
            self.generation += 1
            self.counts['appeared'] += len(np.setdiff1d(tracks.ids, before))
            self.counts['vanished'] += len(np.setdiff1d(before, tracks.ids))

    @property
    def _laws_hold(self) -> bool:
        few = len(self._tracks.ids) <= self.settings.most
        return self._laws is not None and self.length > 1 and few

    def start(self, carried: tuple[Plane, ...] = ()) -> tuple[int, State]:
        """Stamp [ns] of the newest frame, and the state at it, from the whole window.

        `carried` are surfaces that bodies carry, as they are then.
        """
        if self._laws_hold:
            stamp, estimate = self.estimate(carried)
            return stamp, estimate.state
        if self._state is None:
            self._state = self._tracks.window_motion(self.settings).state
        return int(self._tracks.stamps[-1]), self._state

    def estimate(self, carried: tuple[Plane, ...] = ()) -> tuple[int, StateEstimate]:
        """As `start`, with the covariance of the state."""
        if self._estimate is None or carried != self._carried:
            self._carried = carried
            if self._laws is not None and self._laws_hold:
                self._estimate = self._laws.estimate(self._tracks, self.settings, carried)
            else:
                _, covariance = by_window(self._tracks, self.settings)
                self._estimate = StateEstimate(self.start()[1], covariance)
        return int(self._tracks.stamps[-1]), self._estimate

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

    def _check_content(self, frame: PoseArrayFrame, now_ns: int) -> None:
        """Refuse the poses of the newest frame with a new stamp, where spheres move."""
        if not self._frames or frame.stamp_ns <= self._frames[-1][0].stamp_ns:
            return
        alone = self.length == 1  # no motion is taken from a window of one frame
        if alone and not self.settings.matched:
            return
        speed = 0.0  # known of matched spheres only
        if self.settings.matched:
            velocities = self._tracks.motion.velocities
            speed = float(np.linalg.norm(velocities, axis=1).max(initial=0.0))
        self._repeats.check(frame, speed)
        if not alone and self._repeats.belie([known for known, _ in self._frames], frame):
            first = self._frames[0][0]
            self.counts['content'] += len(self._frames) - 1
            self.clear()
            self._take(first, now_ns)
