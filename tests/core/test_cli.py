"""`rigid-gns`: exit codes, help and messages, without running a stage."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_gns_core import cli


def test_help_lists_all_commands(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(['--help'])
    assert caught.value.code == 0
    output = capsys.readouterr().out
    for name in cli.COMMANDS:
        assert name in output


@pytest.mark.parametrize('command', cli.COMMANDS)
def test_each_command_has_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    if command in ('train', 'rollout'):
        pytest.importorskip('torch', reason=f'rigid-gns {command} needs torch')
    with pytest.raises(SystemExit) as caught:
        cli.main([command, '--help'])
    assert caught.value.code == 0
    assert f'rigid-gns {command}' in capsys.readouterr().out


@pytest.mark.parametrize('arguments', [[], ['no-such'], ['--no-such']])
def test_bad_usage_exits_with_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        cli.main(arguments)
    assert caught.value.code == 2
    assert 'usage: rigid-gns' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('raised', 'code', 'text'),
    [
        (ValueError('radius is 0'), 2, 'rigid-gns evaluate: error: radius is 0'),
        (FileNotFoundError('data.h5: no such file'), 2, 'error: data.h5: no such file'),
        (KeyboardInterrupt(), 130, 'rigid-gns evaluate: interrupted'),
    ],
)
def test_errors_are_one_line(
    raised: BaseException,
    code: int,
    text: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    module = importlib.import_module(cli.COMMANDS['evaluate'][0])

    def fail(_: object) -> int:
        raise raised

    monkeypatch.setattr(module, 'add_arguments', lambda parser: None)
    monkeypatch.setattr(module, 'run', fail)
    assert cli.main(['evaluate']) == code
    error = capsys.readouterr().err
    assert text in error
    assert 'Traceback' not in error


def test_other_errors_are_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module(cli.COMMANDS['evaluate'][0])
    monkeypatch.setattr(module, 'add_arguments', lambda parser: None)
    monkeypatch.setattr(module, 'run', lambda arguments: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        cli.main(['evaluate'])


def test_missing_extra_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, cli.COMMANDS['train'][0], raising=False)
    monkeypatch.setitem(sys.modules, 'torch', None)  # as if it were not installed
    assert cli.main(['train', '--help']) == 2
    error = capsys.readouterr().err
    assert 'rigid-gns train: error:' in error
    assert "pip install 'rigid_gns_ros[torch" in error


def test_runs_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, '-m', 'rigid_gns_core.cli', '--help'],
        capture_output=True,
        text=True,
        cwd=Path(__file__).resolve().parents[2],
        check=False,
    )
    assert done.returncode == 0
    assert 'teacher-card' in done.stdout
