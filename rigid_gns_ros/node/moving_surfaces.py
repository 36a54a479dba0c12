# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bodies that carry surfaces of the scene: their topics, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped
import numpy as np
from rigid_gns_core.errors import UserError
from rigid_gns_core.forecasts.moving_surfaces import MovingSurfaces
from rigid_gns_core.forecasts.plan import Plan
from rigid_gns_core.messages.diagnostics import OK, Status, WARN
from rigid_gns_core.messages.stamped import decode_pose_stamped, decode_twist_stamped, Stamped
from rigid_gns_core.messages.trajectories import decode_trajectory, FutureFrame
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.transform_buffer import IDENTITY, moved, turned
from trajectory_msgs.msg import MultiDOFJointTrajectory

from .transforms import Transforms

# topic, message type, and what takes a message: whether it was accepted
Listener = tuple[str, Any, Callable[[bytes], bool]]


class Bodies:
    """Hears where the bodies are.

    Args:
        surfaces: Their surfaces.
        frame_id: Coordinate frame of the scene; messages in others are transformed by tf.
        now: Gives the time of the node's clock [ns].
        warn: Called with a kind and a sentence, possibly often.
    """

    def __init__(
        self,
        surfaces: MovingSurfaces,
        frame_id: str,
        now: Callable[[], int],
        warn: Callable[[str, str], None],
    ) -> None:
        self._surfaces, self._frame_id = surfaces, frame_id
        self._transforms: Transforms
        self._now, self._warn = now, warn
        self._rejected = dict.fromkeys(surfaces.bodies, 0)

    @property
    def listeners(self) -> Sequence[Listener]:
        """Topics of all bodies."""
        kinds: tuple[tuple[str, Any, Callable[[str, bytes], None]], ...] = (
            ('pose', PoseStamped, self._take_pose),
            ('twist', TwistStamped, self._take_twist),
            ('plan', MultiDOFJointTrajectory, self._take_plan),
        )
        return [
            (topic, kind, partial(self._take, name, role, take))
            for name, body in self._surfaces.bodies.items()
            for role, kind, take in kinds
            if (topic := getattr(body, role))
        ]

    def follow(self, transforms: Transforms) -> None:
        """Transform messages, and hear of bodies that are frames of tf; UserError: none comes."""
        self._transforms = transforms
        frames = [body.frame for body in self._surfaces.bodies.values() if body.frame]
        if frames:
            transforms.watch(frames, self._take_frame)

    def ready(self, stamp_ns: int) -> bool:
        """Whether all bodies are known at a tracked frame; warnings name those that are not."""
        self._watch(stamp_ns)
        for name in self._surfaces.unknown:
            body = self._surfaces.bodies[name]
            self._warn(
                f'{name} unknown',
                f'nothing is predicted, as nothing has come for {name} on '
                f'{body.where} yet (parameter moving_surfaces)',
            )
            return False
        return True

    def _watch(self, stamp_ns: int) -> None:
        """Warn of bodies whose poses have stopped, as of a tracked frame."""
        for name, body in self._surfaces.bodies.items():
            if late := self._late(name, stamp_ns):
                self._warn(
                    f'{name} late',
                    f'{name} is taken as at rest where it was: {late} (expected within '
                    f'{body.timeout:g} s); do the clocks of both fit?',
                )

    def status(self, stamp_ns: int | None) -> list[Status]:
        """Diagnostics, as of a tracked frame; none without bodies."""
        if not self._surfaces.bodies:
            return []
        level, message, values = OK, 'all bodies are followed', {}
        for name, track in self._surfaces.tracks.items():
            motion = None if stamp_ns is None else track.at(stamp_ns)
            if not track.known:
                level, message = WARN, f'nothing is known of {name} yet: nothing is predicted'
            elif stamp_ns is not None and (late := self._late(name, stamp_ns)):
                level, message = WARN, f'{name} is taken as at rest where it was: {late}'
            values[f'{name}: motion by'] = motion.source or 'none, at rest' if motion else ''
            if motion is not None:
                values[f'{name}: speed [m/s]'] = f'{np.linalg.norm(motion.velocity):.3g}'
            values[f'{name}: rejected'] = str(self._rejected[name])
        return [Status(level, 'surfaces', message, values)]

    def _late(self, name: str, stamp_ns: int) -> str:
        """What is wrong with the time of the newest pose of a body; empty: nothing."""
        body, track = self._surfaces.bodies[name], self._surfaces.tracks[name]
        age = track.age(stamp_ns)
        planned = track.plan is not None and track.plan.holds(stamp_ns)
        sent = body.pose or body.frame
        if not sent or not track.known or planned or abs(age) <= body.timeout:
            return ''
        if not np.isfinite(age):
            return f'no pose has come on {body.where}'
        way = 'older' if age > 0 else 'newer'
        return f'its newest pose on {body.where} is {abs(age):.3g} s {way} than the tracked frame'

    def _take(self, name: str, role: str, take: Callable[[str, bytes], None], cdr: bytes) -> bool:
        return self._try(name, role, lambda: take(name, cdr))

    def _take_frame(self, frame: str, stamp_ns: int, pose: Array) -> None:
        name = next(name for name, body in self._surfaces.bodies.items() if body.frame == frame)
        track = self._surfaces.tracks[name]
        self._try(name, 'pose', lambda: track.add_pose(stamp_ns, pose))

    def _try(self, name: str, role: str, take: Callable[[], None]) -> bool:
        try:
            take()
        except UserError as error:
            self._refuse(name, role, error)
            return False
        return True

    def _refuse(self, name: str, role: str, error: UserError) -> None:
        self._rejected[name] += 1
        self._warn(f'{name} {role}', f'{role} of {name} rejected: {error}')

    def _take_pose(self, name: str, cdr: bytes) -> None:
        pose, track = decode_pose_stamped(cdr), self._surfaces.tracks[name]

        def take(by: Array) -> None:
            track.add_pose(pose.stamp_ns, moved(pose.values, by))

        self._place(name, 'pose', pose, take)

    def _take_twist(self, name: str, cdr: bytes) -> None:
        twist, track = decode_twist_stamped(cdr), self._surfaces.tracks[name]

        def take(by: Array) -> None:
            track.add_twist(twist.stamp_ns, turned(twist.values, by))

        self._place(name, 'twist', twist, take)

    def _take_plan(self, name: str, cdr: bytes) -> None:
        message, now = decode_trajectory(cdr, bare=True), self._now()

        def take(by: Array) -> None:
            poses, twists = moved(message.poses, by), turned(message.twists, by)
            own = replace(message, poses=poses, twists=twists)
            self._surfaces.tracks[name].plan = Plan.of(own, name, now)

        self._place(name, 'plan', message, take)

    def _place(
        self, name: str, role: str, message: Stamped | FutureFrame, take: Callable[[Array], None]
    ) -> None:
        """Call `take` with the pose of a message's frame in the scene's; maybe later.

        Raises:
            UserError: It has no frame, tf cannot be heard, or what `take` raises.
        """
        frame_id = message.frame_id
        if frame_id == self._frame_id:
            take(IDENTITY)
            return
        if not frame_id:
            raise UserError(
                f'it has no frame_id, expected {self._frame_id!r} (parameter frame_id)'
            )
        now = self._now()
        # a plan may begin later, and where its frame will be then nobody knows
        stamp = min(message.stamp_ns or now, now)
        self._transforms.find(
            f'{name} {role}',
            frame_id,
            stamp,
            lambda by: self._keep(name, role, by, take),
            lambda error: self._refuse(name, role, error),
        )

    def _keep(self, name: str, role: str, by: Array, take: Callable[[Array], None]) -> None:
        self._try(name, role, lambda: take(by))
