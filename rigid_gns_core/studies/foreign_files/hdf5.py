# SPDX-FileCopyrightText: 2026 rigid_gns maintainers
# SPDX-License-Identifier: Apache-2.0

"""HDF5 files with a right checksum and a wrong content, as another program may write them."""

from __future__ import annotations

import hashlib
from io import BytesIO
from typing import Any

import h5py
import numpy as np

from .mutations import mutated_bytes, mutated_text
from ...data.checked_hdf5 import HEAD_SIZE

_MOST = 3  # changes of one file


def mutated_hdf5(data: bytes, rng: np.random.Generator) -> bytes:
    """Mostly other attributes and arrays under a right checksum; else damaged bytes."""
    if rng.random() < 0.2:
        return mutated_bytes(data, rng)
    image = BytesIO(data)
    with h5py.File(image, 'r+') as file:
        for _ in range(int(rng.integers(1, _MOST + 1))):
            _change(file, rng)
    content = image.getvalue()
    kind = content[:HEAD_SIZE].split()[1].decode()
    body = content[HEAD_SIZE:]
    head = f'rigid_gns {kind} sha256 {hashlib.sha256(body).hexdigest()}\n'.encode()
    return head.ljust(HEAD_SIZE, b'\0') + body


def _change(file: h5py.File, rng: np.random.Generator) -> None:
    """Change an attribute, a data set or a group."""
    groups = [file, *(item for item in file.values() if isinstance(item, h5py.Group))]
    group = groups[int(rng.integers(len(groups)))]
    if len(group.attrs) and rng.random() < 0.5:
        names = sorted(group.attrs)
        _change_attribute(group, names[int(rng.integers(len(names)))], rng)
    elif len(group):
        names = sorted(group)
        _change_item(group, names[int(rng.integers(len(names)))], rng)


def _change_attribute(group: h5py.Group, name: str, rng: np.random.Generator) -> None:
    value = group.attrs[name]
    if rng.random() < 0.2:
        del group.attrs[name]
        return
    if isinstance(value, str) and rng.random() < 0.7:
        text = (
            mutated_text(value.encode('utf-8', 'replace'), rng)
            .decode('utf-8', 'ignore')
            .replace('\0', '')
        )
        group.attrs[name] = text[:60_000]
        return
    odd: tuple[Any, ...] = (-1, 0, 2**62, float('nan'), float('inf'), -1.5, 'x', '', b'\xff\xfe')
    odd += (np.zeros(3), np.zeros((0,)), True, h5py.Empty('f8'))
    group.attrs[name] = odd[int(rng.integers(len(odd)))]


def _change_item(group: h5py.Group, name: str, rng: np.random.Generator) -> None:
    item = group[name]
    how = int(rng.integers(6))
    if how == 0 or isinstance(item, h5py.Group):
        if how % 2:
            group.move(name, ('x', '9' * 30, '-1', 'é', '٣')[int(rng.integers(5))])
        else:
            del group[name]
        return
    if item.dtype.kind not in 'fiu' or item.shape is None:  # another change was here before
        del group[name]
        return
    values = np.asarray(item)
    del group[name]
    if how == 1:
        group.create_group(name)
    elif how == 2:
        group[name] = np.full(values.shape, 'x', dtype=h5py.string_dtype())
    elif how == 3:
        cut = tuple(slice(int(rng.integers(size + 1))) for size in values.shape)
        group[name] = values[cut]
    elif how == 4:
        odd = rng.choice([np.nan, np.inf, -np.inf, 0.0, 1e300, -1e300, 1e-300])
        values = values.astype(np.float64)
        values.reshape(-1)[int(rng.integers(max(values.size, 1))) :][: int(rng.integers(9))] = odd
        group[name] = values
    else:
        other: tuple[Any, ...] = (values[None], values.reshape(-1), values + 1j)
        other += (values.astype('f2'), values.astype('S4'), np.float64(1.0), h5py.Empty('f8'))
        group[name] = other[int(rng.integers(len(other)))]
