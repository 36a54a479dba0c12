# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plan of a body, from a trajectory_msgs/MultiDOFJointTrajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .pose import check_pose
from ..errors import UserError
from ..messages.trajectories import FutureFrame
from ..scenes.planned_motion import Moments, PlannedMotion
from ..scenes.state import Array, as_unit, rotation_between


@dataclass(frozen=True)
class Plan:
    """Poses and twists that a body will have.

    Args:
        begin_ns: Time of its first point [ns].
        end_ns: Time of its last point [ns].
        motion: From its first point on, in the frame of the scene.
    """

    begin_ns: int
    end_ns: int
    motion: PlannedMotion

    @classmethod
    def of(cls, message: FutureFrame, name: str, now_ns: int) -> Plan:
        """Plan of the body `name`, or of the only one; a stamp of 0 is `now_ns`.

        Where one of two points has no velocities, the twist is constant between their poses.

        Raises:
            UserError: It is not in the message, there are less than two points, their times do not
                rise, or a pose is none.
        """
        if name not in message.names and len(message.names) != 1:
            names = ', '.join(message.names) or 'none'
            raise UserError(f'its joint_names are {names}, expected {name}, or one alone')
        column = message.names.index(name) if name in message.names else 0
        times = np.array(message.times_ns, dtype=np.int64)
        if len(times) < 2 or not (np.diff(times) > 0).all():
            raise UserError(f'it has {len(times)} points, expected two or more, of rising times')
        poses, twists = message.poses[:, column], message.twists[:, column]
        for pose in poses:
            check_pose(pose)
        if np.isinf(twists).any():
            raise UserError('a velocity is not finite')
        begin = message.stamp_ns or now_ns
        motion = _motion_of((times - times[0]) * 1e-9, poses, twists)
        return cls(begin + int(times[0]), begin + int(times[-1]), motion)

    def holds(self, stamp_ns: int) -> bool:
        """Whether a time is between its first point and its last."""
        return self.begin_ns <= stamp_ns <= self.end_ns

    def at(self, stamp_ns: int) -> Moments:
        """The body at a time; before the first point and after the last it rests there."""
        return self.motion.at(np.array([(stamp_ns - self.begin_ns) * 1e-9]))

    def after(self, stamp_ns: int, ahead: float) -> tuple[Array, Moments]:
        """Its points for so long after a time [s], and the last one before that; maybe none."""
        moments = self.motion.moments
        times = np.array(self.motion.times) + (self.begin_ns - stamp_ns) * 1e-9
        if times[-1] <= 0.0 or times[0] >= ahead:
            return times[:0], moments
        first = max(int(np.searchsorted(times, 0.0, 'right')) - 1, 0)
        kept = slice(first, int(np.searchsorted(times, ahead)) + 1)
        return times[kept], Moments(*(values[kept] for values in moments))


def _motion_of(times: Array, poses: Array, twists: Array) -> PlannedMotion:
    """Motion through poses, shape (k, 7), with twists, shape (k, 6), NaN where not known."""
    places, turns = poses[:, :3], as_unit(poses[:, 3:])
    known = np.isfinite(twists.sum(axis=1))
    if known.all():
        return PlannedMotion.of(times, Moments(places, turns, twists[:, :3], twists[:, 3:]))
    ways = [np.diff(places, axis=0), rotation_between(turns[:-1], turns[1:])]
    chords = np.concatenate(ways, axis=1) / np.diff(times)[:, None]
    both = (known[:-1] & known[1:])[:, None]
    # each point between two others twice: the twist may jump there
    ends = np.stack(
        [np.where(both, twists[:-1], chords), np.where(both, twists[1:], chords)], axis=1
    ).reshape(-1, 6)
    twice = np.repeat(np.arange(len(times)), 2)[1:-1]
    moments = Moments(places[twice], turns[twice], ends[:, :3], ends[:, 3:])
    return PlannedMotion.of(times[twice], moments)
