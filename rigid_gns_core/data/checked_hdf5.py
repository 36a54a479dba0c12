# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""HDF5 files that are written whole, and whose checksum is compared before HDF5 opens them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import hashlib
import os
from pathlib import Path

import h5py

from ..errors import shown, UserError
from ..files.atomic_file import whole_file

# HDF5 leaves the first bytes of a file to others: they hold a line with a checksum of the rest,
# since HDF5 itself may loop for ever or crash on a damaged file
HEAD_SIZE = 512


# what h5py, NumPy and JSON raise where an attribute or an array is absent or another one
_OTHER = (KeyError, ValueError, TypeError, AttributeError, OverflowError, OSError, RuntimeError)


class DatasetError(UserError):
    """A file of data is damaged, incomplete, of another kind, or absent."""


def storable(text: str) -> str:
    """Text as HDF5 holds it: `?` for what is no Unicode, as in names of files, and for NUL."""
    return text.encode('utf-8', 'replace').decode('utf-8').replace('\0', '?')


@contextmanager
def write_checked(path: Path, kind: str) -> Iterator[h5py.File]:
    """Write an HDF5 file, whole or not at all; one that exists is replaced.

    It is built in memory, as HDF5 may crash where the disk is full.

    Args:
        path: File to write.
        kind: What it holds, one word, part of its first line.
    """
    # attributes over 64 kB, such as 10 000 radii, need version 1.10
    with h5py.File(
        path,
        'w',
        libver=('v110', 'v110'),
        userblock_size=HEAD_SIZE,
        driver='core',
        backing_store=False,
    ) as file:
        yield file
        file.flush()
        content = file.id.get_file_image()  # without the user block
    head = f'rigid_gns {kind} sha256 {hashlib.sha256(content).hexdigest()}\n'.encode()
    with whole_file(path) as partial, open(partial, 'wb') as stream:
        stream.write(head.ljust(HEAD_SIZE, b'\0'))
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


@contextmanager
def read_checked(path: Path, kind: str, version: int, remedy: str) -> Iterator[h5py.File]:
    """Open an HDF5 file of `write_checked`, after its checksum was compared.

    Args:
        path: File to read.
        kind: What it must hold.
        version: Value that its attribute `format_version` must have.
        remedy: What makes the file anew, as the end of a message.

    Raises:
        DatasetError: The file is absent, damaged, of another kind or version.
    """
    if not path.is_file():
        raise DatasetError(f'{path}: no such file')
    begin = f'rigid_gns {kind} sha256 '.encode()
    with open(path, 'rb') as stream:
        head = stream.read(HEAD_SIZE)
        expected = head[len(begin) : len(begin) + 64]
        if not head.startswith(begin) or len(expected) < 64:
            raise DatasetError(f'{path}: not a {kind} file, or its beginning is damaged; {remedy}')
        if hashlib.file_digest(stream, 'sha256').hexdigest().encode() != expected:
            raise DatasetError(f'{path}: damaged, its checksum differs; {remedy}')
    try:
        with h5py.File(path, 'r') as file:
            if (found := int(file.attrs['format_version'])) != version:
                raise DatasetError(f'format version {found}, this program reads {version}')
            yield file
    except DatasetError as error:
        raise DatasetError(f'{path}: {error}; {remedy}') from error
    except _OTHER as error:
        raise DatasetError(
            f'{path}: holds something else than a {kind} file of this program: {shown(error)}; '
            f'{remedy}'
        ) from error
