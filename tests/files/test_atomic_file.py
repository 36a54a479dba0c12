# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a file that is written whole may lie, and what is no file."""

from __future__ import annotations

import os
from pathlib import Path
import threading

import pytest
from rigid_gns_core.files.atomic_file import whole_file


def write(path: Path, text: str) -> None:
    with whole_file(path) as partial:
        partial.write_text(text)


def test_what_is_no_file_is_written_and_stays(tmp_path: Path) -> None:
    """A device that is replaced by a file, as by root, is lost to all other programs."""
    pipe = tmp_path / 'pipe'
    os.mkfifo(pipe)
    heard: list[str] = []
    reader = threading.Thread(target=lambda: heard.append(pipe.read_text()))
    reader.start()
    write(pipe, 'x')
    reader.join(10)
    assert heard == ['x'] and pipe.is_fifo()
    assert list(tmp_path.iterdir()) == [pipe]


def test_the_file_of_a_link_is_replaced(tmp_path: Path) -> None:
    (tmp_path / 'folder').mkdir()
    link, file = tmp_path / 'link', tmp_path / 'folder' / 'file'
    link.symlink_to(file)
    for text in ('made', 'replaced'):
        write(link, text)
        assert link.is_symlink() and file.read_text() == text


def test_a_folder_that_is_a_file_is_named(tmp_path: Path) -> None:
    (tmp_path / 'a').write_text('x')
    for place in ('a/b', 'a/b/c'):
        with pytest.raises(OSError, match=r'.*/a/b.* cannot be written: .*/a.* is no folder'):
            write(tmp_path / place, 'y')
    with pytest.raises(IsADirectoryError):
        write(tmp_path, 'y')
    assert (tmp_path / 'a').read_text() == 'x' and len(list(tmp_path.iterdir())) == 1
