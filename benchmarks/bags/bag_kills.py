# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a bag still holds after its recorder was killed at a random time.

    python benchmarks/bags/bag_kills.py --kills 100 --node-kills 10 \
        --json docs/model/bag_kills.json

A process records what the simulator records, 154 spheres at 100 Hz, and gets SIGKILL at a random
moment; every second one splits its bag. Loss is the time from the last message read back to the
last one handed to the writer, which the process notes in a file that a kill leaves alone. With
--node-kills the real nodes are killed too; there the loss is told by the clock at the kill, which
also counts the wait for a next message (0.1 s).
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
import json
import mmap
import os
from pathlib import Path
import signal
import struct
import subprocess
import sys
import tempfile
import time

import numpy as np
from rigid_gns_core.bags.reader import read_bag
from rigid_gns_core.bags.writer import BagWriter, FLUSH_PERIOD
from rigid_gns_core.errors import UserError
from rigid_gns_core.messages.poses import encode_float64, encode_string, PoseArrayCodec
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.running.machine import cpu_name
from rigid_gns_core.scenes.scene_file import load_scene

SPHERES, RATE = 154, 100.0  # [Hz]
LONGEST = 6.0  # a kill comes at most so long after the recording began [s]
SPLIT_MB = 1.0
BOUND = 1.0  # what may be lost [s]
AT_ONCE = 4
POSE_ARRAY = 'geometry_msgs/msg/PoseArray'
NOTE = struct.Struct('<qq')  # messages handed over on the slowest topic, time of the last [ns]


@dataclass
class Kill:
    """Result of one kill; `loss_s` is None where no message had been passed to the writer."""

    after_s: float
    split: bool
    read: bool
    files: int = 0
    written: int = 0
    messages: int = 0
    loss_s: float | None = None
    whole_bytes: bool = True
    evaluated: bool | None = None
    error: str = ''


def poses(number: int) -> np.ndarray:
    """Spheres in flight, with different poses in every message, shape (SPHERES, 7)."""
    found = np.zeros((SPHERES, 7))
    found[:, 0], found[:, 6] = 3.0 * np.arange(SPHERES), 1.0
    found[:, 1], found[:, 2] = 0.01 * number, 1e4 - 4.905 * (number / RATE) ** 2
    return found


def record(folder: Path, notes: Path, split: float) -> None:
    """Record until killed, in files of so many MB; 0: in one."""
    codec, scene = PoseArrayCodec('world', SPHERES), load_scene('box_154')
    said = {
        'scene': scene.to_mapping(),
        'model': 'laws',
        'model_card': load_simulator('laws').card,
        'dt': 1 / RATE,
        'parameters': {'start': 'first'},
    }
    with open(notes, 'r+b') as file:
        note = mmap.mmap(file.fileno(), NOTE.size)
    bag = BagWriter(folder, max_size=split)
    bag.add_topic('/tracked_poses', POSE_ARRAY, 'sensor_data')
    bag.add_topic('/predicted_poses', POSE_ARRAY, 'reliable')
    bag.add_topic('/simulator/scene', 'std_msgs/msg/String', 'latched')
    bag.add_topic('/simulator/step_time', 'std_msgs/msg/Float64', 'reliable')
    bag.write('/simulator/scene', encode_string(json.dumps(said)), time.time_ns())
    begin = time.monotonic()
    origin = time.time_ns()
    for number in range(10**9):
        time.sleep(max(0.0, begin + number / RATE - time.monotonic()))
        cdr = codec.encode(poses(number), origin + round(number * 1e9 / RATE))
        now = time.time_ns()
        bag.write('/tracked_poses', cdr, now)
        bag.write('/simulator/step_time', encode_float64(float(number)), now)
        bag.write('/predicted_poses', cdr, now)
        note[:] = NOTE.pack(number + 1, now)


def kill_recorder(folder: Path, after: float, split: float) -> Kill:
    """Start a recorder, kill it after `after` [s], and read its bag; `split` as in `record`."""
    folder.mkdir()
    notes, bag = folder / 'notes', folder / 'bag'
    notes.write_bytes(bytes(NOTE.size))
    command = [sys.executable, __file__, '--recorder', str(bag), str(notes)]
    process = subprocess.Popen([*command, '--split', str(split)])
    while not bag.is_dir():
        if process.poll() is not None:
            raise SystemExit(f'a recorder ended with exit code {process.returncode}')
        time.sleep(0.001)
    time.sleep(after)
    process.send_signal(signal.SIGKILL)
    process.wait()
    written, last_ns = NOTE.unpack(notes.read_bytes())
    return look_at(bag, Kill(after, split > 0, False, written=written), last_ns)


def look_at(folder: Path, kill: Kill, last_ns: int) -> Kill:
    """Complete the result from a bag whose last message was passed to the writer at `last_ns`."""
    kill.files = len(list(folder.glob('*.mcap')))
    if not kill.files and not kill.written:
        kill.read = True  # killed before there was a file
        return kill
    try:
        bag = read_bag(folder)
    except UserError as error:
        kill.error = str(error).replace(str(folder), 'BAG')
        return kill
    kill.read = bool(bag.warnings)  # reading is wrong if it does not warn of the truncation
    topics = [bag.topics[name] for name in bag.topics if not name.endswith('/scene')]
    kill.messages = min((len(topic) for topic in topics), default=0)
    codec = PoseArrayCodec('world', SPHERES)
    tracked = bag.topics.get('/tracked_poses')
    if kill.written:
        ends = [int(topic.times[-1]) for topic in topics if len(topic)]
        begin = last_ns - int(kill.written * 1e9 / RATE)
        kill.loss_s = max(0.0, (last_ns - min(ends, default=begin)) * 1e-9)
    if tracked and len(tracked):
        stamp = codec_stamp(tracked.messages[0])
        kill.whole_bytes = all(
            message == codec.encode(poses(k), stamp + round(k * 1e9 / RATE))
            for k, message in enumerate(tracked.messages)
        )
    if kill.messages > 2:
        kill.evaluated = evaluates(folder)
    return kill


def codec_stamp(message: bytes) -> int:
    """Stamp of a PoseArray [ns]."""
    seconds, nanoseconds = struct.unpack_from('<iI', message, 4)
    return seconds * 10**9 + nanoseconds


def evaluates(folder: Path) -> bool:
    """Whether `evaluate` scores a truncated bag and notes the truncation."""
    # here: the recorder starts faster without
    from rigid_gns_core.recordings.scoring.evaluate import score_bag

    notes = score_bag(read_bag(folder)).report['notes']
    return any('did not finish' in note for note in notes)


def kill_node(folder: Path, after: float) -> Kill:
    """Kill the simulator node after `after` [s] of predictions."""
    from rigid_gns_ros.demo import node_environment, NodeProcess

    folder.mkdir()
    bag = folder / 'bag'
    environment = node_environment(folder)
    processes = [NodeProcess('simulator_node', folder, {'record': str(bag)}, environment)]
    try:
        processes[0].wait_for('ready', 600.0)  # a first run compiles the engine
        processes.append(NodeProcess('tracker_node', folder, {}, environment))
        processes[0].wait_for('started from', 60.0)
        time.sleep(after)
        last_ns = time.time_ns()
    finally:
        for process in processes:
            process.kill()
    kill = Kill(after, False, False, files=1)
    read = read_bag(bag)
    kill.read = bool(read.warnings)
    poses_topics = [read.topics['/tracked_poses'], read.topics['/predicted_poses']]
    kill.messages = min(map(len, poses_topics))
    last = max(int(topic.times[-1]) for topic in poses_topics if len(topic))
    kill.loss_s = (last_ns - last) * 1e-9
    kill.evaluated = evaluates(bag)
    return kill


def summary(kills: list[Kill]) -> dict[str, object]:
    """Statistics of all kills, and each of them."""
    losses = np.array([kill.loss_s for kill in kills if kill.loss_s is not None])
    late = [kill for kill in kills if kill.evaluated is not None]
    return {
        'kills': len(kills),
        'read': sum(kill.read for kill in kills),
        'whole_bytes': sum(kill.whole_bytes for kill in kills),
        'evaluated': sum(bool(kill.evaluated) for kill in late),
        'to_evaluate': len(late),
        'loss_s': {
            'worst': float(losses.max()),
            'p90': float(np.quantile(losses, 0.9)),
            'median': float(np.median(losses)),
        },
        'within_bound': int((losses <= BOUND).sum()),
        'with_loss_known': len(losses),
        'split': sum(kill.split for kill in kills),
        'files_most': max(kill.files for kill in kills),
        'errors': [kill.error for kill in kills if kill.error],
        'each': [asdict(kill) for kill in kills],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--kills', type=int, default=100)
    parser.add_argument('--node-kills', type=int, default=0, help='kills of the real node')
    parser.add_argument('--seed', type=int, default=0, help='of the moments')
    parser.add_argument('--json', type=Path, help='where to write all numbers')
    parser.add_argument('--recorder', nargs=2, type=Path, help=argparse.SUPPRESS)
    parser.add_argument('--split', type=float, default=0.0, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.recorder:
        record(*arguments.recorder, arguments.split)
        return 0
    rng = np.random.default_rng(arguments.seed)
    moments = rng.uniform(0.0, LONGEST, arguments.kills)
    report: dict[str, object] = {
        'command': ' '.join(['python benchmarks/bags/bag_kills.py', *sys.argv[1:]]),
        'machine': {'cpu': cpu_name(), 'cores': os.cpu_count(), 'load_before': os.getloadavg()[0]},
        'spheres': SPHERES,
        'rate_hz': RATE,
        'flush_period_s': FLUSH_PERIOD,
        'bound_s': BOUND,
        'at_once': AT_ONCE,
    }
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)

        def one(number: int) -> Kill:
            split = SPLIT_MB * (number % 2)
            return kill_recorder(folder / str(number), float(moments[number]), split)

        with ThreadPoolExecutor(AT_ONCE) as pool:
            report['recorder'] = summary(list(pool.map(one, range(arguments.kills))))
        waits = rng.uniform(1.5, LONGEST, arguments.node_kills)
        nodes = [kill_node(folder / f'node{k}', float(wait)) for k, wait in enumerate(waits)]
        if nodes:
            report['node'] = summary(nodes)
    report['machine']['load_after'] = os.getloadavg()[0]  # type: ignore[index]
    for name in ('recorder', 'node'):
        if name in report:
            shown = {k: v for k, v in report[name].items() if k != 'each'}
            print(name, json.dumps(shown, indent=2))
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=2) + '\n', encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
