# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""The nodes as processes: signals, exit codes, errors in one line."""

from __future__ import annotations

from collections.abc import Callable
import os
from pathlib import Path
import re
import signal
import sys
import time
from typing import Any

import numpy as np
import pytest

pytest.importorskip('rclpy', reason='ROS 2 is not installed')

from rigid_gns_core.bags.reader import read_bag

SIMULATOR = 'rigid_gns_ros.simulator_node'
STAMP = 12_000_000_000
Run = Callable[..., Any]


@pytest.mark.parametrize(
    ('number', 'again'),
    [
        (signal.SIGTERM, None),
        (signal.SIGHUP, None),
        (signal.SIGINT, None),
        (signal.SIGINT, 0.003),
        (signal.SIGINT, 0.1),
    ],
)
def test_a_signal_closes_the_bag(
    run_process: Run,
    bench: Any,
    falling: Callable[..., np.ndarray],
    tmp_path: Path,
    number: int,
    again: float | None,
) -> None:
    """`ros2 launch` hands a Ctrl-C on, so that a node gets two SIGINTs within milliseconds."""
    folder = tmp_path / 'bag'
    run = run_process(SIMULATOR, '-p', f'record:={folder}', '-p', 'velocity_window:=1')
    run.wait_for('ready: ')
    tracked = bench.tracked()
    frames = tracked.send_until(2, falling(0.0), STAMP)
    # discovery of the tester's subscription may take the first predictions, never their order
    assert [(frame.stamp_ns - STAMP) % 100_000_000 for frame in frames] == [0, 0]
    run.signal(number)
    if again is not None:
        time.sleep(again)
        run.signal(number)
    assert run.exit_code() == 0, run.output
    assert 'Traceback' not in run.output and 'stopped: ' in run.output
    bag = read_bag(folder)
    assert not bag.warnings
    predicted = [bytes(cdr) for cdr in bag.topics['/predicted_poses'].messages]
    assert set(tracked.predicted_bytes) <= set(predicted)


def test_a_signal_while_a_future_is_computed_is_obeyed(
    run_process: Run, bench: Any, falling: Callable[..., np.ndarray]
) -> None:
    run = run_process(SIMULATOR, '-p', 'horizon:=60.0', '-p', 'velocity_window:=1')
    run.wait_for('ready: ')
    tracked = bench.tracked()
    tracked.send_until(2, falling(0.0, count=50), STAMP)
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
    assert 'Traceback' not in run.output and 'stopped: ' in run.output


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('module', [SIMULATOR, 'rigid_gns_ros.tracker_node'])
def test_a_signal_during_the_imports_is_obeyed(run_process: Run, module: str, number: int) -> None:
    """They take a second, in which Python would answer Ctrl-C with a traceback."""
    run = run_process(module)
    status = Path(f'/proc/{run.process.pid}/status')
    # until the process has a handler for SIGTERM, which Python itself has not
    while not int(re.findall(r'SigCgt:\s*(\w+)', status.read_text())[0], 16) & 1 << 14:
        assert run.process.poll() is None, run.output
        time.sleep(0.001)
    run.signal(number)
    assert run.exit_code() == 0, run.output
    assert run.output == ''


def test_a_signal_while_the_model_loads_is_obeyed(run_process: Run, tmp_path: Path) -> None:
    run = run_process(SIMULATOR, '--log-level', 'debug')
    run.wait_for('[rcl')  # ROS is up, and the model is not yet
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
    assert 'Traceback' not in run.output


@pytest.mark.parametrize(
    ('argument', 'message'),
    [
        ('scene:=nonesuch', 'nonesuch'),
        ('rate:=-1.0', 'parameter rate'),
        ('model:=nonesuch', "no model 'nonesuch'"),
    ],
)
def test_a_bad_parameter_ends_the_process(run_process: Run, argument: str, message: str) -> None:
    run = run_process(SIMULATOR, '-p', argument)
    assert run.exit_code() == 1
    lines = [line for line in run.output.splitlines() if line.strip()]
    assert len(lines) == 1, run.output
    assert lines[0].startswith('[FATAL]') and message in lines[0]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_node_that_compiles(run_process: Run, tmp_path: Path, number: int) -> None:
    # of another processor: machine code of this one may lie beside the sources
    empty = {'NUMBA_CACHE_DIR': str(tmp_path / 'empty'), 'NUMBA_CPU_NAME': 'generic'}
    run = run_process([sys.executable, '-m', SIMULATOR], environment={**os.environ, **empty})
    run.wait_for('compiling the engine, once')
    run.signal(number)
    assert run.exit_code() == 0, run.output
    assert not list((tmp_path / 'empty').rglob('complete')), 'it went on to the end'
    assert 'Traceback' not in run.output


def test_a_missing_numba_is_named_with_its_remedy(run_process: Run) -> None:
    program = (
        "import sys; sys.modules['numba'] = None; sys.argv = ['simulator']; "
        'from rigid_gns_ros.simulator_node import main; sys.exit(main())'
    )
    run = run_process([sys.executable, '-c', program])
    assert run.exit_code() == 1
    (line,) = [line for line in run.output.splitlines() if line.strip()]
    assert line.endswith('the engine needs numba, which is not installed: pip install numba')


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        (('-r', 'zzz'), "Couldn't parse remap rule: '-r zzz'"),
        (('--params-file', '/nonesuch.yaml'), '/nonesuch.yaml'),
        (('--nonesuch',), "unknown words after --ros-args: ['--nonesuch']"),
        (('-p', 'use_sim_time:=1'), "Trying to set parameter 'use_sim_time' to '1'"),
    ],
)
def test_a_bad_argument_ends_the_process(
    run_process: Run, words: tuple[str, ...], message: str
) -> None:
    run = run_process(SIMULATOR, *words)
    assert run.exit_code() == 1
    fatal = [line for line in run.output.splitlines() if line.startswith('[FATAL]')]
    assert len(fatal) == 1 and message in fatal[0], run.output
    assert 'Traceback' not in run.output


NODES = {'simulator': SIMULATOR, 'tracker': 'rigid_gns_ros.tracker_node'}


@pytest.mark.parametrize('name', NODES)
@pytest.mark.parametrize('word', ['-h', '--help'])
def test_help_is_printed_and_no_node_made(run_process: Run, name: str, word: str) -> None:
    run = run_process([sys.executable, '-m', NODES[name], word], '-p', 'scene:=box_154')
    assert run.exit_code() == 0
    usage = f'usage: {name} --ros-args -p NAME:=VALUE ...; parameters: docs/node.md\n'
    assert run.output == usage


@pytest.mark.parametrize('name', NODES)
def test_a_stray_argument_ends_the_process(run_process: Run, name: str) -> None:
    run = run_process([sys.executable, '-m', NODES[name], 'scene', '-x'])
    assert run.exit_code() == 1
    (line,) = run.output.splitlines()
    assert line.startswith(f'{name}: error: unknown arguments: scene -x; ')
    assert '--ros-args -p' in line


def test_a_misspelt_parameter_is_warned_of(run_process: Run) -> None:
    words = ('scne:=x', 'zzzzzz:=1', 'use_sim_time:=false', 'start_type_description_service:=true')
    qos = 'qos_overrides./tracked_poses.subscription.depth:=3'
    run = run_process(SIMULATOR, *(word for p in (*words, qos) for word in ('-p', p)))
    for name in ('scne', 'zzzzzz'):
        run.wait_for(f'parameter {name} is ignored: ')
    run.signal(signal.SIGINT)
    assert run.exit_code() == 0, run.output
    warned = re.findall('parameter (\\w+) is ignored: (.*)', run.output)
    ignored = 'this node has none of that name'
    assert sorted(warned) == [('scne', f'{ignored}; nearest: scene'), ('zzzzzz', ignored)]
