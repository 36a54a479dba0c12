# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The tracks: association, initiation, coasting and deletion of spheres, and their motion.

A `Tracks` follows from the frames in the order of their stamps and is never changed. A late frame
is inserted by updating again from the tracks before it. Arrival times play no part.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .association import associate
from .coasting import coast, turn_on
from .initiation import initiate_tracks, INITIATION_FRAMES
from .jit import plain
from .lost_spheres import measured
from .motion_models import FLIGHT, Motion
from .newest_frame import append_frame
from .noise_estimate import MAX_DIFFERENCES, NOISE_FRAMES, NoiseEstimate, third_differences
from .tracker_settings import TrackerSettings
from .unknown_rotations import whole_rotations
from .velocity import estimate_motion
from ..messages.poses import PoseArrayFrame
from ..scenes.state import Array, as_unit

# noise until it is estimated [radii]
_NOISE_GUESS = 5e-3
# a track is coasted at least for this many intervals between frames
_COAST_FRAMES = 2.5
# a track whose frames agree with no motion this many times in a row is a wrong association: it is
# deleted, and the sphere starts a new one
_MOST_MISFITS = 5
# stands in for a pose that was not measured
_LOST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Tracks:
    """Tracks at the newest frame, in the order of their ids.

    Args:
        stamps: Stamps of the frames in memory [ns], rising, shape (m,).
        ids: Id of each track, shape (n,).
        poses: Position [m] and quaternion (x, y, z, w) in each frame, zero where not seen, and a
            quaternion of zero where a rotation is unknown, shape (m, n, 7).
        seen: Whether a sphere was seen in a frame, shape (m, n).
        last_seen: Stamp of the last frame that shows each sphere [ns], shape (n,).
        motion: Motion at the newest frame, where poses are matched.
        next_id: Id of the next new track.
        unassociated: Poses associated with no track, of each of the newest frames, shapes (k, 7).
        noise_estimate: Estimate of the measurement noise.
        missed: Number of tracks without a pose in the newest frame.
        misfits: Consecutive times that no motion explained three frames, shape (n,).
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
        """Tracks before the first frame."""
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
        """Standard deviation of each coordinate [m]: given, estimated, or a guess."""
        if settings.noise is not None:
            return settings.noise
        observed = self.noise_estimate.spread
        return _NOISE_GUESS * settings.radius if observed is None else observed

    def rotations(self, frames: slice = slice(None)) -> Array:
        """Rotations in some frames, as far as they are known in all, see `whole_rotations`."""
        return whole_rotations(self.poses[frames, :, 3:], self.seen[frames])

    def knows_noise(self, settings: TrackerSettings) -> bool:
        """Whether the noise is given or estimated; if not, it is a guess."""
        return settings.noise is not None or self.noise_estimate.spread is not None

    def updated(self, frame: PoseArrayFrame, settings: TrackerSettings) -> Tracks:
        """Tracks after the next frame, whose stamp is later than all before."""
        if not settings.matched and 0 < len(frame.poses) == len(self.ids):
            grown = self._with_all(frame, settings)
            if grown is not None:
                return grown
        step_ns = int(frame.stamp_ns - self.stamps[-1]) if len(self.stamps) else 0
        poses = frame.poses.copy()
        visible = measured(poses)
        poses[~visible] = _LOST
        turned = poses[:, 3:].any(axis=1)
        poses[turned, 3:] = as_unit(poses[turned, 3:])
        predicted = self.motion
        if settings.matched:
            predicted = _predict(self, settings, step_ns * 1e-9)
        if settings.matched:
            found = associate(
                predicted,
                poses[:, :3],
                radii=settings.environment.radii(self.ids),
                noise=self.noise(settings),
                limit=settings.max_speed,
                time=step_ns * 1e-9,
            )
        else:
            found = np.arange(len(self.ids), dtype=np.int64)
            found[~visible[: len(found)]] = -1
        detected = found >= 0
        row = np.zeros((len(self.ids), 7))
        row[detected] = poses[found[detected]]
        claimed = np.zeros(len(poses), dtype=bool)
        claimed[found[detected]] = True
        since = frame.stamp_ns - np.where(detected, frame.stamp_ns, self.last_seen)
        keep = (self.misfits < _MOST_MISFITS) | (not settings.matched)
        keep &= since <= max(settings.coast_time * 1e9, _COAST_FRAMES * step_ns)
        keep |= not settings.matched
        # where the order counts, spheres begin together
        begins = settings.matched or (visible.all() and not len(self.ids))
        free = poses[~claimed & visible & begins]
        stamps = np.append(self.stamps, np.int64(frame.stamp_ns))
        kept = max(settings.fewest, settings.used(stamps, len(self.ids)))
        tail = slice(-kept + 1, None)
        grown = Tracks(
            stamps=stamps[-kept:],
            ids=self.ids[keep],
            poses=np.concatenate([self.poses[tail], row[None]])[:, keep],
            seen=np.concatenate([self.seen[tail], detected[None]])[:, keep],
            last_seen=np.where(detected, frame.stamp_ns, self.last_seen)[keep],
            motion=predicted.part(keep),
            next_id=self.next_id,
            unassociated=(*self.unassociated[-(INITIATION_FRAMES - 1) :], free),
            noise_estimate=self.noise_estimate,
            missed=int((~detected & keep).sum()),
            misfits=self.misfits[keep],
        )
        grown = grown._initiate(settings)
        noise = grown._noise_after(grown.stamps, grown.poses, grown.seen, settings)
        grown = replace(grown, noise_estimate=noise)
        if not settings.matched:  # only `window_motion` needs the motion, not the next frame
            return grown
        motion = grown._estimate_motion(max(settings.length, INITIATION_FRAMES), settings)
        return replace(grown, motion=motion, misfits=grown._count_misfits(motion))

    def _with_all(self, frame: PoseArrayFrame, settings: TrackerSettings) -> Tracks | None:
        """As `updated`, of a frame of as many poses as spheres; None: one was not measured."""
        stamp_ns, n = frame.stamp_ns, len(self.ids)
        grown = np.concatenate((self.stamps, (stamp_ns,)), dtype=np.int64)
        kept = min(max(settings.fewest, settings.used(grown, n)), len(grown))
        poses, seen = np.empty((kept, n, 7)), np.empty((kept, n), dtype=np.bool_)
        before = plain(self.poses), np.ascontiguousarray(self.seen)
        if not append_frame(plain(frame.poses), *before, poses, seen):
            return None
        stamps = grown[-kept:]
        return Tracks(
            stamps=stamps,
            ids=self.ids,
            poses=poses,
            seen=seen,
            last_seen=np.full(n, stamp_ns, dtype=np.int64),
            motion=self.motion,
            next_id=self.next_id,
            unassociated=(*self.unassociated[-(INITIATION_FRAMES - 1) :], poses[0, :0]),
            noise_estimate=self._noise_after(stamps, poses, seen, settings),
            misfits=self.misfits,
        )

    def _initiate(self, settings: TrackerSettings) -> Tracks:
        """Tracks with those added that the unassociated poses initiate."""
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
        remaining = []
        for back, (frame_poses, index) in enumerate(zip(unassociated, chains.T, strict=True)):
            poses[total - need + back], seen[total - need + back] = frame_poses[index], True
            remaining.append(np.delete(frame_poses, index, axis=0))
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
            unassociated=tuple(remaining),
        )

    def _noise_after(
        self,
        stamps: NDArray[np.int64],
        poses: Array,
        seen: NDArray[np.bool_],
        settings: TrackerSettings,
    ) -> NoiseEstimate:
        """Estimate of the noise with the newest of some frames."""
        count = seen.shape[1]
        if settings.noise is not None or len(stamps) < NOISE_FRAMES or not count:
            return self.noise_estimate
        newest = slice(-NOISE_FRAMES, None)
        times = (stamps[newest] - stamps[-1]) * 1e-9
        values = third_differences(times, poses[newest], seen[newest])
        kept = MAX_DIFFERENCES
        if not settings.matched:
            # so that a start depends on the frames of its window alone
            kept = values.size * max(settings.used(stamps, count) - NOISE_FRAMES + 1, 0)
        return self.noise_estimate.updated(values, kept)

    def _estimate_motion(self, frames: int, settings: TrackerSettings) -> Motion:
        """Motion from the last frames; the prediction where these do not show a sphere twice."""
        window = slice(-frames, None)
        seen = self.seen[window]
        observed = seen[-1] & (seen.sum(axis=0) > 1)
        if not settings.matched:  # each was seen, see `TrackingWindow`; the others are coasted
            observed = seen.any(axis=0)
        if not observed.any():
            return self._at_detections(self.motion)
        estimate = estimate_motion(
            (self.stamps[window] - self.stamps[-1]) * 1e-9,
            self.poses[window][:, observed, :3],
            self.rotations(window)[:, observed],
            environment=settings.environment,
            radii=settings.environment.radii(self.ids[observed]),
            noise=self.noise(settings),
            seen=seen[:, observed],
        )
        if observed.all():
            return estimate
        fields = {}
        for name, value in vars(self._at_detections(self.motion)).items():
            fields[name] = value.copy()
            fields[name][observed] = getattr(estimate, name)
        return Motion(**fields)

    def _count_misfits(self, motion: Motion) -> NDArray[np.int64]:
        observed = self.seen[-1] & (self.seen[-3:].sum(axis=0) > 2)
        return np.where(observed, np.where(motion.frames > 2, 0, self.misfits + 1), self.misfits)

    def window_motion(self, settings: TrackerSettings) -> Motion:
        """Motion from the last `length` frames; one frame gives spheres at rest."""
        if settings.length >= INITIATION_FRAMES:
            return (
                self.motion
                if settings.matched
                else self._estimate_motion(settings.length, settings)
            )
        remaining = self._at_detections(self.motion)
        if settings.length == 1:
            none = np.zeros_like(remaining.velocities)
            return replace(remaining, velocities=none, angular_velocities=none)
        return self._estimate_motion(2, settings)

    def _at_detections(self, predicted: Motion) -> Motion:
        """The predicted motion, with the measured poses of the spheres that were seen."""
        now = self.seen[-1][:, None]
        return replace(
            predicted,
            positions=np.where(now, self.poses[-1, :, :3], predicted.positions),
            quaternions=np.where(now, self.rotations()[-1], predicted.quaternions),
        )


def _predict(before: Tracks, settings: TrackerSettings, time: float) -> Motion:
    """Predicted motion at the next frame, `time` [s] later."""
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
