# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Completion in a shell: what argcomplete answers, and bash itself."""

from __future__ import annotations

import os
from pathlib import Path
import shutil
import subprocess
import sys

import pytest
from rigid_gns_core.commands import cli

ROOT = Path(__file__).resolve().parents[2]


def complete(line: str, folder: Path = ROOT) -> list[str]:
    """Return what the program answers to a shell, on descriptor 8 as the shell's own code asks."""
    reader, writer = os.pipe()
    code = (
        f'import os, sys; os.dup2({writer}, 8); '
        "sys.argv = ['rigid-gns']; from rigid_gns_core.commands import cli; cli.main()"
    )
    environment = {
        **os.environ,
        '_ARGCOMPLETE': '1',
        '_ARGCOMPLETE_IFS': '\n',
        'COMP_LINE': line,
        'COMP_POINT': str(len(line)),
    }
    environment['PYTHONPATH'] = str(ROOT)
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=folder, env=environment, pass_fds=[writer], check=False
    )
    os.close(writer)
    with open(reader, encoding='utf-8') as answer:
        words = answer.read().split('\n')
    assert done.returncode == 0
    return [word.strip() for word in words]


def test_commands_are_offered() -> None:
    assert set(complete('rigid-gns ')) == {*cli.COMMANDS, '--help', '--version'}
    assert complete('rigid-gns re') == ['report']


@pytest.mark.parametrize(
    ('line', 'expected'),
    [
        ('rigid-gns rollout --s', {'--scene', '--steps', '--seed', '--samples', '--spread'}),
        ('rigid-gns rollout --model ', {'laws', 'gns'}),
        ('rigid-gns rollout --model gns --scene ood_', {'ood_a', 'ood_b', 'ood_c', 'ood_d'}),
        ('rigid-gns generate --config sm', {'smoke'}),
        ('rigid-gns train --config g', {'gns', 'gns_closed_loop', 'gns_finetune'}),
        ('rigid-gns train --device ', {'auto', 'cpu', 'cuda'}),
        ('rigid-gns calibrate --fit sur', {'surface_restitution', 'surface_friction'}),
        ('rigid-gns experiment hist', {'history'}),
        ('rigid-gns experiment history --budget ', {'cpu', 'smoke', 'full'}),
        ('rigid-gns hard-cases --model t', {'teacher'}),
        ('rigid-gns hard-cases --cases same', {'same_point_2', 'same_point_3'}),
        ('rigid-gns fuzz --kinds c', {'ceiling', 'crest'}),
        ('rigid-gns benchmark --peers B', {'Bullet'}),
        ('rigid-gns report a.h5 --velocities ', {'given', 'poses'}),
        ('rigid-gns import a --model ', {'laws', 'gns'}),
    ],
)
def test_options_and_names_of_a_command_are_offered(line: str, expected: set[str]) -> None:
    assert set(complete(line)) == expected


def test_files_are_offered_where_a_file_is_meant(tmp_path: Path) -> None:
    (tmp_path / 'first.h5').touch()
    (tmp_path / 'first_bag').mkdir()
    assert set(complete('rigid-gns report fir', tmp_path)) == {'first.h5', 'first_bag/'}


@pytest.mark.skipif(shutil.which('bash') is None, reason='there is no bash')
def test_bash_completes(tmp_path: Path) -> None:
    """What argcomplete prints for a bash, which is asked as it asks itself when Tab is pressed."""
    program = tmp_path / 'rigid-gns'
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m rigid_gns_core.commands.cli "$@"\n')
    program.chmod(0o755)
    script = (
        'eval "$(register-python-argcomplete rigid-gns)"\n'
        'complete -p rigid-gns >&2\n'
        "COMP_LINE='rigid-gns rollout --model '; COMP_POINT=${#COMP_LINE}; COMP_TYPE=9\n"
        "COMP_WORDS=(rigid-gns rollout --model ''); COMP_CWORD=3\n"
        "_python_argcomplete rigid-gns '' --model\n"
        'printf "%s\\n" "${COMPREPLY[@]}"\n'
    )
    path = os.pathsep.join([str(tmp_path), str(Path(sys.executable).parent), os.environ['PATH']])
    environment = {**os.environ, 'PATH': path}
    done = subprocess.run(
        ['bash', '--norc', '-c', script],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert '-F _python_argcomplete rigid-gns' in done.stderr
    assert [word.strip() for word in done.stdout.splitlines()] == ['laws', 'gns']
