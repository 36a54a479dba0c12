# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The node `tracker`, a stand-in for a real one: frames of a record or of Bullet, in real time."""

from __future__ import annotations

from typing import Any, Protocol

from geometry_msgs.msg import PoseArray
import numpy as np
from rigid_gns_core.data.records import demo_record, read_record, Record
from rigid_gns_core.errors import UserError
from rigid_gns_core.forecasts.node_parameters import TRACKER
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.scene_file import load_start
from rigid_gns_core.scenes.state import Array
from rigid_gns_core.tracking.usable_frames import seconds

from .alarm import Alarm
from .clock_jumps import on_jump
from .closing_node import ClosingNode, log_end
from .process import Finished
from .topics import overridable, sensor_data
from ..parameters import declare

WAIT_PERIOD_NS = 50_000_000  # period of the check for a subscriber [ns]
LIVE_SUBSTEPS = 48  # of the teacher per frame: a slow core can do these in real time
LIVE_DT = 0.1  # frame time of a live run with radius 1 m [s]; it scales with sqrt(radius)


class Source(Protocol):
    """Frames at equal intervals."""

    dt: float
    count: int

    def poses(self, index: int) -> Array | None:
        """Poses of frame `index`, shape (count, 7); None: it ended. Calls have rising indices."""
        ...


class Playback:
    """Frames of a record.

    Args:
        record: Record to play.
        loop: Whether to restart after the last frame.
    """

    def __init__(self, record: Record, loop: bool) -> None:
        trajectory = record.trajectory
        self._poses = np.concatenate([trajectory.positions, trajectory.quaternions], axis=2)
        self._loop = loop
        self.dt, self.count = trajectory.dt, trajectory.count

    def poses(self, index: int) -> Array | None:
        """Poses of frame `index`, shape (count, 7); None: it ended."""
        if index >= len(self._poses) and not self._loop:
            return None
        frame: Array = self._poses[index % len(self._poses)]
        return frame


class Live:
    """Frames of a live Bullet simulation; needs pybullet.

    Args:
        scene_name: Shipped scene or YAML file; the simulation begins at its start.

    Raises:
        ImportError: pybullet is not installed.
    """

    def __init__(self, scene_name: str) -> None:
        from rigid_gns_core.teacher.bullet import Teacher
        from rigid_gns_core.teacher.settings import TeacherSettings

        scene, recipe = load_start(scene_name)
        start = sample_start(scene, recipe)
        self.dt = LIVE_DT * float(np.sqrt(np.max(scene.radius)))
        self.count = len(start)
        settings = TeacherSettings(substeps=LIVE_SUBSTEPS)
        self._teacher, self._index = Teacher(scene, start, self.dt, settings), 0

    def poses(self, index: int) -> Array | None:
        """Poses of frame `index`, shape (count, 7)."""
        while self._index < index:
            self._teacher.step()
            self._index += 1
        state = self._teacher.state
        return np.concatenate([state.positions, state.quaternions], axis=1)


class TrackerNode(ClosingNode):
    """Publishes noisy poses with stamps start + k * dt, each when the node's clock reaches it.

    Args:
        options: Passed on to `rclpy.node.Node`.

    Its executor's `spin` raises `Finished` after the last frame.

    Raises:
        UserError: A parameter cannot be used.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__('tracker', **options)
        values = declare(self, TRACKER)
        self._source = _source(values)
        self._noise = float(values['noise'])
        self._rng = np.random.default_rng(int(values['seed']))
        self._codec = PoseArrayCodec(str(values['frame_id']), self._source.count)
        self._pace = self._source.dt / float(values['rate_factor'])
        self._publisher = self.create_publisher(
            PoseArray, 'tracked_poses', sensor_data(), qos_overriding_options=overridable()
        )
        self._start_ns = 0
        self._index = self._published = 0
        self._alarm = Alarm(self, self._on_due)
        self._waits = waits = bool(values['wait_for_subscriber'])
        self.get_logger().info(
            f'ready: {self._source.count} spheres, {1 / self._pace:.6g} frames per second on '
            f'{self._publisher.topic_name}, noise {self._noise:g} m'
            + ('; waiting for a subscriber' if waits else '')
        )
        self._await = Alarm(self, self._on_wait)
        self._await.set(0)
        self._jump_handle = on_jump(self, self._on_jump)

    def close(self) -> None:
        """Stop publishing."""
        self._jump_handle.unregister()
        self._alarm.cancel()
        self._await.cancel()
        log_end(f'stopped: {self._published} frames published')

    def _on_wait(self) -> None:
        now = self._now()
        # a simulated clock stands at 0 until the first /clock
        if now and (self._publisher.get_subscription_count() or not self._waits):
            self._start_ns = now
            self.get_logger().info(f'started at stamp {seconds(now)} s')
            self._alarm.set(now)
        else:
            self._await.set(now + WAIT_PERIOD_NS)

    def _on_jump(self, _: int) -> None:
        """Continue with the present frame after a jump of simulated time."""
        if self._published:
            self._start_ns = self._now() - round(self._index * self._pace * 1e9)
            self._alarm.set(self._now())

    def _on_due(self) -> None:
        # a frame that is late by an interval or more is dropped, as by a camera
        due = int((self._now() - self._start_ns) * 1e-9 / self._pace)
        self._index = max(self._index, due)
        poses = self._source.poses(self._index)
        if poses is None:
            raise Finished
        poses = poses.copy()
        poses[:, :3] += self._rng.normal(0.0, self._noise, (len(poses), 3))
        stamp = self._start_ns + round(self._index * self._source.dt * 1e9)
        self._publisher.publish(self._codec.encode(poses, stamp))
        self._published += 1
        self._index += 1
        self._alarm.set(self._start_ns + round(self._index * self._pace * 1e9))

    def _now(self) -> int:
        return self.get_clock().now().nanoseconds


def _source(values: dict[str, Any]) -> Source:
    if values['live']:
        if values['trajectory']:
            raise UserError('live and trajectory are both given; give one')
        return Live(str(values['scene']))
    path = str(values['trajectory'])
    return Playback(read_record(path) if path else demo_record(), bool(values['loop']))
