# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Changed files are read or refused in a line; so is what was once found (tests/corpus)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import os
from pathlib import Path
import shutil
import signal
import time

import numpy as np
import pytest
from rigid_gns_core.commands import cli
from rigid_gns_core.errors import UserError
from rigid_gns_core.studies.foreign_files import run
from rigid_gns_core.studies.foreign_files.formats import FORMATS
from rigid_gns_core.studies.foreign_files.run import changed_file, findings, problem_of

CORPUS = sorted((Path(__file__).parents[1] / 'corpus').iterdir())


@pytest.mark.parametrize('path', CORPUS, ids=lambda path: path.name)
def test_what_was_found_is_mended(tmp_path: Path, path: Path) -> None:
    """Each of these once gave a traceback, an error without a file, or one of many pages."""
    form = FORMATS[path.name.split('_')[0]]
    copy = Path(shutil.copy(path, tmp_path))
    assert problem_of(form, copy) == ('', '')


@pytest.mark.parametrize('name', sorted(set(FORMATS) - {'weights'}))
def test_intact_files_are_read(tmp_path: Path, name: str) -> None:
    form = FORMATS[name]
    for number, data in enumerate(form.intact()):
        path = tmp_path / f'file{number}{form.suffix}'
        path.write_bytes(data)
        form.read(path)


@pytest.mark.parametrize('name', FORMATS)
def test_changed_files_are_read_or_refused(name: str) -> None:
    cases = {'bag': 15, 'metadata': 8, 'scene': 10}.get(name, 30)
    found = [finding for _, _, finding in findings([name], seed=1, cases=cases)]
    assert len(found) == cases
    assert not any(found), [finding for finding in found if finding]


@pytest.mark.parametrize('name', FORMATS)
def test_changed_files_are_others_and_the_same_again(name: str) -> None:
    several = [changed_file(FORMATS[name], 0, number) for number in range(20)]
    assert several == [changed_file(FORMATS[name], 0, number) for number in range(20)]
    assert len(set(several)) > 10


def crash(_: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def hang(_: Path) -> None:
    time.sleep(60.0)


def fill(_: Path) -> None:
    np.ones(2**31)


def slip(_: Path) -> None:
    raise KeyError('x')


def unnamed(_: Path) -> None:
    raise UserError('it is wrong')


def unless_intact(read: Callable[[Path], None]) -> Callable[[Path], None]:
    """The first file that a process reads is intact, and does not count."""
    return lambda path: None if path.stem == 'intact' else read(path)


@pytest.mark.parametrize(
    ('read', 'said'),
    [
        (crash, 'the process ended with exit code -9'),
        (hang, 'it takes more than 0.5 s'),
        (fill, 'MemoryError'),
        (slip, "KeyError: 'x'"),
        (unnamed, 'the error does not name the file'),
    ],
)
def test_what_must_not_happen_is_found(
    monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], None], said: str
) -> None:
    form = replace(FORMATS['csv'], read=unless_intact(read))
    monkeypatch.setitem(run.FORMATS, 'csv', form)
    monkeypatch.setattr(run, 'SECONDS', 0.5)
    found = [finding for _, _, finding in findings(['csv'], seed=0, cases=2)]
    assert len(found) == 2
    assert all(finding and said in finding.what for finding in found)


def test_the_command_counts_and_writes_what_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ['fuzz', '--files', 'card', '--cases', '5', '--out', str(tmp_path / 'failed')]
    assert cli.main(words) == 0
    assert capsys.readouterr().out.split()[-3:] == ['card', '5', '0']
    monkeypatch.setitem(run.FORMATS, 'card', replace(FORMATS['card'], read=slip))
    assert cli.main(words) == 1
    assert len(list((tmp_path / 'failed').glob('card_0_*.json'))) == 5
    assert cli.main(['fuzz', '--files', 'carb']) == cli.BAD_INPUT
    assert "no format 'carb', allowed: pose-array" in capsys.readouterr().err
