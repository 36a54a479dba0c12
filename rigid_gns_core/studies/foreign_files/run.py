# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reads changed files one after the other, in a process that may die.

A file may be read, or refused by one UserError that names it. Everything else is a finding:
another error, a dead process, more than `SECONDS`, or more than `MEMORY`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
import resource
from tempfile import TemporaryDirectory
import traceback
import warnings

import numpy as np

from .formats import Format, FORMATS
from ...errors import UserError

SECONDS = 10.0
"""Longest time that one file may take [s]."""
MEMORY = 2**30
"""Most memory that reading may take, above what the process has [bytes]."""
LONGEST = 4000
"""Most characters of an error, besides what a bag warns of."""
_BEGIN = 300.0  # longest time to load all that is needed [s]
_BATCH = 200  # files read by one process


@dataclass(frozen=True)
class Finding:
    """A file that was not read as it should be.

    Args:
        format: Name of its format.
        seed: Seed of all files.
        number: Number of the file.
        what: What happened, in a line.
        trace: Where, if known.
    """

    format: str
    seed: int
    number: int
    what: str
    trace: str = ''


def changed_file(form: Format, seed: int, number: int) -> bytes:
    """Content of a changed file; a tenth of all are random bytes or intact."""
    code = sum(form.name.encode())
    rng = np.random.default_rng([seed, number, code])
    intact = form.intact()
    data = intact[number % len(intact)]
    if rng.random() < 0.05:
        return bytes(rng.integers(0, 256, int(rng.integers(300)), dtype=np.uint8))
    return data if rng.random() < 0.05 else form.mutate(data, rng)


def problem_of(form: Format, path: Path) -> tuple[str, str]:
    """What is wrong with how a file is read, and where; empty: nothing."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            form.read(path)
    except UserError as error:
        text = str(error)
        if form.named and str(path) not in text and path.stem not in text:
            return f'the error does not name the file: {_line(text)}', traceback.format_exc()
        if len(text.splitlines()[0] if text else '') > LONGEST:
            return f'an error of {len(text)} characters: {_line(text)}', ''
        return ('an error without a text', '') if not text.strip() else ('', '')
    except Exception as error:
        return f'{type(error).__name__}: {_line(str(error))}', traceback.format_exc()
    return '', ''


def findings(
    names: Sequence[str], seed: int, first: int = 0, cases: int | None = None
) -> Iterator[tuple[str, int, Finding | None]]:
    """Read changed files of each format in turn: format, number, and what was found.

    Args:
        names: Names of formats.
        seed: Seed of all files.
        first: Number of the first file of each.
        cases: Number of files of each; None: without end.
    """
    last = None if cases is None else first + cases
    for begin in count(first, _BATCH):
        if last is not None and begin >= last:
            return
        end = begin + _BATCH if last is None else min(begin + _BATCH, last)
        for name in names:
            yield from _batch(FORMATS[name], seed, begin, end)


def _batch(
    form: Format, seed: int, begin: int, end: int
) -> Iterator[tuple[str, int, Finding | None]]:
    """Read files in a process of its own; where it dies, in another from the next file on."""
    while begin < end:
        mine, its = get_context('fork').Pipe()
        arguments = (mine, its, form, seed, begin, end)
        process = get_context('fork').Process(target=_read, args=arguments)
        process.start()
        its.close()
        try:
            if not mine.poll(_BEGIN):
                raise RuntimeError(f'an intact {form.name} is not read within {_BEGIN:g} s')
            mine.recv()
            while begin < end and process.exitcode is None:
                what, trace = _answer(mine, process)
                begin += 1
                found = Finding(form.name, seed, begin - 1, what, trace) if what else None
                yield form.name, begin - 1, found
        finally:
            process.kill()
            process.join()
            mine.close()


def _answer(mine: Connection, process: BaseProcess) -> tuple[str, str]:
    """What the process says of its next file, or what became of it; it is then gone."""
    if not mine.poll(SECONDS):
        process.kill()
        process.join()
        return f'it takes more than {SECONDS:g} s', ''
    try:
        what, trace = mine.recv()
    except EOFError:
        process.join()
        return f'the process ended with exit code {process.exitcode}', ''
    return str(what), str(trace)


def _read(
    others: Connection, pipe: Connection, form: Format, seed: int, begin: int, end: int
) -> None:
    others.close()  # or this process would wait for ever for a killed parent
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    used = int(Path('/proc/self/statm').read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    with TemporaryDirectory() as folder:
        path = Path(folder) / f'intact{form.suffix}'
        path.write_bytes(form.intact()[0])
        problem_of(form, path)  # what is loaded on a first use is no fault of the first file
        pipe.send('ready')
        for number in range(begin, end):
            path = Path(folder) / f'file{number}{form.suffix}'
            path.write_bytes(changed_file(form, seed, number))
            pipe.send(problem_of(form, path))
            path.unlink()
    with suppress(EOFError):
        pipe.recv()  # what was sent may wait to be read


def _line(text: str) -> str:
    short = ' '.join(text.split())
    return short if len(short) <= 200 else f'{short[:150]}...{short[-40:]}'
