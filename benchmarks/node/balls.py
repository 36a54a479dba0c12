# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tracked balls through the node: errors of its futures beside those of `evaluate`.

    python benchmarks/node/balls.py --data data/test --scene lab.yaml --json balls.json

`--data` is imported from tracks of one ball each. They are played in real time to a simulator of
its own process, positions only, and each published future is compared with the frames that came
after: those of which `rigid-gns evaluate --every` makes forecasts from the same frames.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import os
from pathlib import Path
import sys
import tempfile
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rigid_gns_core import load_scene, load_simulator, Scene
from rigid_gns_core.data.tracks import read_tracks, Track, TrackSet
from rigid_gns_core.files.strict_json import write_json
from rigid_gns_core.files.tables import format_rows, number
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_core.messages.trajectories import decode_trajectory, FutureFrame
from rigid_gns_core.recordings.scoring.track_errors import Outcome, track_outcomes, Windows
from rigid_gns_core.rollout.paths import Paths
from rigid_gns_ros.demo import node_environment
from run import COMPILING, LEAST_STARTED, Process

# time between two tracks, longer than any gap that is fitted together [s]
PAUSE = 1.5
START = 1_000_000_000_000  # stamp of the first track's begin on a clock of its own [ns]


class Player(Node):
    """Publishes tracks, and keeps the futures that come back by their stamps."""

    def __init__(self) -> None:
        super().__init__('player')
        from geometry_msgs.msg import PoseArray
        from trajectory_msgs.msg import MultiDOFJointTrajectory

        self.futures: dict[int, FutureFrame] = {}
        self.delays: list[float] = []
        self._sent: dict[int, float] = {}
        self.publisher = self.create_publisher(PoseArray, 'tracked_poses', qos_profile_sensor_data)
        kind = MultiDOFJointTrajectory
        self.create_subscription(kind, 'predicted_trajectory', self._heard, 100, raw=True)

    def _heard(self, cdr: bytes) -> None:
        future = decode_trajectory(cdr)
        self.futures[future.stamp_ns] = future
        self.delays.append(time.monotonic() - self._sent[future.stamp_ns])

    def play(self, track: Track, begin_ns: int) -> None:
        """Publish the frames of a track when they are due."""
        codec, begun = PoseArrayCodec('world', 1), time.monotonic()
        for moment, place in zip(track.times.tolist(), track.positions[:, 0], strict=True):
            while (left := begun + moment - time.monotonic()) > 0:
                rclpy.spin_once(self, timeout_sec=left)
            stamp = begin_ns + round(moment * 1e9)
            pose = np.concatenate([place, [0.0, 0.0, 0.0, 1.0]])[None]
            self._sent[stamp] = time.monotonic()
            self.publisher.publish(codec.encode(pose, stamp))

    def listen(self, seconds: float) -> None:
        """Take what comes for so long [s]."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            rclpy.spin_once(self, timeout_sec=left)


def play(found: TrackSet, scene: Path, horizon: float, folder: Path) -> tuple[Player, float]:
    """Play all tracks to a simulator; what was heard, and the node's share of a core."""
    environment = node_environment(folder)
    settings = {'scene': scene, 'horizon': horizon, 'start': 'every'}
    words = [w for name, value in settings.items() for w in ('-p', f'{name}:={value}')]
    module = ['-m', 'rigid_gns_ros.simulator_node', '--ros-args', *words]
    simulator = Process('simulator', module, folder, environment)
    try:
        simulator.wait_for('ready: ', COMPILING)
        os.environ.update(environment)
        rclpy.init()
        player = Player()
        end = time.monotonic() + LEAST_STARTED
        while not player.publisher.get_subscription_count() and time.monotonic() < end:
            rclpy.spin_once(player, timeout_sec=0.05)
        begun, spent = time.monotonic(), simulator.processor_time
        clock = START
        for track in found.tracks:
            player.play(track, clock)
            player.listen(PAUSE)
            clock += round((float(track.times[-1]) + PAUSE) * 1e9)
        share = (simulator.processor_time - spent) / (time.monotonic() - begun)
        simulator.stop()
    finally:
        simulator.kill()
    return player, share


def begins(found: TrackSet) -> Iterator[tuple[Track, int]]:
    """Each track and the stamp at which it began [ns]."""
    clock = START
    for track in found.tracks:
        yield track, clock
        clock += round((float(track.times[-1]) + PAUSE) * 1e9)


def errors_of_node(
    found: TrackSet, futures: dict[int, FutureFrame], outcomes: list[Outcome], scene: Scene
) -> np.ndarray:
    """Error of the node's future for each outcome of `evaluate` [m]; NaN where it made none."""
    at = {track.name: (track, begin) for track, begin in begins(found)}
    errors = []
    for one in outcomes:
        track, begin = at[one.track]
        future = futures.get(begin + round(one.start * 1e9))
        if future is None:
            errors.append(np.nan)
            continue
        times = np.array(future.times_ns) * 1e-9
        states: Any = SimpleNamespace(
            positions=future.poses[None, ..., :3],
            velocities=future.twists[None, ..., :3],
            angular_velocities=future.twists[None, ..., 3:],
        )
        run = Paths.of(scene, states, float(times[-1] / (len(times) - 1)), exact=True)
        place = run.at(np.array([one.lead]))[0][0, 0, 0]
        frame = int(np.abs(track.times - one.start - one.lead).argmin())
        errors.append(float(np.linalg.norm(place - track.positions[frame, 0])))
    return np.array(errors)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--data', required=True, help='folder made by rigid-gns import')
    parser.add_argument('--scene', required=True, type=Path, help='scene of the node')
    parser.add_argument('--window', type=float, default=0.2, help='before the first start [s]')
    parser.add_argument('--every', type=float, default=0.1, help='between starts compared [s]')
    parser.add_argument('--horizons', type=float, nargs='+', default=[0.2, 0.4])
    parser.add_argument('--json', type=Path, metavar='FILE')
    args = parser.parse_args()
    found, scene = read_tracks(args.data), load_scene(str(args.scene))
    horizons = tuple(sorted(args.horizons))
    windows = Windows(window=args.window, horizons=horizons, every=args.every, samples=0)
    outcomes = track_outcomes(load_simulator(), found, scene, windows)
    with tempfile.TemporaryDirectory() as folder:
        player, share = play(found, args.scene.resolve(), horizons[-1] + 0.05, Path(folder))
    errors = errors_of_node(found, player.futures, outcomes, scene)
    rows, report = [], {}
    for horizon in horizons:
        own = np.array([one.horizon == horizon for one in outcomes]) & np.isfinite(errors)
        offline = np.array([one.error for one in outcomes])[own]
        values = {
            'n': int(own.sum()),
            'node_mean_m': float(errors[own].mean()),
            'evaluate_mean_m': float(offline.mean()),
            'largest_difference_m': float(np.abs(errors[own] - offline).max()),
        }
        report[f'{horizon:g}'] = values
        shown = [number(100 * value, 4) for value in list(values.values())[1:]]
        rows.append([f'after {horizon:g} s', str(values['n']), *shown])
    head = ['mean error [cm]', 'n', 'node', 'evaluate', 'largest difference']
    print(format_rows(head, rows))
    delays = 1e3 * np.array(player.delays)
    late = [number(value, 3) for value in np.percentile(delays, [50, 99])]
    print(f'{len(delays)} futures, heard after {late[0]} ms, 99 % {late[1]} ms; {share:.0%} core')
    if args.json is not None:
        delay = {'p50_ms': float(np.median(delays)), 'p99_ms': float(np.percentile(delays, 99))}
        write_json(args.json, {'horizons': report, 'heard_after': delay, 'core': share})
    return 0


if __name__ == '__main__':
    sys.exit(main())
