# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Peers of the simulator, a process each: a tracker that plays poses, and a listener.

    python benchmarks/node/peers.py play POSES.npy --dt 0.1 --noise 0.005 --out sent.npy
    python benchmarks/node/peers.py listen --out heard.npz

Both end at SIGINT or SIGTERM and then write what they noted. Times are of the monotonic clock,
which all processes of a machine share, and of the system's, which is the node's [ns].
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
from pathlib import Path
import signal
import struct
import sys
import time
from typing import Any

from geometry_msgs.msg import PoseArray
import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rigid_gns_core.messages.poses import decode_string, PoseArrayCodec
from std_msgs.msg import String
from trajectory_msgs.msg import MultiDOFJointTrajectory

TOPICS = {
    'predicted_poses': PoseArray,
    'predicted_trajectory': MultiDOFJointTrajectory,
    'simulator/crossings': String,
}
SETTLE = 0.5  # from discovery to the first frame: the node's side may discover later [s]
LEAD = 0.2  # from there to the first frame's stamp [s]
STEP = 0.05  # longest sleep, after which the end is looked for [s]


class Ending:
    """Whether SIGINT or SIGTERM has come."""

    def __init__(self) -> None:
        self.asked = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)

    def _ask(self, *_: Any) -> None:
        self.asked = True


def frame_of(cdr: bytes) -> int:
    """Stamp of the frame that a message on ~/crossings is of [ns]."""
    return int(json.loads(decode_string(cdr))['stamp_ns'])


def stamp_of(cdr: bytes) -> int:
    """Stamp of a little-endian message that begins with a header [ns]."""
    seconds, nanoseconds = struct.unpack_from('<iI', cdr, 4)
    return seconds * 10**9 + nanoseconds


def there_and_back(number: int, frames: int) -> int:
    """Index of the frame to play: forward and backward, so that no sphere jumps."""
    turn = max(2 * (frames - 1), 1)
    place = number % turn
    return min(place, turn - place)


def play(
    poses: np.ndarray,
    dt: float,
    noise: float,
    seed: int,
    ending: Ending,
    *,
    each: int = 0,
    pause: float = 0.0,
) -> np.ndarray:
    """Publish a frame each `dt` [s] until the end, each when the system's clock reaches its stamp.

    After `each` frames, unless that is 0, nothing comes for `pause` [s].

    Returns:
        Stamp and monotonic time just before publishing [ns], int64, shape (frames sent, 2).
    """
    node = Node('tracker')
    publisher = node.create_publisher(PoseArray, 'tracked_poses', qos_profile_sensor_data)
    codec, rng = PoseArrayCodec('world', poses.shape[1]), np.random.default_rng(seed)
    while not publisher.get_subscription_count() and not ending.asked:
        time.sleep(STEP)
    time.sleep(SETTLE)
    print('ready', flush=True)
    origin = time.time_ns() + round(LEAD * 1e9)
    sent: list[tuple[int, int]] = []
    while not ending.asked:
        number = len(sent)
        late = pause * (number // each) if each else 0.0
        stamp = origin + round((number * dt + late) * 1e9)
        shown = poses[there_and_back(number, len(poses))].copy()
        shown[:, :3] += rng.normal(0.0, noise, (len(shown), 3))
        cdr = codec.encode(shown, stamp)
        while (wait := (stamp - time.time_ns()) * 1e-9) > 0 and not ending.asked:
            time.sleep(min(wait, STEP))
        sent.append((stamp, time.monotonic_ns()))
        publisher.publish(cdr)
    return np.array(sent, dtype=np.int64).reshape(-1, 2)


def listen(ending: Ending) -> dict[str, np.ndarray]:
    """Note each message until the end.

    Returns:
        By topic: stamp, system time and monotonic time of arrival [ns], and size [bytes], int64,
        shape (messages, 4).
    """
    node = Node('listener')
    heard: dict[str, list[tuple[int, int, int, int]]] = {name: [] for name in TOPICS}
    # the queue is long enough for a listener that is held up for a second
    subscriptions = [
        node.create_subscription(
            kind,
            name,
            _note(heard[name], frame_of if kind is String else stamp_of),
            QoSProfile(depth=100),
            raw=True,
        )
        for name, kind in TOPICS.items()
    ]
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not all(s.get_publisher_count() for s in subscriptions) and not ending.asked:
        executor.spin_once(timeout_sec=STEP)
    print('ready', flush=True)
    while not ending.asked:
        executor.spin_once(timeout_sec=STEP)
    return {name: np.array(rows, dtype=np.int64).reshape(-1, 4) for name, rows in heard.items()}


def _note(rows: list[tuple[int, int, int, int]], stamp: Callable[[bytes], int]) -> Any:
    def take(cdr: bytes) -> None:
        monotonic, system = time.monotonic_ns(), time.time_ns()
        rows.append((stamp(cdr), system, monotonic, len(cdr)))

    return take


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    roles = parser.add_subparsers(dest='role', required=True)
    player = roles.add_parser('play', help='publish poses as a tracker does')
    player.add_argument('poses', type=Path, help='.npy, shape (frames, n, 7)')
    player.add_argument('--dt', type=float, required=True, help='time between frames [s]')
    player.add_argument('--noise', type=float, default=0.0, help='of each coordinate [m]')
    player.add_argument('--seed', type=int, default=0, help='of the noise')
    player.add_argument('--each', type=int, default=0, help='frames of a throw; 0: no pauses')
    player.add_argument('--pause', type=float, default=0.0, help='after a throw [s]')
    listener = roles.add_parser('listen', help='note what is published')
    for role in (player, listener):
        role.add_argument('--out', type=Path, required=True, help='what to write at the end')
    arguments = parser.parse_args()
    ending = Ending()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    if arguments.role == 'listen':
        np.savez(arguments.out, **listen(ending))
    else:
        poses = np.load(arguments.poses)
        sent = play(
            poses,
            arguments.dt,
            arguments.noise,
            arguments.seed,
            ending,
            each=arguments.each,
            pause=arguments.pause,
        )
        np.save(arguments.out, sent)
    rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
