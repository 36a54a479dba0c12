# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that are written whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path


def make_folder(folder: Path, path: Path | None = None) -> None:
    """Make a folder if absent, for a file `path` in it.

    Raises:
        OSError: It cannot be made; where a file has its name, the message says so.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        file = next(one for one in (folder, *folder.parents) if one.exists())
        raise OSError(f'{path or folder} cannot be written: {file} is no folder') from error


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Write a file whole or not at all: yield a temporary path that replaces `path` at the end.

    Where the block raises, or the process is killed in it, the old file stays. The folder is made
    if absent. The file that a symbolic link names is replaced, not the link. What is no file, such
    as a pipe or /dev/stdout, is written as it is.

    Raises:
        OSError: The file cannot be written; the message names it, also where the disk is full.
    """
    if path.exists() and not path.is_file() and not path.is_dir():
        yield path
        return
    path = Path(os.path.realpath(path))
    make_folder(path.parent, path)
    partial = path.with_name(f'.{path.name}.{os.getpid()}.tmp')
    try:
        yield partial
        os.replace(partial, path)
    except OSError as error:
        if error.errno is None or error.filename not in (None, str(partial)):
            raise
        # a failed write does not know its file, and nobody else knows the temporary one
        raise OSError(error.errno, f'cannot be written: {error.strerror}', str(path)) from error
    finally:
        partial.unlink(missing_ok=True)
