# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion of a body that carries surfaces: by its poses, its twists and its plan.

It goes on with a constant twist from its newest pose. The twist is that of the plan, where one
holds then, else the one that was sent, else the slope of the newest poses by least squares. A body
whose poses have stopped is at rest where it was.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..errors import UserError
from ..messages.trajectories import FutureFrame
from ..scenes.state import Array
from ..tracking.usable_frames import seconds, Stamps

# of the length of a quaternion from 1
_UNIT = 1e-3
# a stamp so much older than the newest is of a clock that was set, or a source that restarted [ns]
_RESTART_NS = 1_000_000_000
_MOST = 1000  # poses kept


@dataclass(frozen=True)
class BodyMotion:
    """Pose and twist of a body at one time, in the frame of the scene.

    Args:
        position: Of its origin [m], shape (3,).
        rotation: From its axes to those of the scene.
        velocity: Of its origin [m/s], shape (3,).
        angular_velocity: [rad/s], shape (3,).
        source: What the twist is from: poses, twist, plan; empty: it is taken as at rest.
    """

    position: Array
    rotation: Rotation
    velocity: Array
    angular_velocity: Array
    source: str

    def after(self, time: float) -> BodyMotion:
        """The motion a time later, or earlier [s]."""
        turn = Rotation.from_rotvec(time * self.angular_velocity)
        return BodyMotion(
            self.position + time * self.velocity,
            turn * self.rotation,
            self.velocity,
            self.angular_velocity,
            self.source,
        )


@dataclass(frozen=True)
class Plan:
    """Poses and twists that a body will have; k of them, two or more.

    Args:
        stamps: Rising times [ns], shape (k,).
        poses: Position [m] and quaternion (x, y, z, w), shape (k, 7).
        twists: Linear [m/s] and angular [rad/s], shape (k, 6); NaN: those from pose to pose.
    """

    stamps: Stamps
    poses: Array
    twists: Array

    @classmethod
    def of(cls, message: FutureFrame, name: str, now_ns: int) -> Plan:
        """Plan of the body `name`, or of the only one; a stamp of 0 is `now_ns`.

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
        return cls((message.stamp_ns or now_ns) + times, poses, twists)

    def at(self, stamp_ns: int) -> BodyMotion | None:
        """Motion at a time; None: before the first point or after the last."""
        if not self.stamps[0] <= stamp_ns <= self.stamps[-1]:
            return None
        k = min(int(np.searchsorted(self.stamps, stamp_ns, 'right')), len(self.stamps) - 1)
        length = float(self.stamps[k] - self.stamps[k - 1]) * 1e-9
        time = float(stamp_ns - self.stamps[k - 1]) * 1e-9
        begin, end = (_at_rest(self.poses[k - 1]), _at_rest(self.poses[k]))
        chord = BodyMotion(
            begin.position,
            begin.rotation,
            (end.position - begin.position) / length,
            (end.rotation * begin.rotation.inv()).as_rotvec() / length,
            'plan',
        )
        there = chord.after(time)
        twist = self.twists[k - 1] + time / length * (self.twists[k] - self.twists[k - 1])
        if not np.isfinite(twist).all():
            return there
        return BodyMotion(there.position, there.rotation, twist[:3], twist[3:], 'plan')

    def rest_at(self, stamp_ns: int) -> BodyMotion:
        """At rest at the last point that a time has passed, or at the first."""
        return _at_rest(self.poses[-1 if stamp_ns > self.stamps[-1] else 0])


class BodyTrack:
    """What is known of the motion of one body.

    Args:
        span: Time of the newest poses from which a twist is estimated [s].
        timeout: A body whose newest pose is older is taken as at rest [s].
    """

    def __init__(self, span: float, timeout: float) -> None:
        self._span_ns, self._timeout_ns = round(span * 1e9), round(timeout * 1e9)
        self._poses: deque[tuple[int, Array]] = deque(maxlen=_MOST)
        self._twist: tuple[int, Array] | None = None
        self.plan: Plan | None = None

    @property
    def known(self) -> bool:
        """Whether it was seen, or has a plan."""
        return bool(self._poses) or self.plan is not None

    def age(self, stamp_ns: int) -> float:
        """Time from the newest pose to a time [s]; infinite before the first."""
        return (stamp_ns - self._poses[-1][0]) * 1e-9 if self._poses else np.inf

    def add_pose(self, stamp_ns: int, pose: Array) -> None:
        """Add a pose, position [m] and quaternion (x, y, z, w), shape (7,).

        Raises:
            UserError: A number is not finite, the quaternion is not of length 1, or the stamp is
                not later than the one before, or is earlier by less than a second.
        """
        check_pose(pose)
        newest = self._poses[-1][0] if self._poses else None
        if newest is not None and stamp_ns <= newest:
            if newest - stamp_ns < _RESTART_NS:
                raise UserError(
                    f'stamp {seconds(stamp_ns)} s is not later than that before, '
                    f'{seconds(newest)} s'
                )
            self._poses.clear()
        self._poses.append((stamp_ns, pose))
        while stamp_ns - self._poses[0][0] > self._span_ns and len(self._poses) > 2:
            self._poses.popleft()

    def add_twist(self, stamp_ns: int, twist: Array) -> None:
        """Add a twist, linear [m/s] and angular [rad/s], shape (6,); UserError: it is none."""
        if not np.isfinite(twist).all():
            raise UserError('a velocity is not finite')
        self._twist = stamp_ns, twist

    def at(self, stamp_ns: int) -> BodyMotion | None:
        """Motion at a time; None: nothing is known."""
        planned = self.plan.at(stamp_ns) if self.plan else None
        if not self._poses:
            return planned or (self.plan.rest_at(stamp_ns) if self.plan else None)
        newest, pose = self._poses[-1]
        if abs(stamp_ns - newest) > self._timeout_ns:
            return planned or _at_rest(pose)
        velocity, spin, source = self._twist_at(newest)
        if planned is not None:
            velocity, spin, source = planned.velocity, planned.angular_velocity, 'plan'
        still = _at_rest(pose)
        moving = BodyMotion(still.position, still.rotation, velocity, spin, source)
        return moving.after((stamp_ns - newest) * 1e-9)

    def _twist_at(self, newest: int) -> tuple[Array, Array, str]:
        if self._twist is not None and abs(self._twist[0] - newest) <= self._timeout_ns:
            return self._twist[1][:3], self._twist[1][3:], 'twist'
        times = np.array([stamp - newest for stamp, _ in self._poses]) * 1e-9
        near = times >= -1e-9 * self._timeout_ns
        if near.sum() < 2:
            return np.zeros(3), np.zeros(3), 'poses'
        poses = np.array([pose for _, pose in self._poses])[near]
        apart = times[near] - times[near].mean()
        turned = Rotation.from_quat(poses[:, 3:]) * Rotation.from_quat(poses[-1, 3:]).inv()
        weights = apart / (apart @ apart)
        return weights @ poses[:, :3], weights @ turned.as_rotvec(), 'poses'


def check_pose(pose: Array) -> None:
    """Raise UserError where a pose, shape (7,), is none."""
    if not np.isfinite(pose).all():
        raise UserError('a number of its pose is not finite: the body is not seen')
    length = float(np.linalg.norm(pose[3:]))
    if abs(length - 1.0) > _UNIT:
        raise UserError(f'its quaternion has length {length:.4g}, expected 1 within {_UNIT:g}')


def _at_rest(pose: Array) -> BodyMotion:
    zero = np.zeros(3)
    return BodyMotion(pose[:3], Rotation.from_quat(pose[3:]), zero, zero, '')
