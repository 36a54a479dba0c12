# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""One run of the simulator node between a tracker and a listener, each a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
import os
from pathlib import Path
import subprocess
import sys
import time
from typing import Any

from motion import poses_at, SCENE, THROW, THROWN, throws, UNLEARNED
import numpy as np
from outcome import errors_of, Outcome, read_counts, read_recorded
from rigid_gns_core.prediction.load import load_simulator
from rigid_gns_core.running.machine import load_average, stolen_time
from rigid_gns_core.scenes.sampling import sample_start
from rigid_gns_core.scenes.scene import Scene
from rigid_gns_core.scenes.start import StartRecipe
from rigid_gns_ros.demo import node_environment, NodeProcess
import yaml

PEERS = Path(__file__).with_name('peers.py')
NOISE = 5e-3  # of each tracked coordinate [radii]: 0.1 mm on a sphere of 20 mm
PLAYED = 150  # model steps that the tracker plays forward and backward
BOUNCING = 20.0  # and so long balls that bounce [s]
PAUSE = 0.35  # between two throws: longer than what ends a track [s]
COMPILING = 600.0  # a first run compiles the engine [s]
LEAST_STARTED = 30.0  # for discovery and the first frames [s]
POLL = 0.1  # [s]


@contextmanager
def busy_core() -> Iterator[int]:
    """Start a process that only computes, until the context ends; yield its number."""
    # a pipe that ends with us ends it too, should we be killed
    code = (
        'import os, threading; '
        'threading.Thread(target=lambda: (os.read(0, 1), os._exit(0)), daemon=True).start()\n'
        'print(flush=True)\n'
        'while True: pass'
    )
    process = subprocess.Popen(
        [sys.executable, '-c', code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    try:
        if process.stdout is not None:
            process.stdout.readline()  # it runs now
        yield process.pid
    finally:
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()


@dataclass(frozen=True)
class Case:
    """What is run.

    Args:
        name: As in the table.
        spheres: Number of spheres.
        radius: [m].
        stride: Model steps per tracked frame.
        parameters: Of the simulator, besides its scene.
        busy: Whether another process keeps one core busy.
        seed: Of places and noise.
        bouncing_hz: Frames per second of balls of 20 mm that bounce without loss; 0: a rollout of
            the model is played.
        throws_hz: Frames per second of one ball that is thrown again and again, in air.
        air: Whether the node's scene knows of that, and how the ball bounces.
    """

    name: str
    spheres: int
    radius: float
    stride: int
    parameters: Mapping[str, str]
    busy: bool = False
    seed: int = 0
    bouncing_hz: float = 0.0
    throws_hz: float = 0.0
    air: bool = False

    @property
    def scene(self) -> dict[str, Any]:
        """An open box whose ground holds three times as many spheres side by side."""
        if self.throws_hz:
            return THROWN if self.air else UNLEARNED
        if self.bouncing_hz:
            found: dict[str, Any] = SCENE['scene']
            return found
        side = float(2 * self.radius * np.sqrt(3 * self.spheres))
        return {
            'box': {'length_x': side, 'length_y': side},
            'radius': self.radius,
            'mass': self.radius**3,
            'restitution': 0.7746,
            'friction': 0.5,
            'rolling_friction': 0.03,
        }

    @property
    def recipe(self) -> StartRecipe:
        """Start of spheres in the air, which fall one after the other and collide."""
        return StartRecipe(
            spheres=self.spheres,
            height=(2 * self.radius, 60 * self.radius),
            gap=0.1 * self.radius,
            seed=self.seed,
        )

    @property
    def description(self) -> dict[str, Any]:
        """Description for the report."""
        return {
            'spheres': self.spheres,
            'radius_m': self.radius,
            'parameters': dict(self.parameters),
            'busy_core': self.busy,
            'seed': self.seed,
            'air': self.air,
            'noise_radii': NOISE,
            'bouncing_hz': self.bouncing_hz,
            'throws_hz': self.throws_hz,
        }


class Process(NodeProcess):
    """A process by its command line, started and stopped like a node of the demo.

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
        """Resident memory [bytes]; 0 without /proc."""
        try:
            lines = Path(f'/proc/{self._process.pid}/status').read_text().splitlines()
        except OSError:
            return 0
        return sum(1024 * int(line.split()[1]) for line in lines if line.startswith('VmRSS:'))

    @property
    def processor_time(self) -> float:
        """CPU time of its threads [s]; 0 without /proc."""
        try:
            stat = Path(f'/proc/{self._process.pid}/stat').read_text()
        except OSError:
            return 0.0
        user, system = stat.rsplit(')', 1)[1].split()[11:13]
        return (int(user) + int(system)) / os.sysconf('SC_CLK_TCK')


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
    files = {'scene': str(folder / 'scene.yaml'), 'record': str(folder / 'bag')}
    arguments = {**files, **case.parameters}
    before = load_average()
    processes: list[Process] = []

    def start(name: str, *command: str) -> Process:
        processes.append(Process(name, list(command), folder, environment))
        return processes[-1]

    with busy_core() if case.busy else nullcontext():
        try:
            words = [w for name, value in arguments.items() for w in ('-p', f'{name}:={value}')]
            module = ('-m', 'rigid_gns_ros.simulator_node')
            simulator = start('simulator', *module, '--ros-args', *words)
            simulator.wait_for('ready: ', COMPILING)
            listener = start('listener', str(PEERS), 'listen', '--out', str(folder / 'heard.npz'))
            listener.wait_for('ready', LEAST_STARTED)
            noise = NOISE * case.radius
            player = ('play', str(poses), '--dt', repr(dt), '--noise', repr(noise))
            player += ('--seed', str(case.seed), '--out', str(folder / 'sent.npy'))
            if case.throws_hz:
                each = round(THROW * case.throws_hz)
                player += ('--each', str(each), '--pause', repr(PAUSE))
            start('tracker', str(PEERS), *player)
            simulator.wait_for('started from stamp', LEAST_STARTED)
            begun, computed = time.monotonic(), simulator.processor_time
            memory, stolen = _wait(processes, simulator, seconds, watch)
            share = (simulator.processor_time - computed) / (time.monotonic() - begun)
            for process in processes:  # the simulator first: it then never waits for frames
                process.stop()
        finally:
            for process in processes:
                process.kill()
    log = simulator.log.read_text(errors='replace')
    with np.load(folder / 'heard.npz') as heard:
        return Outcome(
            period=period,
            tracked_dt=dt,
            sent=np.load(folder / 'sent.npy'),
            heard={name: heard[name] for name in heard.files},
            counts=read_counts(log),
            recorded=read_recorded(folder / 'bag'),
            memory=memory,
            stolen=stolen,
            processor_share=share,
            errors=errors_of(log),
            warnings=log.count('[WARN]'),
            load={'before': before, 'after': load_average()},
            learned=log.count('a learned scene is taken'),
        )


def _prepare(case: Case, folder: Path) -> tuple[Path, float, float]:
    """Write scene and poses; the file of poses, their interval and the model step [s]."""
    (folder / 'scene.yaml').write_text(yaml.safe_dump({'scene': case.scene}), encoding='utf-8')
    scene = Scene.from_mapping(case.scene)
    path = folder / 'poses.npy'
    if case.throws_hz:
        np.save(path, throws(case.throws_hz, case.seed))
        return path, 1 / case.throws_hz, load_simulator().native_dt(scene)
    if case.bouncing_hz:
        heights = np.linspace(0.3, 1.0, case.spheres)
        times = np.arange(round(BOUNCING * case.bouncing_hz)) / case.bouncing_hz
        np.save(path, poses_at(times, heights, np.zeros(case.spheres)))
        return path, 1 / case.bouncing_hz, load_simulator().native_dt(scene)
    start = sample_start(scene, case.recipe)
    trajectory = load_simulator().rollout(scene, start.positions, steps=PLAYED)
    if trajectory.diverged_at is not None:
        raise RuntimeError(f'{case.name}: the rollout that the tracker plays diverged')
    poses = np.concatenate([trajectory.positions, trajectory.quaternions], axis=2)
    np.save(path, poses[:: case.stride])
    return path, case.stride * trajectory.dt, trajectory.dt


def _wait(
    processes: list[Process],
    simulator: Process,
    seconds: float,
    watch: Callable[[float, int], None] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """Wait, and sample the simulator's memory each second, the machine's lost time at each poll.

    Returns:
        Times [s] and bytes, shape (samples, 2); system time [ns] and `stolen_time` [s], shape
        (polls, 2).
    """
    begun = time.monotonic()
    samples: list[tuple[float, int]] = []
    stolen: list[tuple[int, float]] = []
    while (passed := time.monotonic() - begun) < seconds:
        for process in processes:
            process.check()
        stolen.append((time.time_ns(), stolen_time()))
        if passed >= len(samples):
            samples.append((passed, simulator.resident))
            if watch is not None:
                watch(*samples[-1])
        time.sleep(min(POLL, seconds))
    return (
        np.array(samples, dtype=np.float64).reshape(-1, 2),
        np.array(stolen, dtype=np.float64).reshape(-1, 2),
    )
