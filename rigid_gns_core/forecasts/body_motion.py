# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motion of a body that carries surfaces: by its poses, its twists and its plan.

It goes on from its newest pose as planned, where a plan holds, else with a constant twist: the one
that was sent, else the slope of the newest poses by least squares. A body whose poses have stopped
is at rest where it was.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from .plan import Plan
from .pose import check_pose
from ..errors import UserError
from ..scenes.planned_motion import Moments, PlannedMotion
from ..scenes.state import Array
from ..tracking.usable_frames import seconds

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
        plan: What it will do from then on, at time 0; None: it keeps its twist.
    """

    position: Array
    rotation: Rotation
    velocity: Array
    angular_velocity: Array
    source: str
    plan: PlannedMotion | None = None

    def after(self, time: float) -> BodyMotion:
        """The motion a time later, or earlier [s], with a constant twist."""
        turn = Rotation.from_rotvec(time * self.angular_velocity)
        return BodyMotion(
            self.position + time * self.velocity,
            turn * self.rotation,
            self.velocity,
            self.angular_velocity,
            self.source,
        )


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

    def at(self, stamp_ns: int, ahead: float = 0.0) -> BodyMotion | None:
        """Motion at a time, with what is planned for so long after it [s]; None: nothing known."""
        motion, plan = self._present(stamp_ns), self.plan
        if motion is None or plan is None:
            return motion
        return replace(motion, plan=_planned(plan, stamp_ns, ahead, motion))

    def _present(self, stamp_ns: int) -> BodyMotion | None:
        planned = None
        if self.plan is not None and (self.plan.holds(stamp_ns) or not self._poses):
            planned = _of_plan(self.plan, stamp_ns)
        if not self._poses:
            return planned
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


def _at_rest(pose: Array) -> BodyMotion:
    zero = np.zeros(3)
    return BodyMotion(pose[:3], Rotation.from_quat(pose[3:]), zero, zero, '')


def _of_plan(plan: Plan, stamp_ns: int) -> BodyMotion:
    """Motion of a body by its plan alone."""
    there = plan.at(stamp_ns)
    return BodyMotion(
        there.positions[0],
        Rotation.from_quat(there.quaternions[0]),
        there.velocities[0],
        there.angular_velocities[0],
        'plan' if plan.holds(stamp_ns) else '',
    )


def _planned(plan: Plan, stamp_ns: int, ahead: float, present: BodyMotion) -> PlannedMotion | None:
    """What a plan says from a time on, from where the body is then; None: nothing.

    The body keeps its twist up to the first point of the plan, and moves by what the plan moves.
    """
    times, moments = plan.after(stamp_ns, ahead)
    if not len(times):
        return None
    wait = max(float(times[0]), 0.0)
    begin = present.after(wait)
    there = plan.at(stamp_ns + round(wait * 1e9))
    positions = moments.positions + (begin.position - there.positions[0])
    # turned as the plan is, so that its twist holds as it stands
    turned = Rotation.from_quat(there.quaternions[0]).inv() * begin.rotation
    quaternions = (Rotation.from_quat(moments.quaternions) * turned).as_quat()
    moments = moments._replace(positions=positions, quaternions=quaternions)
    if wait:
        # a point for each radian, as a rotation between two is the shorter one
        count = 2 + int(wait * np.linalg.norm(present.angular_velocity))
        before = np.linspace(0.0, wait, count)
        coming = [present.after(time) for time in before.tolist()]
        own = Moments(
            np.array([one.position for one in coming]),
            np.array([one.rotation.as_quat() for one in coming]),
            np.tile(present.velocity, (count, 1)),
            np.tile(present.angular_velocity, (count, 1)),
        )
        times = np.concatenate([before, times])
        moments = Moments(*(np.concatenate(pair) for pair in zip(own, moments, strict=True)))
    return PlannedMotion.of(times, moments)
