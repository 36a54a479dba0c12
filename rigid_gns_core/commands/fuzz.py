# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns fuzz`: random scenes, and what holds of their motion without a reference."""

from __future__ import annotations

import argparse
from pathlib import Path
import time

from .arguments import completes, positive, seed_number
from ..errors import UserError
from ..files.checkpoint import LAWS
from ..files.tables import number
from ..prediction.load import load_simulator
from ..running.progress import Progress
from ..scenes.scene_file import write_start
from ..studies.fuzz.failure import Failure
from ..studies.fuzz.run import engines_of, fuzz, SUBSTEPS, Tally
from ..studies.fuzz.scenes import Case, KINDS

CASES = 110
"""Number of cases unless it is given: ten of each kind."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `rigid-gns fuzz`."""
    parser.add_argument(
        '--cases', type=positive, metavar='N', help=f'number of cases (default: {CASES})'
    )
    parser.add_argument(
        '--seconds', type=positive, metavar='S', help='go on with new cases for so long instead'
    )
    parser.add_argument(
        '--seed', type=seed_number, default=0, help='seed of all cases (default: 0)'
    )
    parser.add_argument(
        '--from',
        dest='first',
        type=int,
        default=0,
        metavar='CASE',
        help='number of the first case (default: 0); --from CASE --cases 1 runs one again',
    )
    kinds = parser.add_argument(
        '--kinds', nargs='+', default=list(KINDS), metavar='KIND', help='only these (default: all)'
    )
    completes(kinds, KINDS)
    parser.add_argument(
        '--out', type=Path, metavar='DIR', help='write each case that fails as a file'
    )
    completes(
        parser.add_argument(
            '--files',
            nargs='*',
            metavar='FORMAT',
            help='instead of scenes, changed files of these formats (default: all); --cases is '
            'of each format, 200 unless given',
        ),
        _formats,
    )
    parser.epilog = (
        'exit code: 1 where a property fails, or a file is not read or refused as it should be\n'
        'examples:\n'
        '  rigid-gns fuzz --cases 50\n'
        '  rigid-gns fuzz --seconds 600 --seed 7 --out failed\n'
        '  rigid-gns rollout --scene failed/7_123.yaml --steps 60 --out failed.h5\n'
        '  rigid-gns fuzz --files bag csv --seconds 3600 --out failed\n'
        f'kinds: {", ".join(KINDS)}\n'
        'What each property means: docs/fuzzing.md.'
    )


def run(arguments: argparse.Namespace) -> int:
    """Run `rigid-gns fuzz`; the exit code, 1 where a property fails."""
    _check(arguments)
    if arguments.files is not None:
        from .fuzz_files import run as fuzz_files

        return fuzz_files(arguments)
    engines = engines_of(
        load_simulator(LAWS), *(load_simulator(LAWS, substeps=k) for k in SUBSTEPS)
    )
    cases = None if arguments.seconds else arguments.cases or CASES
    tally, end = Tally(), time.monotonic() + (arguments.seconds or 0)
    try:
        with Progress(
            cases or arguments.seconds, 'fuzz', unit='case' if cases else 's'
        ) as progress:
            for case, failures in fuzz(engines, arguments.seed, arguments.first, arguments.kinds):
                tally.add(case, failures)
                for failure in failures:
                    progress.line(_told(case, failure))
                if failures and arguments.out:
                    _write(arguments.out, case, failures)
                left = end - time.monotonic()
                done = tally.done if cases else arguments.seconds - max(0, int(left))
                progress.update(done - progress.done, failed=str(tally.total_failed))
                if tally.done == cases or (not cases and left <= 0):
                    break
    finally:  # after Ctrl-C too
        if tally.done:
            print(tally)
    return int(tally.total_failed > 0)


def _formats() -> list[str]:
    from ..studies.foreign_files.formats import FORMATS

    return list(FORMATS)


def _check(arguments: argparse.Namespace) -> None:
    if arguments.cases and arguments.seconds:
        raise UserError('--cases and --seconds are both given; leave one out')
    if not 0 <= arguments.first < 2**63:
        raise UserError(f'--from is {arguments.first}, expected at least 0 and under 2^63')
    for kind in arguments.kinds:
        if kind not in KINDS:
            raise UserError(f'--kinds: unknown kind {kind!r}, allowed: {", ".join(KINDS)}')


def _told(case: Case, failure: Failure) -> str:
    return (
        f'case {case.number} ({case.kind}, spheres: {len(case.start)}): {failure.name} '
        f'{number(failure.size)}, allowed {number(failure.bound)}: {failure.text}; '
        f'again: rigid-gns fuzz --seed {case.seed} --from {case.number} --cases 1'
    )


def _write(folder: Path, case: Case, failures: list[Failure]) -> None:
    remark = '\n'.join([f'{case.steps} steps', *(_told(case, failure) for failure in failures)])
    write_start(folder / f'{case.seed}_{case.number}.yaml', case.scene, case.start, remark)
