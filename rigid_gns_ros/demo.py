# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`make demo`: tracker and simulator in two processes, recorded bags, and their evaluation."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from types import FrameType
from typing import NoReturn

from rigid_gns_core.commands import cli

from .demo_ball import ball_errors, NOISE, RATE, SCENE, told, write_ball

LOG_TAIL = 25  # lines of the log shown when a process failed
POLL = 0.1  # [s]
# from other set-ups these would choose another middleware or reach other machines
FOREIGN = ('RMW_IMPLEMENTATION', 'ROS_LOCALHOST_ONLY', 'ROS_STATIC_PEERS', 'ROS_NAMESPACE')


class DemoError(RuntimeError):
    """A process of the demo failed."""


class NodeProcess:
    """A node of this package in a process and session of its own.

    Args:
        module: Module with the node's `main`.
        folder: Folder of its log.
        parameters: ROS parameters by name.
        environment: Environment variables.
    """

    def __init__(
        self, module: str, folder: Path, parameters: dict[str, str], environment: dict[str, str]
    ) -> None:
        self.name = module.removesuffix('_node')
        self.log = folder / f'{self.name}.log'
        command = [sys.executable, '-m', f'{__package__}.{module}', '--ros-args']
        for name, value in parameters.items():
            command += ['-p', f'{name}:={value}']
        with self.log.open('wb') as log:
            # a session of its own: Ctrl-C must reach only this program, which then stops the nodes
            self._process = subprocess.Popen(
                command,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=environment,
                start_new_session=True,
            )

    def check(self) -> None:
        """Check that the process runs; DemoError: it has ended."""
        if self._process.poll() is not None:
            raise self._failure(f'ended with exit code {self._process.returncode}')

    def ended(self) -> bool:
        """Whether the process has ended; `stop` tells how."""
        return self._process.poll() is not None

    def wait_for(self, text: str, timeout: float) -> None:
        """Wait until the log holds `text`.

        Raises:
            DemoError: The process has ended, or `timeout` [s] is over.
        """
        end = time.monotonic() + timeout
        while text not in self.log.read_text(errors='replace'):
            self.check()
            if time.monotonic() > end:
                raise self._failure(f'did not log {text!r} within {timeout:g} s')
            time.sleep(POLL)

    def stop(self) -> None:
        """Stop the process by SIGINT, then SIGTERM, then SIGKILL.

        Raises:
            DemoError: It did not end with exit code 0.
        """
        for number, patience in ((signal.SIGINT, 20.0), (signal.SIGTERM, 5.0)):
            if self._process.poll() is None:
                os.killpg(self._process.pid, number)
            try:
                code = self._process.wait(patience)
            except subprocess.TimeoutExpired:
                continue
            if code != 0:
                raise self._failure(f'ended with exit code {code}')
            return
        self.kill()
        raise self._failure('did not stop on SIGINT and SIGTERM and was killed')

    def kill(self) -> None:
        """Kill the process, if it runs."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def _failure(self, what: str) -> DemoError:
        lines = self.log.read_text(errors='replace').splitlines()[-LOG_TAIL:]
        shown = '\n'.join(f'    {line}' for line in lines) or '    (empty)'
        return DemoError(f'the {self.name} {what}; the end of {self.log}:\n{shown}')


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait for the end of the context; in the main thread."""
    came: list[int] = []
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.getsignal(number) for number in numbers}
    for number in numbers:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def run_demo(folder: Path, duration: float) -> int:
    """Run both nodes on the box, then on a table tennis ball, and evaluate what they recorded.

    Args:
        folder: Folder to create for bags, reports, figure and logs.
        duration: Time to predict in the box [s].

    Returns:
        The exit code of evaluation and reports.

    Raises:
        DemoError: A process failed.
        FileExistsError: The folder exists.
    """
    folder.mkdir(parents=True)
    bag = folder / 'bag'
    run_nodes(folder, {'record': str(bag)}, {}, duration)
    print('demo: evaluating the bag\n', flush=True)
    code = cli.evaluate(
        [str(bag), '--json', str(folder / 'report.json'), '--figure', str(folder / 'report.png')]
    )
    # the replay, for any browser
    code = code or cli.main(['report', str(bag), '--out', str(folder / 'report.html')])
    return code or run_ball(folder / 'ball')


def run_ball(folder: Path) -> int:
    """Forecast a table tennis ball of which positions alone are seen; the exit code of the report.

    Args:
        folder: Folder to create.

    Raises:
        DemoError: A process failed.
    """
    folder.mkdir()
    record = folder / 'ball.h5'
    truth = write_ball(record)
    print(
        f'\ndemo: a table tennis ball, {RATE:g} positions a second with {1e3 * NOISE:g} mm of '
        'noise, and a spin that is not seen',
        flush=True,
    )
    bag = folder / 'bag'
    simulator = {'record': str(bag), 'scene': SCENE, 'start': 'every', 'horizon': '0.5'}
    tracker = {'trajectory': str(record), 'noise': str(NOISE)}
    run_nodes(folder, simulator, tracker, None)
    print(f'demo: errors of the forecasts\n{told(ball_errors(bag, truth))}', flush=True)
    return cli.main(['report', str(bag), '--out', str(folder / 'report.html')])


def run_nodes(
    folder: Path, simulating: dict[str, str], tracking: dict[str, str], duration: float | None
) -> None:
    """Run simulator and tracker, and stop both.

    Args:
        folder: Folder of their logs.
        simulating: Parameters of the simulator.
        tracking: Parameters of the tracker.
        duration: How long [s]; None: until the tracker ends.

    Raises:
        DemoError: A process failed.
    """
    environment = node_environment(folder)
    processes: list[NodeProcess] = []

    def started(name: str, parameters: dict[str, str], patience: float) -> NodeProcess:
        print(f'demo: starting the {name}', flush=True)
        with uninterrupted():  # a node that runs is one that is stopped
            processes.append(NodeProcess(f'{name}_node', folder, parameters, environment))
        processes[-1].wait_for('ready: ', patience)
        return processes[-1]

    try:
        simulator = started('simulator', simulating, 60.0)
        tracker = started('tracker', tracking, 30.0)
        simulator.wait_for('started from stamp', 20.0)
        if duration is None:
            while not tracker.ended():
                simulator.check()
                time.sleep(POLL)
        else:
            print(
                f'demo: predicting for {duration:g} s; to watch: '
                f'ROS_DOMAIN_ID={environment["ROS_DOMAIN_ID"]} ros2 topic hz /predicted_poses',
                flush=True,
            )
            end = time.monotonic() + duration
            while time.monotonic() < end:
                for process in processes:
                    process.check()
                time.sleep(POLL)
        for process in reversed(processes):
            process.stop()
    finally:
        for process in processes:
            process.kill()


def node_environment(folder: Path) -> dict[str, str]:
    """Environment variables with which nodes discover only each other, on this machine."""
    environment = {name: value for name, value in os.environ.items() if name not in FOREIGN}
    # two demos at once rarely share a domain; tests use domains from 50 on
    environment['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 49)
    environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    environment['ROS_LOG_DIR'] = str(folder.resolve() / 'ros_log')
    return environment


def _interrupt(_number: int, _frame: FrameType | None) -> NoReturn:
    raise KeyboardInterrupt


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code of the demo: 0 done, 1 a process failed, 2 bad input, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog='demo',
        description='Tracker, simulator, bag and report, in one go.',
        allow_abbrev=False,
    )
    parser.add_argument('--seconds', type=float, default=20.0, help='time to predict [s]')
    parser.add_argument(
        '--out', type=Path, help='folder to create (default: demo_output/ and the time)'
    )
    arguments = parser.parse_args(argv)
    if not arguments.seconds > 0:
        parser.error(f'--seconds is {arguments.seconds:g}, expected more than 0')
    folder = arguments.out or Path('demo_output') / time.strftime('%Y-%m-%d_%H-%M-%S')
    signal.signal(signal.SIGTERM, _interrupt)
    try:
        return run_demo(folder, arguments.seconds)
    except DemoError as error:
        print(f'demo: error: {error}', file=sys.stderr)
        return 1
    except FileExistsError:
        print(f'demo: error: {folder} exists; choose another --out', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print('demo: stopped', file=sys.stderr)
        return 130


if __name__ == '__main__':
    sys.exit(main())
