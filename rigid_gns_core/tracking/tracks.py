# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The spheres that are tracked: who is who, who is new, who is gone, and how each moves.

A `Tracks` is the outcome of frames in the order of their stamps, and is never changed, so that
a late frame can be put in its place by going on from the set before it. Arrival times play no
part.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .association import gates, Indices, match
from .coasting import coast, turn_on
from .environment import Environment
from .initiation import initiate_tracks, INITIATION_FRAMES
from .motion_models import FLIGHT, Motion
from .noise_estimate import KEPT, NoiseEstimate, third_differences
from .velocity import estimate_motion
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array

# frames before noise can be estimated
_NOISE_FRAMES = 4
# noise is taken for so many radii until it is estimated
_NOISE_GUESS = 5e-3
# a sphere is coasted for so many intervals at least
_COAST_FRAMES = 2.5
# one whose frames agree with no motion so many times in a row has been matched wrongly, and is
# left for what is there to be found anew
_MOST_MISFITS = 5


@dataclass(frozen=True)
class TrackerSettings:
    """How spheres are followed.

    Args:
        environment: Surfaces, gravity and radii.
        length: Frames from which motion is estimated.
        matched: Whether poses are matched; else they always come in the same order.
        noise: Of each coordinate of a position [m]; None: estimated.
        coast_time: A sphere not seen for longer is dropped [s], but never for two frames.
        max_speed: New spheres that are faster are not found [m/s].
        radius: Of the largest sphere [m].
    """

    environment: Environment
    length: int
    matched: bool
    noise: float | None
    coast_time: float
    max_speed: float
    radius: float

    @property
    def memory(self) -> int:
        """Number of frames kept."""
        return max(self.length, _NOISE_FRAMES)


@dataclass(frozen=True)
class Tracks:
    """Spheres at the newest frame, in the order of their ids.

    Args:
        stamps: Of the frames in memory [ns], rising, shape (m,).
        ids: Shape (n,).
        poses: In each frame, shape (m, n, 7); what was not seen is zero.
        seen: Whether a sphere was seen in a frame, shape (m, n).
        last_seen: Stamp of the last frame that holds it [ns], shape (n,).
        motion: Of all spheres at the newest frame, where poses are matched.
        next_id: Of the next new sphere.
        unassociated: Poses that no sphere claimed, of each of the newest frames, shapes (k, 7).
        noise_estimate: Of the noise.
        missed: Number of spheres that were not seen in the newest frame.
        misfits: How many times in a row no motion explained three frames, shape (n,).
    """

    stamps: NDArray[np.int64]
    ids: NDArray[np.int64]
    poses: Array
    seen: NDArray[np.bool_]
    last_seen: NDArray[np.int64]
    motion: Motion
    next_id: int = 0
    unassociated: tuple[Array, ...] = ()
    noise_estimate: NoiseEstimate = field(default_factory=NoiseEstimate)
    missed: int = 0
    misfits: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @classmethod
    def empty(cls, next_id: int = 0, noise_estimate: NoiseEstimate | None = None) -> Tracks:
        """No frame and no sphere yet."""
        no_ids = np.zeros(0, dtype=np.int64)
        return cls(
            stamps=no_ids,
            ids=no_ids,
            poses=np.zeros((0, 0, 7)),
            seen=np.zeros((0, 0), dtype=bool),
            last_seen=no_ids,
            motion=Motion.unknown(np.zeros((0, 7))),
            next_id=next_id,
            noise_estimate=noise_estimate or NoiseEstimate(),
        )

    def noise(self, settings: TrackerSettings) -> float:
        """Return the standard deviation of each coordinate [m]: given, estimated, or a guess."""
        if settings.noise is not None:
            return settings.noise
        observed = self.noise_estimate.spread
        return _NOISE_GUESS * settings.radius if observed is None else observed

    def after(self, frame: PoseArrayFrame, settings: TrackerSettings) -> Tracks:
        """Return the set after the next frame, whose stamp is later than that of all before."""
        step_ns = int(frame.stamp_ns - self.stamps[-1]) if len(self.stamps) else 0
        poses = frame.poses.copy()
        poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
        expected = self.motion
        if settings.matched:
            expected = _expected(self, settings, step_ns * 1e-9)
        found = self._found(poses, expected, settings, step_ns * 1e-9)
        held = found >= 0
        row = np.zeros((len(self.ids), 7))
        row[held] = poses[found[held]]
        claimed = np.zeros(len(poses), dtype=bool)
        claimed[found[held]] = True
        since = frame.stamp_ns - np.where(held, frame.stamp_ns, self.last_seen)
        keep = (self.misfits < _MOST_MISFITS) | (not settings.matched)
        keep &= since <= max(settings.coast_time * 1e9, _COAST_FRAMES * step_ns)
        tail = slice(-(settings.memory - 1), None)
        grown = Tracks(
            stamps=np.append(self.stamps[tail], np.int64(frame.stamp_ns)),
            ids=self.ids[keep],
            poses=np.concatenate([self.poses[tail], row[None]])[:, keep],
            seen=np.concatenate([self.seen[tail], held[None]])[:, keep],
            last_seen=np.where(held, frame.stamp_ns, self.last_seen)[keep],
            motion=expected.part(keep),
            next_id=self.next_id,
            unassociated=(*self.unassociated[-(INITIATION_FRAMES - 1) :], poses[~claimed]),
            noise_estimate=self.noise_estimate,
            missed=int((~held & keep).sum()),
            misfits=self.misfits[keep],
        )
        grown = grown._initiate(settings)
        grown = grown._estimate_noise(settings)
        if not settings.matched:  # motion is asked for by `window_motion`, not by the next frame
            return grown
        motion = grown._estimated(max(settings.length, INITIATION_FRAMES), settings)
        return replace(grown, motion=motion, misfits=grown._count_misfits(motion))

    def _found(
        self, poses: Array, expected: Motion, settings: TrackerSettings, time: float
    ) -> Indices:
        if not settings.matched:
            return np.arange(len(self.ids), dtype=np.int64)
        radii = settings.environment.radii(self.ids)
        noise = self.noise(settings)
        limit = settings.max_speed
        spread = np.hypot(noise, np.minimum(expected.errors, limit) * time)
        speeds = np.minimum(np.linalg.norm(expected.velocities, axis=1), limit)
        reliable = expected.frames > 2
        width = gates(speeds, expected.positions, radii, spread, time, reliable)
        found = match(expected.positions, poses[:, :3], width)
        lost, free = np.flatnonzero(found < 0), np.setdiff1d(np.arange(len(poses)), found)
        if len(lost) and len(free):  # one that was thrown back is off by twice its way
            width = gates(2.0 * speeds, expected.positions, radii, spread, time, reliable)
            again = match(expected.positions[lost], poses[free, :3], width[lost])
            found[lost[again >= 0]] = free[again[again >= 0]]
        return found

    def _initiate(self, settings: TrackerSettings) -> Tracks:
        """Return them with the new tracks that unassociated poses give."""
        need = min(settings.length, INITIATION_FRAMES) if settings.matched else 1
        unassociated = self.unassociated[-need:]
        if len(unassociated) < need or not all(len(poses) for poses in unassociated):
            return self
        chains = initiate_tracks(
            [poses[:, :3] for poses in unassociated],
            (self.stamps[-need:] - self.stamps[-1]) * 1e-9,
            gravity=settings.environment.gravity,
            radius=settings.radius,
            noise=self.noise(settings),
            max_speed=settings.max_speed,
            any_track=len(self.ids) > 0,
        )
        if not len(chains):
            return self
        count, total = len(chains), len(self.stamps)
        poses = np.zeros((total, count, 7))
        seen = np.zeros((total, count), dtype=bool)
        rest = []
        for back, (one, index) in enumerate(zip(unassociated, chains.T, strict=True)):
            poses[total - need + back], seen[total - need + back] = one[index], True
            rest.append(np.delete(one, index, axis=0))
        ids = self.next_id + np.arange(count, dtype=np.int64)
        return replace(
            self,
            ids=np.append(self.ids, ids),
            poses=np.concatenate([self.poses, poses], axis=1),
            seen=np.concatenate([self.seen, seen], axis=1),
            last_seen=np.append(self.last_seen, np.full(count, self.stamps[-1])),
            misfits=np.append(self.misfits, np.zeros(count, dtype=np.int64)),
            motion=self.motion.joined(Motion.unknown(poses[-1])),
            next_id=self.next_id + count,
            unassociated=tuple(rest),
        )

    def _estimate_noise(self, settings: TrackerSettings) -> Tracks:
        if settings.noise is not None or len(self.stamps) < _NOISE_FRAMES or not len(self.ids):
            return self
        newest = slice(-_NOISE_FRAMES, None)
        values = third_differences(
            (self.stamps[newest] - self.stamps[-1]) * 1e-9,
            self.poses[newest, :, :3],
            self.seen[newest],
        )
        kept = KEPT
        if not settings.matched:
            # then a start is a function of the frames of its window alone
            kept = values.size * max(settings.length - _NOISE_FRAMES + 1, 0)
        return replace(self, noise_estimate=self.noise_estimate.after(values, kept))

    def _estimated(self, frames: int, settings: TrackerSettings) -> Motion:
        """Estimates where spheres were seen twice in the window and now, else the expected."""
        window = slice(-frames, None)
        seen = self.seen[window]
        observed = seen[-1] & (seen.sum(axis=0) > 1)
        if not observed.any():
            return self._corrected(self.motion)
        estimate = estimate_motion(
            (self.stamps[window] - self.stamps[-1]) * 1e-9,
            self.poses[window][:, observed, :3],
            self.poses[window][:, observed, 3:],
            environment=settings.environment,
            radii=settings.environment.radii(self.ids[observed]),
            noise=self.noise(settings),
            seen=seen[:, observed],
        )
        if observed.all():
            return estimate
        fields = {}
        for name, value in vars(self._corrected(self.motion)).items():
            fields[name] = value.copy()
            fields[name][observed] = getattr(estimate, name)
        return Motion(**fields)

    def _count_misfits(self, motion: Motion) -> NDArray[np.int64]:
        observed = self.seen[-1] & (self.seen[-3:].sum(axis=0) > 2)
        return np.where(observed, np.where(motion.frames > 2, 0, self.misfits + 1), self.misfits)

    def window_motion(self, settings: TrackerSettings) -> Motion:
        """Motion from the last `length` frames: at rest from one, and two have no third to ask."""
        if settings.length >= INITIATION_FRAMES:
            return self.motion if settings.matched else self._estimated(settings.length, settings)
        rest = self._corrected(self.motion)
        if settings.length == 1:
            none = np.zeros_like(rest.velocities)
            return replace(rest, velocities=none, angular_velocities=none)
        return self._estimated(2, settings)

    def _corrected(self, expected: Motion) -> Motion:
        """Return what was expected, at the places where spheres were seen."""
        now = self.seen[-1][:, None]
        return replace(
            expected,
            positions=np.where(now, self.poses[-1, :, :3], expected.positions),
            quaternions=np.where(now, self.poses[-1, :, 3:], expected.quaternions),
        )


def _expected(before: Tracks, settings: TrackerSettings, time: float) -> Motion:
    """Return the spheres at the next frame, as far as those before tell."""
    motion = before.motion
    if not len(before.ids):
        return motion
    positions, velocities = coast(
        settings.environment,
        motion.positions,
        motion.velocities,
        motion.kinds == FLIGHT,
        settings.environment.radii(before.ids),
        np.full(len(before.ids), time),
    )
    turned = turn_on(motion.quaternions, motion.angular_velocities, time)
    return replace(motion, positions=positions, velocities=velocities, quaternions=turned)
