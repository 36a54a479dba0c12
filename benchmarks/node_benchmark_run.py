"""One run of the simulator node between a tracker and a listener, each a process of its own."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from mcap.records import Channel, Message
from node_benchmark_peers import stamp_of

from rigid_gns_core.benchmark.busy_core import busy_core
from rigid_gns_core.benchmark.machine import load_average
from rigid_gns_core.rollout import load_simulator
from rigid_gns_core.sampling import StartRecipe, sample_start
from rigid_gns_core.scene import Scene
from rigid_gns_ros.demo import NodeProcess, node_environment
from rigid_gns_ros.messages import decode_float64
from rigid_gns_ros.recording.mcap_records import read_records

PEERS = Path(__file__).with_name('node_benchmark_peers.py')
NOISE = 5e-3  # of each tracked coordinate [radii]: 0.1 mm on a sphere of 20 mm
PLAYED = 300  # model steps of motion that the tracker plays there and back
COMPILING = 600.0  # a first run compiles the engine [s]
LEAST_STARTED = 30.0  # for discovery and the first frames [s]
POLL = 0.1  # [s]
COUNTS = re.compile(r'stopped: (\d+) published, (\d+) late, (\d+) skipped, (\d+) rejected')


@dataclass(frozen=True)
class Case:
    """What is run.

    Args:
        name: As in the table.
        spheres: Number of spheres.
        radius: [m].
        stride: Model steps per tracked frame.
        parameters: Of the simulator, besides its scene.
        record: Whether the simulator records.
        busy: Whether another process keeps one core busy.
        seed: Of places and noise.
    """

    name: str
    spheres: int
    radius: float
    stride: int
    parameters: Mapping[str, str]
    record: bool = True
    busy: bool = False
    seed: int = 0

    @property
    def scene(self) -> Scene:
        """A box in which all spheres fit side by side three times over, open above."""
        side = self._side
        return Scene.from_mapping(
            {
                'box': {'length_x': side, 'length_y': side},
                'radius': self.radius,
                'mass': self.radius**3,
                'restitution': 0.7746,
                'friction': 0.5,
                'rolling_friction': 0.03,
            }
        )

    @property
    def recipe(self) -> StartRecipe:
        """Spheres in the air that fall for some time one after the other, and collide."""
        return StartRecipe(
            spheres=self.spheres,
            height=(2 * self.radius, 60 * self.radius),
            gap=0.1 * self.radius,
            seed=self.seed,
        )

    @property
    def _side(self) -> float:
        return float(2 * self.radius * np.sqrt(3 * self.spheres))


@dataclass(frozen=True)
class Recorded:
    """Predictions in the bag.

    Args:
        stamps: Sorted [ns], int64.
        lateness: Log time less stamp of each [s].
        step_times: Of the model [s].
        files: Number of files.
        warnings: What is wrong with the bag.
    """

    stamps: np.ndarray
    lateness: np.ndarray
    step_times: np.ndarray
    files: int
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What a run left.

    Args:
        period: Of predictions [s].
        tracked_dt: Time between tracked frames [s].
        sent: See `node_benchmark_peers.play`.
        heard: See `node_benchmark_peers.listen`.
        counts: The node's own: published, late, skipped, rejected.
        recorded: The bag; None: nothing was recorded.
        memory: Seconds since the start and resident bytes of the simulator, shape (samples, 2).
        errors: Lines of its log.
        warnings: Number of warnings in its log.
        load: Load average before and after.
    """

    period: float
    tracked_dt: float
    sent: np.ndarray
    heard: dict[str, np.ndarray]
    counts: dict[str, int]
    recorded: Recorded | None
    memory: np.ndarray
    errors: tuple[str, ...]
    warnings: int
    load: dict[str, Any]


class Process(NodeProcess):
    """A process by its command line, started and stopped as a node of the demonstration.

    Args:
        name: Of its log.
        command: What to run.
        folder: Where its log goes.
        environment: Environment variables.
    """

    def __init__(
        self, name: str, command: list[str], folder: Path, environment: dict[str, str]
    ) -> None:
        self.name, self.log = name, folder / f'{name}.log'
        with self.log.open('wb') as log:
            # a session of its own: Ctrl-C must reach the benchmark only, which then stops it
            self._process = subprocess.Popen(
                [sys.executable, *command],
                stdout=log,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,
            )

    @property
    def resident(self) -> int:
        """Memory [bytes]; 0 where there is no /proc."""
        try:
            lines = Path(f'/proc/{self._process.pid}/status').read_text().splitlines()
        except OSError:
            return 0
        return sum(1024 * int(line.split()[1]) for line in lines if line.startswith('VmRSS:'))


def run(
    case: Case, seconds: float, folder: Path, watch: Callable[[float, int], None] | None = None
) -> Outcome:
    """Run a case for `seconds` from the node's start on.

    Args:
        case: What to run.
        seconds: How long [s].
        folder: Empty folder for scene, poses, bag and logs.
        watch: Called once a second with the time since the start [s] and the simulator's memory.

    Raises:
        DemoError: A process failed, or did not stop by itself.
    """
    environment = node_environment(folder)
    poses, dt, period = _prepare(case, folder)
    arguments = {'scene': str(folder / 'scene.yaml'), **case.parameters}
    if case.record:
        arguments['record'] = str(folder / 'bag')
    before = load_average()
    processes: list[Process] = []

    def start(name: str, *command: str) -> Process:
        processes.append(Process(name, list(command), folder, environment))
        return processes[-1]

    with busy_core() if case.busy else nullcontext():
        try:
            words = [w for item in arguments.items() for w in ('-p', f'{item[0]}:={item[1]}')]
            simulator = start('simulator', '-m', 'rigid_gns_ros.simulator_node', '--ros-args', *words)
            simulator.wait_for('ready: ', COMPILING)
            listener = start('listener', str(PEERS), 'listen', '--out', str(folder / 'heard.npz'))
            listener.wait_for('ready', LEAST_STARTED)
            noise = NOISE * case.radius
            player = ('play', str(poses), '--dt', repr(dt), '--noise', repr(noise))
            player += ('--seed', str(case.seed), '--out', str(folder / 'sent.npy'))
            start('tracker', str(PEERS), *player)
            simulator.wait_for('started from stamp', LEAST_STARTED)
            memory = _wait(processes, simulator, seconds, watch)
            for process in processes:  # the simulator first: it then never waits for frames
                process.stop()
        finally:
            for process in processes:
                process.kill()
    log = simulator.log.read_text(errors='replace')
    errors = ('[ERROR]', '[FATAL]', 'Traceback')
    with np.load(folder / 'heard.npz') as heard:
        return Outcome(
            period=float(case.parameters.get('rate', 0.0)) ** -1 if 'rate' in case.parameters else period,
            tracked_dt=dt,
            sent=np.load(folder / 'sent.npy'),
            heard={name: heard[name] for name in heard.files},
            counts=_counts(log),
            recorded=_recorded(folder / 'bag') if case.record else None,
            memory=memory,
            errors=tuple(line for line in log.splitlines() if any(e in line for e in errors)),
            warnings=log.count('[WARN]'),
            load={'before': before, 'after': load_average()},
        )


def _prepare(case: Case, folder: Path) -> tuple[Path, float, float]:
    """Write scene and poses; the file of poses, time between its frames and model step [s]."""
    scene, simulator = case.scene, load_simulator()
    text = yaml.safe_dump({'scene': scene.to_mapping()}).replace("'inf'", '.inf')
    (folder / 'scene.yaml').write_text(text, encoding='utf-8')
    start = sample_start(scene, case.recipe)
    trajectory = simulator.rollout(scene, start.positions, steps=PLAYED)
    if trajectory.diverged_at is not None:
        raise RuntimeError(f'{case.name}: the rollout that the tracker plays diverged')
    poses = np.concatenate([trajectory.positions, trajectory.quaternions], axis=2)
    path = folder / 'poses.npy'
    np.save(path, poses[:: case.stride])
    return path, case.stride * trajectory.dt, trajectory.dt


def _wait(
    processes: list[Process],
    simulator: Process,
    seconds: float,
    watch: Callable[[float, int], None] | None,
) -> np.ndarray:
    """Wait, and look at the simulator's memory each second."""
    begun = time.monotonic()
    samples: list[tuple[float, int]] = []
    while (passed := time.monotonic() - begun) < seconds:
        for process in processes:
            process.check()
        if passed >= len(samples):
            samples.append((passed, simulator.resident))
            if watch is not None:
                watch(*samples[-1])
        time.sleep(min(POLL, seconds))
    return np.array(samples, dtype=np.float64).reshape(-1, 2)


def _counts(log: str) -> dict[str, int]:
    found = COUNTS.search(log)
    if found is None:
        raise RuntimeError('the log of the simulator does not end with its counts')
    names = ('published', 'late', 'skipped', 'rejected')
    return dict(zip(names, map(int, found.groups()), strict=True))


def _recorded(folder: Path) -> Recorded:
    """Read message by message: the bag of half an hour need not fit into memory."""
    information = yaml.safe_load((folder / 'metadata.yaml').read_text(encoding='utf-8'))
    files = information['rosbag2_bagfile_information']['relative_file_paths']
    warnings: list[str] = []
    predicted: list[tuple[int, int]] = []
    step_times: list[float] = []
    for file in files:
        topics: dict[int, str] = {}
        for record in read_records(folder / file, warnings):
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message):
                topic = topics[record.channel_id]
                if topic == '/predicted_poses':
                    predicted.append((stamp_of(record.data), record.log_time))
                elif topic == '/simulator/step_time':
                    step_times.append(decode_float64(record.data))
    rows = np.array(sorted(predicted), dtype=np.int64).reshape(-1, 2)
    told = tuple(text.replace(str(folder), 'BAG') for text in warnings)
    lateness = (rows[:, 1] - rows[:, 0]) * 1e-9
    return Recorded(rows[:, 0], lateness, np.array(step_times), len(files), told)


def quantiles(seconds: np.ndarray) -> dict[str, float] | None:
    """Median, 99 % quantile and largest [ms]; None of nothing."""
    if not len(seconds):
        return None
    p50, p99, worst = 1e3 * np.quantile(seconds, (0.5, 0.99, 1.0))
    return {name: round(float(v), 3) for name, v in zip(('p50', 'p99', 'worst'), (p50, p99, worst), strict=True)}


def describe(case: Case, seconds: float) -> dict[str, Any]:
    """What a report says of a case and its length [s]."""
    return json.loads(
        json.dumps(
            {
                'seconds': seconds,
                'spheres': case.spheres,
                'radius_m': case.radius,
                'parameters': dict(case.parameters),
                'recorded': case.record,
                'busy_core': case.busy,
                'seed': case.seed,
                'noise_radii': NOISE,
            }
        )
    )
