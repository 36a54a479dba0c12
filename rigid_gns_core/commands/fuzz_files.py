# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""`rigid-gns fuzz --files`: changed files of every format, which are read or refused in a line."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
import time

from ..errors import shown, UserError
from ..files.tables import format_rows
from ..running.progress import Progress
from ..studies.foreign_files.formats import FORMATS
from ..studies.foreign_files.run import changed_file, Finding, findings

CASES = 200
"""Number of files of each format unless it is given."""


def run(arguments: argparse.Namespace) -> int:
    """Read changed files; the exit code, 1 where one is not read or refused as it should be."""
    names = arguments.files or list(FORMATS)
    for name in names:
        if name not in FORMATS:
            raise UserError(f'--files: no format {shown(name)}, allowed: {", ".join(FORMATS)}')
    cases = None if arguments.seconds else arguments.cases or CASES
    total = arguments.seconds or (arguments.cases or CASES) * len(names)
    end = time.monotonic() + (arguments.seconds or 0)
    read: Counter[str] = Counter()
    failed: Counter[str] = Counter()
    try:
        with Progress(total, 'fuzz', unit='file' if cases else 's') as progress:
            for name, _, found in findings(names, arguments.seed, arguments.first, cases):
                read[name] += 1
                if found is not None:
                    failed[name] += 1
                    progress.line(_told(found))
                    if arguments.out:
                        _write(arguments.out, found)
                left = end - time.monotonic()
                done = read.total() if cases else total - max(0, int(left))
                progress.update(done - progress.done, failed=str(failed.total()))
                if not cases and left <= 0:
                    break
    finally:  # after Ctrl-C too
        rows = [[name, str(read[name]), str(failed[name])] for name in names if read[name]]
        if rows:
            print(format_rows(['format', 'files', 'failed'], rows))
    return int(failed.total() > 0)


def _told(found: Finding) -> str:
    return (
        f'file {found.number} ({found.format}): {found.what}; again: rigid-gns fuzz --files '
        f'{found.format} --seed {found.seed} --from {found.number} --cases 1 --out DIR'
    )


def _write(folder: Path, found: Finding) -> None:
    form = FORMATS[found.format]
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f'{found.format}_{found.seed}_{found.number}{form.suffix}'
    path.write_bytes(changed_file(form, found.seed, found.number))
    if found.trace:
        path.with_suffix('.txt').write_text(found.trace, encoding='utf-8')
