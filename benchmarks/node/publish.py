# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What publishing a PoseArray costs: CDR bytes from one array, beside Python message objects.

    python benchmarks/node/publish.py --subscriber --json publish.json

Compared, in one run and in turns, per message: `bytes`, encode and publish as the simulator does;
`objects`, build a message of new Pose objects and publish it; `reused`, the best that objects can
do: write into the Pose objects of the message before. Each takes its turn in being the first after
a pause. Wall times hold what other processes take of a busy machine; CPU times are of the
publishing thread alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from importlib.metadata import version
import json
import os
from pathlib import Path
import platform
import subprocess
import sys
import time

from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rigid_gns_core.files.tables import format_rows, number
from rigid_gns_core.messages.poses import PoseArrayCodec
from rigid_gns_core.running.machine import cpu_name

TOPIC = 'benchmark_poses'
BOUND_MS = 0.2  # of 300 poses through bytes


def make_variants(publisher, count: int) -> dict[str, Callable[[np.ndarray, int], None]]:
    codec = PoseArrayCodec('world', count)
    kept = PoseArray()
    kept.header.frame_id = 'world'
    kept.poses = [Pose() for _ in range(count)]

    def through_bytes(poses: np.ndarray, stamp_ns: int) -> None:
        publisher.publish(codec.encode(poses, stamp_ns))

    def through_objects(poses: np.ndarray, stamp_ns: int) -> None:
        message = PoseArray()
        message.header.frame_id = 'world'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        message.poses = [
            Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
            for x, y, z, qx, qy, qz, qw in poses.tolist()
        ]
        publisher.publish(message)

    def through_reused_objects(poses: np.ndarray, stamp_ns: int) -> None:
        kept.header.stamp.sec, kept.header.stamp.nanosec = divmod(stamp_ns, 10**9)
        for pose, (x, y, z, qx, qy, qz, qw) in zip(kept.poses, poses.tolist(), strict=True):
            position, orientation = pose.position, pose.orientation
            position.x, position.y, position.z = x, y, z
            orientation.x, orientation.y, orientation.z, orientation.w = qx, qy, qz, qw
        publisher.publish(kept)

    return {'bytes': through_bytes, 'objects': through_objects, 'reused': through_reused_objects}


def measure(publisher, count: int, repeats: int) -> dict[str, dict[str, float]]:
    """Milliseconds per message of each variant, wall and CPU time."""
    poses = np.random.default_rng(0).normal(size=(20, count, 7))
    variants = make_variants(publisher, count)
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in variants}
    names = list(variants)
    for k in range(-12, repeats):  # the first twelve warm up
        for turn in range(len(names)):
            name = names[(k + turn) % len(names)]
            stamp_ns = time.time_ns()
            wall, cpu = time.perf_counter(), time.thread_time()
            variants[name](poses[k % len(poses)], stamp_ns)
            cpu, wall = time.thread_time() - cpu, time.perf_counter() - wall
            if k >= 0:
                times[name].append((1e3 * wall, 1e3 * cpu))
        time.sleep(0.001)  # a subscriber keeps up
    report = {}
    for name, values in times.items():
        wall, cpu = np.array(values).T
        low, median, high = (float(q) for q in np.quantile(wall, [0.1, 0.5, 0.9]))
        report[name] = {
            'median_ms': median,
            'p10_ms': low,
            'p90_ms': high,
            'max_ms': float(wall.max()),
            'cpu_median_ms': float(np.median(cpu)),
        }
    return report


def listen() -> int:
    """Subscribe: take bytes and do nothing, until the parent ends it."""
    rclpy.init()
    node = Node('publish_benchmark_listener')
    node.create_subscription(PoseArray, TOPIC, lambda _: None, 10, raw=True)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


def wait_for_subscriber(publisher) -> None:
    until = time.monotonic() + 15.0
    while publisher.get_subscription_count() == 0:
        if time.monotonic() > until:
            raise SystemExit('publish.py: no subscriber appeared within 15 s')
        time.sleep(0.05)


def machine() -> dict[str, str]:
    return {
        'cpu': cpu_name(),
        'cores': str(os.cpu_count()),
        'load': f'{os.getloadavg()[0]:.1f}',
        'python': platform.python_version(),
        'numpy': version('numpy'),
        'rclpy': version('rclpy'),
        'rmw': rclpy.get_rmw_implementation_identifier(),
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument('--counts', type=int, nargs='+', default=[10, 154, 300, 1000])
    parser.add_argument('--repeats', type=int, default=300, help='messages per variant and count')
    parser.add_argument('--subscriber', action='store_true', help='with one, in its own process')
    parser.add_argument('--json', type=Path)
    parser.add_argument('--listen', action='store_true', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    if arguments.listen:
        return listen()
    child = None
    if arguments.subscriber:
        child = subprocess.Popen([sys.executable, __file__, '--listen'])
    rclpy.init()
    node = Node('publish_benchmark')
    try:
        publisher = node.create_publisher(PoseArray, TOPIC, 10)
        if child:
            wait_for_subscriber(publisher)
        results = {n: measure(publisher, n, arguments.repeats) for n in arguments.counts}
        report = {'machine': machine(), 'subscriber': bool(child), 'results': results}
    finally:
        if child:
            child.terminate()
            child.wait(timeout=10)
        node.destroy_node()
        rclpy.try_shutdown()
    print(', '.join(f'{key} {value}' for key, value in report['machine'].items()))
    with_or_without = 'with' if child else 'without'
    print(f'{with_or_without} a subscriber; wall median (10 to 90 %), CPU median [ms] per message')
    rows = []
    for count, row in results.items():
        cells = [
            '{} ({} to {}), {}'.format(
                *(number(v[key]) for key in ('median_ms', 'p10_ms', 'p90_ms', 'cpu_median_ms'))
            )
            for v in row.values()
        ]
        rows.append([str(count), *cells])
    print(format_rows(['poses', 'bytes', 'objects', 'reused'], rows, left=()))
    if 300 in results:
        median = results[300]['bytes']['median_ms']
        verdict = 'within' if median < BOUND_MS else 'OVER'
        print(f'300 poses through bytes: {median:.3f} ms, {verdict} the bound of {BOUND_MS} ms')
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=2) + '\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())
