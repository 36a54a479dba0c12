# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns`: help, examples, exit codes and messages."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import contextlib
import importlib
from importlib import metadata
import os
from pathlib import Path
import pty
import re
import select
import shlex
import signal
import subprocess
import sys
import termios
import time
from typing import Any
import warnings

import pytest
from rigid_gns_core.commands import cli
from rigid_gns_core.rollout.simulator import Simulator

PROGRAM = [sys.executable, '-m', 'rigid_gns_core.commands.cli']


def subparser(command: str) -> argparse.ArgumentParser:
    parser = cli.make_parser(command)
    (action,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return action.choices[command]


def examples(epilog: str | None) -> list[list[str]]:
    """Words of the `rigid-gns` lines below `example:` or `examples:`."""
    match = re.search(r'^examples?:\n((?:  .+\n?)+)', epilog or '', re.M)
    lines = match[1].splitlines() if match else []
    return [shlex.split(line) for line in lines if line.startswith('  rigid-gns ')]


def test_help_lists_all_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(['--help'])
    assert caught.value.code == 0
    output = capsys.readouterr().out
    for name in cli.COMMANDS:
        assert f'\n    {name}' in output
    for code in (0, cli.CHECK_FAILED, cli.BAD_INPUT, cli.INTERRUPTED, cli.NO_READER):
        assert re.search(rf'^  {code}  +\w', output, re.M)


@pytest.mark.parametrize('command', cli.COMMANDS)
def test_each_command_has_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main([command, '--help'])
    assert caught.value.code == 0
    assert f'usage: rigid-gns {command}' in capsys.readouterr().out


@pytest.mark.parametrize('command', [None, *cli.COMMANDS])
def test_help_shows_examples_that_can_be_typed(
    command: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    found = examples(subparser(command).epilog if command else cli.make_parser().epilog)
    assert found
    assert command is None or command in [words[1] for words in found]
    for words in found:
        if '--help' not in words:
            assert cli.make_parser(words[1]).parse_args(words[1:]).command == words[1]


def test_version_is_that_of_the_installed_package(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(['--version'])
    assert caught.value.code == 0
    assert capsys.readouterr().out == f'rigid-gns {metadata.version("rigid_gns_ros")}\n'


@pytest.mark.parametrize(
    'arguments', [[], ['no-such'], ['--no-such'], ['train', '--device', 'no-device']]
)
def test_bad_usage_exits_with_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(arguments)
    assert caught.value.code == 2
    assert 'usage: rigid-gns' in capsys.readouterr().err


@pytest.mark.parametrize('word', ['--stpes', '--step'])
def test_a_misspelt_option_shows_the_usage_of_its_command(
    word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Beginnings of options are not taken for them, as a new option could change what they are."""
    with pytest.raises(SystemExit) as caught:
        cli.main(['rollout', word, '5', '--out', str(tmp_path / 'a.h5')])
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith('usage: rigid-gns rollout ')
    assert error.endswith(f'rigid-gns rollout: error: unrecognized arguments: {word} 5\n')


@pytest.mark.parametrize(
    ('line', 'text'),
    [
        ('rollout --scene nowhere --out a.h5', "no shipped configuration 'nowhere'; shipped: "),
        ('rollout --model nobody --out a.h5', "no model 'nobody'"),
        ('generate --config nowhere --out a', "no shipped configuration 'nowhere'"),
        ('train --config nowhere --data a --out b', "no shipped configuration 'nowhere'"),
        ('calibrate --data a --out b.yaml', 'a: '),
        ('evaluate --data a.h5', 'a.h5: no such file'),
        ('report a.h5 --out a.html', 'a.h5: no such record or bag'),
        ('import a --out b', 'a: '),
        ('experiment', 'name an experiment, or all; allowed: ground_truth'),
        ('hard-cases --cases nothing', "'nothing'"),
        ('fuzz --kinds nothing', "unknown kind 'nothing', allowed: plate"),
        ('fuzz --from -1', '--from is -1, expected at least 0'),
        ('fuzz --cases 1 --seconds 1', '--cases and --seconds are both given'),
        ('benchmark --scenes nothing', "'nothing'"),
        ('info --model nobody', "no model 'nobody'"),
        ('info --model .', "no model '.': neither a file ..safetensors"),
    ],
)
def test_bad_input_exits_with_2_and_one_line(
    line: str,
    text: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    command, *_ = line.split()
    if command == 'train':
        pytest.importorskip('torch', reason='rigid-gns train needs torch')
    monkeypatch.chdir(tmp_path)
    assert cli.main(line.split()) == cli.BAD_INPUT
    output = capsys.readouterr()
    assert output.out == ''
    assert re.fullmatch(rf'rigid-gns {command}: error: [^\n]*\n', output.err)
    assert text in output.err
    assert not list(tmp_path.iterdir())


def test_what_works_exits_with_0(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record, page = tmp_path / 'a.h5', tmp_path / 'a.html'
    assert cli.main(['rollout', '--steps', '3', '--out', str(record)]) == 0
    assert cli.main(['evaluate', '--data', str(record), '--steps', '2']) == 0
    assert cli.main(['report', str(record), '--out', str(page)]) == 0
    assert cli.main(['experiment', '--list']) == 0
    assert page.read_text(encoding='utf-8').startswith('<!doctype html>')
    error = capsys.readouterr().err
    assert 'rollout: step 3 of 3' in error and 'evaluate: trajectory 1 of 1' in error


def test_the_rate_of_a_rollout_counts_its_own_steps_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The step that loads machine code is neither timed nor counted, and warns of nothing."""
    events: list[object] = []
    rollout_batch, clock = Simulator.rollout_batch, time.perf_counter

    def roll(self: Simulator, scenes: Any, starts: Any, steps: int, **options: Any) -> Any:
        warnings.warn('beyond what was trained', stacklevel=2)
        events.append((len(starts), steps))
        return rollout_batch(self, scenes, starts, steps, **options)

    def tell() -> float:
        if sys._getframe(1).f_globals['__name__'] == 'rigid_gns_core.commands.rollout':
            events.append('clock')
        return clock()

    monkeypatch.setattr(Simulator, 'rollout_batch', roll)
    monkeypatch.setattr(time, 'perf_counter', tell)
    out = tmp_path / 'what_if'
    with pytest.warns(UserWarning, match='beyond what was trained') as caught:
        assert cli.main(f'rollout --steps 3 --samples 2 --out {out}'.split()) == 0
    assert events == [(1, 1), 'clock', (2, 3), 'clock']
    assert len(caught) == 1
    assert 'rollout: step 6 of 6' in capsys.readouterr().err


# `experiment` and `closed-forms` with a check that fails: test_experiments_run, test_closed_forms
def test_a_failed_check_exits_with_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        'rigid_gns_core.files.checkpoint.DEFAULT_MODEL', 'gns'
    )  # which piles break
    words = ['hard-cases', '--cases', 'shaft', '--quick', '--no-teacher']
    assert cli.main(words) == cli.CHECK_FAILED
    assert 'gns: 0 ok, 1 FAILED' in capsys.readouterr().out
    assert cli.main([*words, '--model', 'laws']) == 0  # only the default model is judged


@contextlib.contextmanager
def on_a_terminal(words: list[str], folder: Path) -> Iterator[tuple[subprocess.Popen, int]]:
    """Yield a process whose standard error is a terminal, and our end of that."""
    ours, its = pty.openpty()
    termios.tcsetwinsize(its, (24, 80))  # a bar needs some width
    process = subprocess.Popen(
        [*PROGRAM, *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=its, close_fds=True
    )
    os.close(its)
    try:
        yield process, ours
    finally:
        process.kill()
        process.wait()
        os.close(ours)


def read_until(terminal: int, text: str) -> str:
    """Return what the terminal shows, up to `text`, its end, or a minute without anything."""
    shown = ''
    while text not in shown and select.select([terminal], [], [], 60.0)[0]:
        try:
            shown += os.read(terminal, 4096).decode(errors='replace')
        except OSError:  # EIO: the process has ended
            break
    return shown


@pytest.mark.parametrize(
    ('line', 'bar', 'module'),
    [
        ('rollout --steps 5000 --out a.h5', 'rollout:', 'numba'),
        ('hard-cases --no-teacher', 'hard cases:', 'numba'),
        ('fuzz --cases 9999', 'fuzz:', 'numba'),
        ('closed-forms', 'closed forms:', 'pybullet'),
        ('generate --config smoke --trajectories 999 --workers 1 --out a', 'a:', 'pybullet'),
        ('generate --scene box_154 --steps 999 --out a.h5', 'box_154:', 'pybullet'),
    ],
)
def test_an_interrupted_command_showed_a_bar_and_exits_with_130(
    line: str, bar: str, module: str, tmp_path: Path
) -> None:
    pytest.importorskip(module)
    with on_a_terminal(line.split(), tmp_path) as (process, terminal):
        assert f'{bar}   0%|' in read_until(terminal, '%|')
        process.send_signal(signal.SIGINT)
        shown = read_until(terminal, 'interrupted')
        assert f'rigid-gns {line.split()[0]}: interrupted' in shown
        assert 'Traceback' not in shown
        assert process.wait(timeout=60) == cli.INTERRUPTED


@pytest.mark.parametrize('line', ['--help', '--version', 'info --json', 'rollout --help'])
def test_a_reader_that_leaves_is_no_error(line: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    buffered = {key: value for key, value in os.environ.items() if key != 'PYTHONUNBUFFERED'}
    done = subprocess.run(
        [*PROGRAM, *line.split()],
        env=buffered,
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (cli.NO_READER, '')


def test_a_pipe_that_broke_elsewhere_is_an_error(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    module = importlib.import_module(cli.COMMANDS['info'][0])

    def lose_a_pipe(_: object) -> int:
        raise BrokenPipeError('the scheduler is gone')

    monkeypatch.setattr(module, 'run', lose_a_pipe)
    with open(os.devnull, 'w') as nowhere, contextlib.redirect_stdout(nowhere):
        assert cli.main(['info']) == cli.BAD_INPUT
    assert 'error: the scheduler is gone' in capfd.readouterr().err


def test_other_errors_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module(cli.COMMANDS['evaluate'][0])
    monkeypatch.setattr(module, 'add_arguments', lambda parser: None)
    monkeypatch.setattr(module, 'run', lambda arguments: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        cli.main(['evaluate'])


@pytest.mark.parametrize(
    ('line', 'module', 'wanted'),
    [
        ('train --data a --out b', 'torch', 'torch>=2.6'),
        ('generate --scene box_154 --steps 1 --out a.h5', 'pybullet', 'pybullet>='),
        ('closed-forms', 'pybullet', 'pybullet>='),
        ('generate --config smoke --backend dask --out a', 'distributed', 'distributed>='),
    ],
)
def test_what_a_command_needs_is_named(
    line: str,
    module: str,
    wanted: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, 'rigid_gns_core.training.train', raising=False)
    monkeypatch.setitem(sys.modules, module, None)  # as if it were not installed
    assert cli.main(line.split()) == cli.BAD_INPUT
    (message,) = [line for line in capsys.readouterr().err.splitlines() if 'error:' in line]
    assert message.startswith(f'rigid-gns {line.split()[0]}: error: ')
    assert f'needs {module}, which is not installed: ' in message
    assert f"pip install '{wanted}" in message


def test_a_module_of_ours_that_is_missing_is_not_the_users_fault(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(cli.COMMANDS, 'info', ('rigid_gns_core.no_such', 'nothing'))
    with pytest.raises(ModuleNotFoundError, match='rigid_gns_core.no_such'):
        cli.main(['info'])


def test_help_needs_no_heavy_module() -> None:
    """Nor does completion: both import the options of a command alone."""
    code = (
        'import sys\nfrom rigid_gns_core.commands import cli\n'
        'for command in cli.COMMANDS: cli.make_parser(command)\n'
        "print([name for name in ('torch', 'pybullet', 'matplotlib', 'rclpy', 'mujoco') "
        'if name in sys.modules])'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == '[]\n'
