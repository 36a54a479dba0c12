# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""A tracker that goes wrong in the middle, as a process.

    python benchmarks/node/faulty_tracker.py FAULT --seconds 8 --seed 0 --out sent.json

For a quarter of the time its frames are right, then for half of it they have the fault, then they
are right again. Ends by itself, and writes how many messages it sent, the stamp and the true time
of each frame, and what the node said of them on /diagnostics.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import json
from pathlib import Path
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseArray
from motion import NOISE, poses_at
import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rigid_gns_core.messages.poses import PoseArrayCodec
from rosgraph_msgs.msg import Clock

RATE = 120.0  # [Hz]
SETTLE = 1.0  # from discovery to the first frame [s]
COUNTED = 2.5  # until diagnostics, once a second, have counted the last frame [s]
Frame = tuple[float, int, np.ndarray, str]  # true time [s], stamp [ns], poses, frame_id


class Faults:
    """What becomes of a frame: what is sent in its place, at its time.

    Args:
        fault: Which one.
        rng: Draws.
        origin: Stamp at true time 0 [ns].
    """

    def __init__(self, fault: str, rng: np.random.Generator, origin: int) -> None:
        self._fault, self._rng, self._origin = fault, rng, origin
        self._held: list[Frame] = []

    def sent(self, true: float, *, faulty: bool, share: float) -> Iterator[Frame]:
        """Frames in the place of that of a true time [s]; `share` of the faulty part is over."""
        poses = poses_at(np.array([true]))[0]
        poses[:, :3] += self._rng.normal(0.0, NOISE, (len(poses), 3))
        frame = true, self._origin + round(true * 1e9), poses, 'world'
        if not faulty:
            yield from self._held
            self._held.clear()
            yield frame
            return
        yield from getattr(self, '_' + self._fault.replace(' ', '_'))(frame, share)

    def _nothing(self, frame: Frame, _: float) -> Iterator[Frame]:
        yield frame

    def _lost_frames(self, frame: Frame, _: float) -> Iterator[Frame]:
        """Three of ten are lost."""
        if self._rng.random() > 0.3:
            yield frame

    def _tracker_gone(self, _: Frame, __: float) -> Iterator[Frame]:
        yield from ()

    def _late_frames(self, frame: Frame, _: float) -> Iterator[Frame]:
        """Held back, and sent three to five at a time in any order."""
        self._held.append(frame)
        if len(self._held) >= self._rng.integers(3, 6):
            for index in self._rng.permutation(len(self._held)):
                yield self._held[index]
            self._held.clear()

    def _NaN_mixed_in(self, frame: Frame, _: float) -> Iterator[Frame]:
        """NaN, infinities, zeros and huge numbers in a pose, in a number, or in all poses."""
        true, stamp, poses, name = frame
        if self._rng.random() < 0.5:
            value = self._rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e30])
            sphere, how = int(self._rng.integers(len(poses))), int(self._rng.integers(3))
            if how == 0:
                poses[sphere] = value
            elif how == 1:
                poses[sphere, int(self._rng.integers(7))] = value if value else np.nan
            else:
                poses[:] = value
        yield true, stamp, poses, name

    def _flood(self, frame: Frame, _: float) -> Iterator[Frame]:
        """Twenty messages instead of one: the frame again, others' frames, thousands of poses."""
        true, stamp, poses, name = frame
        yield frame
        for k in range(19):
            if k % 3 == 0:
                yield frame
            elif k % 3 == 1:
                yield true, stamp + 1, poses, 'camera'
            else:
                yield true, stamp + 1, np.tile(poses[0], (2000, 1)), name

    def _stamps_ahead(self, frame: Frame, _: float) -> Iterator[Frame]:
        """The tracker's clock is 3 s ahead."""
        true, stamp, poses, name = frame
        yield true, stamp + 3 * 10**9, poses, name

    def _stamps_back(self, frame: Frame, _: float) -> Iterator[Frame]:
        """The tracker's clock is 0.5 s behind."""
        true, stamp, poses, name = frame
        yield true, stamp - 5 * 10**8, poses, name

    def _clock_ahead(self, frame: Frame, _: float) -> Iterator[Frame]:
        """The clock of all is 10 s ahead."""
        true, stamp, poses, name = frame
        yield true, stamp + 10**10, poses, name

    def _clock_back(self, frame: Frame, _: float) -> Iterator[Frame]:
        """The clock of all is 5 s behind."""
        true, stamp, poses, name = frame
        yield true, stamp - 5 * 10**9, poses, name


def listen(node: Node, ended: threading.Event) -> None:
    """Take what the node says until the end."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not ended.is_set():
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()


def play(fault: str, seconds: float, seed: int) -> dict[str, object]:
    """Publish frames in real time; what was sent."""
    node = Node('tracker')
    publisher = node.create_publisher(PoseArray, 'tracked_poses', qos_profile_sensor_data)
    told: list[bytes] = []
    node.create_subscription(DiagnosticArray, '/diagnostics', told.append, 10, raw=True)
    heard: list[float] = []  # times of predictions [s]
    node.create_subscription(
        PoseArray, 'predicted_poses', lambda _: heard.append(time.monotonic()), 10, raw=True
    )
    ended = threading.Event()
    listener = threading.Thread(target=listen, args=(node, ended))
    listener.start()
    clock = node.create_publisher(Clock, '/clock', 10) if fault.startswith('clock') else None
    while not publisher.get_subscription_count():
        time.sleep(0.05)
    while clock is not None and not clock.get_subscription_count():
        time.sleep(0.05)
    time.sleep(SETTLE)
    begin = time.monotonic()
    origin = 20 * 10**9 if clock else time.time_ns()
    faults = Faults(fault, np.random.default_rng(seed), origin)
    messages, rows = 0, []
    frames = round(seconds * RATE)
    for k in range(frames):
        true, share = k / RATE, (k / frames - 0.25) / 0.5
        time.sleep(max(0.0, begin + true - time.monotonic()))
        faulty = 0.0 <= share < 1.0
        for at, stamp, poses, name in faults.sent(true, faulty=faulty, share=share):
            if clock is not None:
                message = Clock()
                message.clock.sec, message.clock.nanosec = divmod(stamp, 10**9)
                clock.publish(message)
            publisher.publish(PoseArrayCodec(name, len(poses)).encode(poses, stamp))
            messages += 1
            rows.append((stamp, at))
    time.sleep(COUNTED)
    ended.set()
    listener.join()
    return {
        'messages': messages,
        'frames': rows,
        'diagnostics': [message.hex() for message in told],
        'heard_after': sum(at > begin + 0.75 * seconds for at in heard),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('fault')
    parser.add_argument('--seconds', type=float, required=True)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--out', type=Path, required=True)
    arguments = parser.parse_args()
    rclpy.init()
    sent = play(arguments.fault, arguments.seconds, arguments.seed)
    arguments.out.write_text(json.dumps(sent), encoding='utf-8')
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
